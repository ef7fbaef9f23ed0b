// Programs: checking at the border, the interpreter, and the parts that answer one question.
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

// The ops that ask for the view, and the closures that set themselves up for it.
constexpr const char* kViewOps[] = {
    "incoming",    "object_incoming", "ambient_occlusion", "bevel",        "reflection",  "ray_kind",    "ray_length",
    "ray_depth",   "light_falloff",   "fresnel",           "layer_weight", "camera_data", "translucent", "sheen",
    "velvet",      "glossy",          "refraction",        "glass",        "metallic",    "sheen_layer", "coat_layer",
    "metal_layer", "glass_layer",     "specular_layer",    "hair_strand",  "hair_chiang", "hair_huang"};

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

std::shared_ptr<Program> Program::reduced_to(uint8_t effects) const {
  auto reduced = std::make_shared<Program>(*this);
  reduced->transparency_.reset(), reduced->emission_.reset(), reduced->aovs_.reset();
  reduced->drop_all_but(effects);
  reduced->summarise();
  reduced->pack_registers();
  return reduced;
}

}  // namespace gi
