// Going through the instructions of a program: for what checks, folds and packs it.
#pragma once
#include "shading/program.h"

namespace gi {

inline constexpr int kJump = 0;  // the code of jump_if_zero

inline int width_of(char type) { return type == 'v' ? 3 : 1; }

// Registers and jumps of one instruction, in the order of its operands.
struct Instruction {
  const Op& op;
  const int32_t* operands;  // outputs, inputs, immediates
  template <class F>
  void for_outputs(F f) const {
    for (int i = 0; op.outputs[i]; ++i) f(operands[i], width_of(op.outputs[i]));
  }
  template <class F>
  void for_inputs(F f) const {
    const int n = int(std::strlen(op.outputs));
    for (int i = 0; op.inputs[i]; ++i) f(operands[n + i], width_of(op.inputs[i]));
  }
};

template <class F>
void for_each_instruction(const std::vector<int32_t>& code, F f) {
  for (size_t at = 0; at < code.size();) {
    const Op& op = ops()[size_t(code[at])];
    f(at, Instruction{op, code.data() + at + 1});
    at += size_t(op.width());
  }
}

}  // namespace gi
