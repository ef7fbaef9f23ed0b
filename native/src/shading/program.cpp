// Programs: checking at the border, folding of constants, the interpreter, and the parts that answer one question.
#include "shading/program.h"

#include <algorithm>
#include <cmath>

#include "core/check.h"
#include "shading/instructions.h"
#include "shading/resources.h"

namespace gi {

Program::Program(std::string name, std::vector<int32_t> code, std::vector<float> constants, int register_count, std::vector<float> tables)
    : name_(std::move(name)),
      code_(std::move(code)),
      constants_(std::move(constants)),
      register_count_(register_count),
      tables_(std::move(tables)) {
  check();
  fold_constants();
  if (effects_of_ops() & kAddsAov) aovs_ = reduced_to(kAddsAov);
  drop_all_but(kAddsLobe | kAddsEmission | kAddsTransparency);
  summarise();
  if (effects_ & kAddsTransparency) transparency_ = reduced_to(kAddsTransparency);
  if (effects_ & kAddsEmission) emission_ = reduced_to(kAddsEmission);
  constant_emission_ = find_constant_emission();
  pack_registers();
}

void Program::check() const {
  const std::string who = "the node program of '" + name_ + "': ";
  require(register_count_ >= 0 && register_count_ <= kMaxUnpacked,
          who + "needs " + std::to_string(register_count_) + " registers; the most is " + std::to_string(kMaxUnpacked));
  require(int(constants_.size()) <= register_count_, who + "has more constants than registers");
  std::vector<bool> starts(code_.size() + 1, false);
  std::vector<size_t> targets;
  for (size_t at = 0; at < code_.size();) {
    require(code_[at] >= 0 && size_t(code_[at]) < ops().size(), who + "there is no op " + std::to_string(code_[at]));
    starts[at] = true;
    const Op& op = ops()[size_t(code_[at])];
    const std::string where = who + "op '" + op.name + "' ";
    require(at + size_t(op.width()) <= code_.size(), where + "is cut off");
    const Instruction instruction{op, code_.data() + at + 1};
    const auto in_range = [&](int32_t slot, int width) {
      require(slot >= 0 && slot <= register_count_ - width,
              where + "uses register " + std::to_string(slot) + " of " + std::to_string(register_count_));
    };
    instruction.for_outputs([&](int32_t slot, int width) {
      in_range(slot, width);
      require(size_t(slot) >= constants_.size(), where + "writes into a constant");
    });
    instruction.for_inputs(in_range);
    require(!op.accepts || op.accepts(code_.data() + at + op.width() - op.immediates, tables_.size()),
            where + "refers to a table that is not there");
    if (code_[at] == kJump) {
      const int32_t target = code_[at + 2];
      require(target > int32_t(at) && size_t(target) <= code_.size(), where + "does not jump forwards");
      targets.push_back(size_t(target));
    }
    at += size_t(op.width());
  }
  starts[code_.size()] = true;
  for (const size_t target : targets) require(starts[target], who + "a jump lands inside an instruction");
}

std::vector<int32_t> Program::immediates(std::string_view name, int index) const {
  std::vector<int32_t> found;
  for_each_instruction(code_, [&](size_t, const Instruction& i) {
    if (i.op.name == name) found.push_back(i.operands[i.op.width() - 1 - i.op.immediates + index]);
  });
  return found;
}

void Program::run(ShadingPoint& point, const ShaderResources& resources, Bsdf* bsdf, Medium* medium) const {
  float registers[kMaxRegisters + 2];
  std::copy(constants_.begin(), constants_.end(), registers);
  ShadeState state{point, resources, tables_.data(), bsdf, medium};
  run_code(registers, state);
}

void Program::add_aovs(ShadingPoint point, const ShaderResources& resources, std::span<float> aovs) const {
  float registers[kMaxRegisters + 2];
  std::copy(aovs_->constants_.begin(), aovs_->constants_.end(), registers);
  ShadeState state{point, resources, tables_.data(), nullptr, nullptr, aovs};
  aovs_->run_code(registers, state);
}

void Program::run_code(float* registers, ShadeState& state) const {
  const int32_t* code = code_.data();
  const Step *steps = steps_.data(), *end = steps + steps_.size();
  for (const Step* step = steps; step < end;) {
    if (step->run) {
      step->run(Operands{code + step->operands, registers}, state);
      ++step;
    } else {
      step = registers[code[step->operands]] == 0.0f ? steps + step->target : step + 1;
    }
  }
}

// Pure ops whose inputs are constant are run once, here; what they give joins the constants. A register that is written
// more than once (in the arms of a jump) is left alone.
void Program::fold_constants() {
  std::vector<int> writes(size_t(register_count_), 0);
  for_each_instruction(code_, [&](size_t, const Instruction& i) {
    i.for_outputs([&](int32_t slot, int width) {
      for (int k = 0; k < width; ++k) ++writes[size_t(slot + k)];
    });
  });
  std::vector<float> values(size_t(register_count_), 0.0f);
  std::copy(constants_.begin(), constants_.end(), values.begin());
  std::vector<bool> known(size_t(register_count_), false);
  std::fill_n(known.begin(), constants_.size(), true);
  std::vector<bool> folded(code_.size() + 1, false);
  bool any = false;
  size_t skipped_until = 0;
  for_each_instruction(code_, [&](size_t at, const Instruction& i) {
    if (at < skipped_until) {
      folded[at] = true;
      return;
    }
    if (code_[at] == kJump && known[size_t(code_[at + 1])]) {
      if (values[size_t(code_[at + 1])] == 0.0f) skipped_until = size_t(code_[at + 2]);
      folded[at] = any = true;
      return;
    }
    bool constant = i.op.kind == OpKind::kPure;
    i.for_inputs([&](int32_t slot, int width) {
      for (int k = 0; k < width; ++k) constant = constant && known[size_t(slot + k)];
    });
    i.for_outputs([&](int32_t slot, int width) {
      for (int k = 0; k < width; ++k) constant = constant && writes[size_t(slot + k)] == 1;
    });
    if (!constant) return;
    ShadingPoint nowhere;
    static const ShaderResources nothing{};
    ShadeState state{nowhere, nothing, tables_.data(), nullptr};
    i.op.run(Operands{i.operands, values.data()}, state);
    i.for_outputs([&](int32_t slot, int width) {
      for (int k = 0; k < width; ++k) known[size_t(slot + k)] = true;
    });
    folded[at] = any = true;
  });
  if (any) keep([&](size_t at, const Instruction&) { return !folded[at]; }, values, known);
}

// Rebuilds the program from the instructions that `wanted` keeps, with all known registers moved to the front as constants.
template <class Wanted>
void Program::keep(const Wanted& wanted, const std::vector<float>& values, const std::vector<bool>& known) {
  std::vector<bool> used(values.size(), false);
  for_each_instruction(code_, [&](size_t at, const Instruction& i) {
    if (!wanted(at, i)) return;
    const auto use = [&](int32_t slot, int width) {
      std::fill_n(used.begin() + slot, width, true);
      for (int k = 1; k < width; ++k)  // or they would not stay together
        require(known[size_t(slot + k)] == known[size_t(slot)], "the node program of '" + name_ + "' reads across two values");
    };
    i.for_outputs(use), i.for_inputs(use);
  });
  // Renumber: known registers first. The three of a vector stay together because all are known or none is.
  std::vector<int32_t> place(values.size(), 0);
  std::vector<float> constants;
  int32_t next = 0;
  for (size_t r = 0; r < place.size(); ++r)
    if (known[r] && used[r]) place[r] = next++, constants.push_back(values[r]);
  for (size_t r = 0; r < place.size(); ++r)
    if (!known[r] && used[r]) place[r] = next++;

  std::vector<int32_t> code;
  std::vector<int32_t> moved(code_.size() + 1);
  std::vector<size_t> jumps;
  for_each_instruction(code_, [&](size_t at, const Instruction& i) {
    moved[at] = int32_t(code.size());
    if (!wanted(at, i)) return;
    const size_t start = code.size();
    code.insert(code.end(), code_.begin() + ptrdiff_t(at), code_.begin() + ptrdiff_t(at) + i.op.width());
    const int registers = int(std::strlen(i.op.outputs) + std::strlen(i.op.inputs));
    for (int k = 0; k < registers; ++k) code[start + 1 + size_t(k)] = place[size_t(code[start + 1 + size_t(k)])];
    if (code_[at] == kJump) jumps.push_back(start);
  });
  moved[code_.size()] = int32_t(code.size());
  for (const size_t j : jumps) code[j + 2] = moved[size_t(code[j + 2])];
  code_ = std::move(code);
  constants_ = std::move(constants);
  register_count_ = next;
}

// The ops that ask for the view, and the closures that set themselves up for it.
constexpr const char* kViewOps[] = {
    "incoming",      "object_incoming", "ambient_occlusion", "bevel",       "reflection",  "ray_kind",    "ray_length",  "ray_depth",
    "light_falloff", "fresnel",         "layer_weight",      "camera_data", "translucent", "sheen",       "velvet",      "glossy",
    "refraction",    "glass",           "metallic",          "sheen_layer", "coat_layer",  "metal_layer", "glass_layer", "specular_layer",
    "hair_strand",   "hair_chiang",     "hair_huang"};

bool Program::uses(std::string_view name) const {
  bool found = false;
  for_each_instruction(code_, [&](size_t, const Instruction& i) { found = found || name == i.op.name; });
  return found;
}

bool Program::sees_path() const { return uses("ray_kind") || uses("ray_depth") || uses("ray_length"); }

// What is alike all over the inside of an object; of attributes only the object's own are known there.
constexpr const char* kUniformOps[] = {"object_location", "object_color", "object_index",  "object_random", "attribute",
                                       "has_attribute",   "uv",           "ray_kind",      "ray_length",    "ray_depth",
                                       "normal",          "true_normal",  "object_normal", "incoming",      "object_incoming",
                                       "backfacing",      "parametric"};

bool Program::varies_in_space() const {
  bool varies = false;
  for_each_instruction(code_, [&](size_t, const Instruction& i) {
    const auto is_op = [&](std::string_view name) { return name == i.op.name; };
    varies = varies || (i.op.kind == OpKind::kContext && std::none_of(std::begin(kUniformOps), std::end(kUniformOps), is_op));
  });
  return varies;
}

bool Program::only_absorbs() const {
  bool only = true;
  for_each_instruction(code_, [&](size_t, const Instruction& i) {
    if (std::string_view(i.op.name) != "volume_coefficients") return;
    for (const int input : {2, 3}) {  // what it scatters and emits
      const size_t slot = size_t(i.operands[input]);
      only = only && slot < constants_.size() && std::all_of(&constants_[slot], &constants_[slot] + 3, [](float x) { return x == 0.0f; });
    }
  });
  return only;
}

uint8_t Program::effects_of_ops() const {
  uint8_t effects = 0;
  for_each_instruction(code_, [&](size_t, const Instruction& i) { effects |= i.op.effects; });
  return effects;
}

void Program::summarise() {
  effects_ = effects_of_ops();
  sees_view_ = std::any_of(std::begin(kViewOps), std::end(kViewOps), [&](const char* name) { return uses(name); });
  steps_.clear();
  std::vector<uint32_t> step_at(code_.size() + 1, 0);
  for_each_instruction(code_, [&](size_t at, const Instruction& i) {
    step_at[at] = uint32_t(steps_.size());
    steps_.push_back({code_[at] == kJump ? nullptr : i.op.run, uint32_t(at + 1)});
  });
  step_at[code_.size()] = uint32_t(steps_.size());
  for (Step& step : steps_)
    if (!step.run) step.target = step_at[size_t(code_[step.operands + 1])];
}

std::optional<Rgb> Program::find_constant_emission() const {
  if (!emission_) return Rgb();
  bool constant = true;
  for_each_instruction(emission_->code_, [&](size_t, const Instruction& i) {
    constant = constant && i.op.kind == OpKind::kClosure && !(i.op.effects & kSeesPoint);
  });
  if (!constant) return std::nullopt;
  ShadingPoint nowhere;
  nowhere.wo = nowhere.ng = nowhere.ns = {0, 0, 1};
  Bsdf bsdf;
  bsdf.clear(nowhere.ng, nowhere.ns);
  emission_->run(nowhere, ShaderResources{}, &bsdf);
  return bsdf.emission;
}

// Keeps the closures with one of `effects`, what they depend on, and control: read backwards, an instruction is needed if
// something later that is kept reads what it writes.
void Program::drop_all_but(uint8_t effects) {
  std::vector<size_t> order;
  for_each_instruction(code_, [&](size_t at, const Instruction&) { order.push_back(at); });
  std::vector<bool> needed(size_t(register_count_), false), kept(code_.size() + 1, false);
  std::vector<size_t> restore(size_t(register_count_), 0);  // where a shifted point goes back, by what the shift saved
  size_t next_kept = code_.size();
  for (size_t n = order.size(); n-- > 0;) {
    const size_t at = order[n];
    const Op& op = ops()[size_t(code_[at])];
    const Instruction i{op, code_.data() + at + 1};
    bool keep_it = op.kind == OpKind::kControl || (op.kind == OpKind::kClosure && (op.effects & effects));
    i.for_outputs([&](int32_t slot, int width) {
      for (int k = 0; k < width; ++k) keep_it = keep_it || needed[size_t(slot + k)];
    });
    if (code_[at] == kJump) keep_it = next_kept < size_t(code_[at + 2]);
    if (op.kind == OpKind::kRestore) restore[size_t(i.operands[0])] = at;
    if (op.kind == OpKind::kShift) {
      const size_t back = restore[size_t(i.operands[0])];
      keep_it = next_kept < back;
      if (keep_it) kept[back] = true;
    }
    if (!keep_it) continue;
    kept[at] = true, next_kept = at;
    i.for_inputs([&](int32_t slot, int width) {
      for (int k = 0; k < width; ++k) needed[size_t(slot + k)] = true;
    });
  }
  std::vector<bool> known(size_t(register_count_), false);
  std::fill_n(known.begin(), constants_.size(), true);
  std::vector<float> values(size_t(register_count_), 0.0f);
  std::copy(constants_.begin(), constants_.end(), values.begin());
  keep([&](size_t at, const Instruction&) { return bool(kept[at]); }, values, known);
}

std::shared_ptr<Program> Program::reduced_to(uint8_t effects) const {
  auto reduced = std::make_shared<Program>(*this);
  reduced->transparency_.reset(), reduced->emission_.reset(), reduced->aovs_.reset();
  reduced->drop_all_but(effects);
  reduced->summarise();
  reduced->pack_registers();
  return reduced;
}

}  // namespace gi
