// A node tree as a register program: a flat list of instructions over float registers whose first ones are constants.
// Python compiles node trees to programs (gi_engine/nodes); ops live by family in ops_*.cpp.
//
// Instruction: [op, outputs…, inputs…, immediates…]; outputs and inputs are register numbers; a value of width 3
// ('v': vector, normal, RGB) takes three registers in a row. Jumps go forwards only, so programs always end.
#pragma once
#include <cstring>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/vec.h"
#include "shading/bsdf.h"
#include "shading/shading_point.h"

namespace gi {

class Medium;
struct ShaderResources;  // images and attribute tables that ops may read: see shading/resources.h

// What one run of a program works on.
struct ShadeState {
  ShadingPoint& point;               // ops may shift it (bump)
  const ShaderResources& resources;
  const float* tables;               // the program's lookup tables (ramps, curves)
  Bsdf* bsdf;                        // where closures go; null when only values are wanted
  Medium* medium = nullptr;          // where those of a volume go
  std::span<float> aovs = {};        // where AOV outputs add, four floats each
};

// Access to one instruction's operands, in the order of its signature: outputs, inputs, immediates.
struct Operands {
  const int32_t* slots;
  float* registers;
  float f(int i) const { return registers[slots[i]]; }
  Vec3 v(int i) const {
    const float* p = registers + slots[i];
    return {p[0], p[1], p[2]};
  }
  Rgb c(int i) const { return Rgb(v(i)); }
  int imm(int i) const { return slots[i]; }
  void set(int i, float x) const { registers[slots[i]] = x; }
  void set(int i, Vec3 x) const {
    float* p = registers + slots[i];
    p[0] = x.x, p[1] = x.y, p[2] = x.z;
  }
  void set(int i, Rgb x) const { set(i, Vec3{x.r(), x.g(), x.b()}); }
};

using OpFunction = void (*)(const Operands&, ShadeState&);

enum class OpKind : uint8_t {
  kPure,     // depends on its inputs alone: folded where they are constant
  kContext,  // reads the shading point, images or tables
  kClosure,  // adds a lobe, emission or transparency: kept by what it adds
  kControl,  // jump_if_zero, set_normal: what comes after depends on it
  kShift,    // moves the point, and gives what kRestore needs to move it back: kept if something in between is
  kRestore,
};
// What a closure op adds, for the programs specialised to one question, and whether it looks at the point to do so.
enum ClosureEffect : uint8_t { kAddsLobe = 1, kAddsEmission = 2, kAddsTransparency = 4, kSeesPoint = 8, kAddsAov = 16, kMayMirror = 32 };

// The inputs of an op that are constant, by operand.
struct KnownInputs {
  const Operands& operands;
  const uint8_t* known;  // by operand
  bool is(int i, float x) const { return known[i] && operands.f(i) == x; }
  bool is(int i, Vec3 x) const { return known[i] && operands.v(i) == x; }
};
// What an op gives whatever its other inputs are, where some are constant: one of its operands as it is, or zero.
inline constexpr int kNothingKnown = -1, kZero = -2;

struct Op {
  const char* name;
  const char* outputs;  // 'f' or 'v' each
  const char* inputs;
  int immediates;
  OpKind kind;
  OpFunction run;       // null for jump_if_zero, which the interpreter itself runs
  uint8_t effects = 0;
  // Whether the immediates are in order, given the size of the program's tables; null: any are.
  bool (*accepts)(const int32_t* immediates, size_t tables) = nullptr;
  // Of ops with one output: the operand that it equals, kZero or kNothingKnown.
  int (*equals)(const KnownInputs&) = nullptr;
  int width() const { return 1 + int(std::strlen(outputs)) + int(std::strlen(inputs)) + immediates; }
};

// Every op; the index is the op code. Op 0 is jump_if_zero(condition; target).
std::span<const Op> ops();

class Program {
 public:
  Program() = default;
  // Checks every op, register and jump, folds constants, drops what adds to nothing and packs registers. Throws InputError
  // naming `name` (the material).
  Program(std::string name, std::vector<int32_t> code, std::vector<float> constants, int register_count, std::vector<float> tables);

  static constexpr int kMaxRegisters = 4096;       // after packing
  static constexpr int kMaxUnpacked = 1 << 20;

  void run(ShadingPoint& point, const ShaderResources& resources, Bsdf* bsdf, Medium* medium = nullptr) const;
  // What AOV outputs add at the point: four floats for each of the film's AOVs. The program itself leaves them out.
  bool has_aovs() const { return aovs_ != nullptr; }
  void add_aovs(ShadingPoint point, const ShaderResources& resources, std::span<float> aovs) const;
  int register_count() const { return register_count_; }
  // The part of the program that decides transparency (shadow rays), or emission (light sampling).
  const Program& transparency_program() const { return *transparency_; }
  const Program& emission_program() const { return *emission_; }

  const std::string& name() const { return name_; }
  bool has_transparency() const { return effects_ & kAddsTransparency; }
  bool has_emission() const { return effects_ & kAddsEmission; }
  bool may_mirror() const { return effects_ & kMayMirror; }  // whether a lobe of it may be perfectly smooth
  // Whether its lobes may depend on where the surface is seen from, or on how it came to be seen.
  bool sees_view() const { return sees_view_; }
  // Whether it looks at the kind of ray that asks, or how many there were before.
  bool sees_path() const;
  // Whether what it gives may be another thing elsewhere in the same object.
  bool varies_in_space() const;
  // Of a volume's: whether it neither scatters nor glows, whatever values it works with.
  bool only_absorbs() const;
  bool empty() const { return code_.empty(); }
  // Whether it does the same, step by step.
  bool same_as(const Program& other) const { return code_ == other.code_ && constants_ == other.constants_ && tables_ == other.tables_; }
  // Immediate `index` of every call of op `name`: what the program will ask of its surroundings.
  std::vector<int32_t> immediates(std::string_view name, int index) const;
  // What it emits where that does not depend on the point: no context op decides it.
  const std::optional<Rgb>& constant_emission() const { return constant_emission_; }

 private:
  void check() const;
  void fold_constants();  // program_folding.cpp
  template <class Wanted>
  void keep(const Wanted& wanted, const std::vector<float>& values, const std::vector<bool>& known);
  void drop_all_but(uint8_t effects);
  void pack_registers();
  void summarise();
  uint8_t effects_of_ops() const;
  bool uses(std::string_view name) const;
  std::optional<Rgb> find_constant_emission() const;
  void run_code(float* registers, ShadeState& state) const;
  std::shared_ptr<Program> reduced_to(uint8_t effects) const;

  std::string name_;
  std::vector<int32_t> code_;
  std::vector<float> constants_;
  int register_count_ = 0;
  std::vector<float> tables_;
  // The code once more, as the interpreter wants it.
  struct Step {
    OpFunction run;       // null: jump_if_zero
    uint32_t operands;    // where they begin in the code
    uint32_t target = 0;  // of a jump, as a step
  };
  std::vector<Step> steps_;
  uint8_t effects_ = 0;
  bool sees_view_ = false;
  std::optional<Rgb> constant_emission_;
  std::shared_ptr<Program> transparency_, emission_, aovs_;
};

}  // namespace gi
