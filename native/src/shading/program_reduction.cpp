// Making programs shorter: what is constant is worked out once, what leaves a value as it is and what adds to nothing is left out.
#include <algorithm>

#include "core/check.h"
#include "shading/instructions.h"
#include "shading/resources.h"

namespace gi {
namespace {

// Which registers stand for others that hold the same value.
class Equals {
 public:
  explicit Equals(int registers) : same_as_(size_t(registers)) {
    for (int i = 0; i < registers; ++i) same_as_[size_t(i)] = i;
  }
  void set(int32_t slot, int32_t other, int width) {
    for (int k = 0; k < width; ++k) same_as_[size_t(slot + k)] = other + k;
  }
  // Where to read instead, if the registers still lie side by side there.
  int32_t of(int32_t slot, int width) const {
    for (int k = 1; k < width; ++k)
      if (same_as_[size_t(slot + k)] != same_as_[size_t(slot)] + k) return slot;
    return same_as_[size_t(slot)];
  }

 private:
  std::vector<int32_t> same_as_;
};

}  // namespace

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

// Pure ops whose inputs are constant are run once, here; what they give joins the constants. Ops that give back one of their
// inputs (a sum with 0, a mix of all of one side) are passed by. A register that is written more than once (in the arms of a
// jump) is left alone.
void Program::fold_constants() {
  std::vector<int> writes(size_t(register_count_), 0);
  for_each_instruction(code_, [&](size_t, const Instruction& i) {
    i.for_outputs([&](int32_t slot, int width) {
      for (int k = 0; k < width; ++k) ++writes[size_t(slot + k)];
    });
  });
  const auto written_once = [&](int32_t slot, int width) {
    return std::all_of(writes.begin() + slot, writes.begin() + slot + width, [](int n) { return n == 1; });
  };
  std::vector<float> values(size_t(register_count_), 0.0f);
  std::copy(constants_.begin(), constants_.end(), values.begin());
  std::vector<bool> known(size_t(register_count_), false);
  std::fill_n(known.begin(), constants_.size(), true);
  const auto is_known = [&](int32_t slot, int width) {
    return std::all_of(known.begin() + slot, known.begin() + slot + width, [](bool k) { return k; });
  };
  Equals equals(register_count_);
  std::vector<bool> folded(code_.size() + 1, false);
  bool any = false;
  size_t skipped_until = 0;
  const auto fold = [&](size_t at, const Instruction& i) {
    i.for_outputs([&](int32_t slot, int width) { std::fill_n(known.begin() + slot, width, true); });
    folded[at] = any = true;
  };
  for_each_instruction(code_, [&](size_t at, const Instruction& i) {
    if (at < skipped_until) {
      folded[at] = true;
      return;
    }
    const int outputs = int(std::strlen(i.op.outputs)), inputs = int(std::strlen(i.op.inputs));
    std::vector<uint8_t> constant(size_t(outputs + inputs), 0);
    for (int n = 0; n < inputs; ++n) {
      int32_t& slot = code_[at + 1 + size_t(outputs + n)];
      slot = equals.of(slot, width_of(i.op.inputs[n]));
      constant[size_t(outputs + n)] = is_known(slot, width_of(i.op.inputs[n]));
    }
    if (code_[at] == kJump) {
      if (!constant[0]) return;
      if (values[size_t(code_[at + 1])] == 0.0f) skipped_until = size_t(code_[at + 2]);
      folded[at] = any = true;
      return;
    }
    bool once = true;
    i.for_outputs([&](int32_t slot, int width) { once = once && written_once(slot, width); });
    if (!once) return;
    const Operands operands{i.operands, values.data()};
    if (i.op.kind == OpKind::kPure && std::all_of(constant.begin() + outputs, constant.end(), [](uint8_t c) { return c; })) {
      ShadingPoint nowhere;
      static const ShaderResources nothing{};
      ShadeState state{nowhere, nothing, tables_.data(), nullptr};
      i.op.run(operands, state);
      return fold(at, i);
    }
    const int same = i.op.equals ? i.op.equals(KnownInputs{operands, constant.data()}) : kNothingKnown;
    const int width = outputs ? width_of(i.op.outputs[0]) : 0;
    if (same == kZero) {
      std::fill_n(values.begin() + i.operands[0], width, 0.0f);
      fold(at, i);
    } else if (same >= 0 && (constant[size_t(same)] || written_once(i.operands[same], width))) {
      equals.set(i.operands[0], i.operands[same], width);
    }
  });
  if (any) keep([&](size_t at, const Instruction&) { return !folded[at]; }, values, known);
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

}  // namespace gi
