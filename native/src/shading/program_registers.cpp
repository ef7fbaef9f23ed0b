// Packing the registers of a program: values that are never needed at the same time share a place. Constants stay in front.
// A value lives from the instruction that writes it to the last that reads it; since jumps only go forwards, that is all.
#include <algorithm>
#include <optional>

#include "core/check.h"
#include "shading/instructions.h"

namespace gi {
namespace {

struct Life {
  int32_t slot;
  int width;
  size_t written, last_read;
  int32_t place = 0;
};

// The values of a program in the order they are written, and which of them each register belongs to; nothing if registers
// are used in a way that the compiler's programs never do (overlapping values, values that no instruction writes).
struct Lives {
  std::vector<Life> values;
  std::vector<int32_t> owner;
};

std::optional<Lives> find_lives(const std::vector<int32_t>& code, size_t constants, int register_count) {
  Lives lives;
  lives.owner.assign(size_t(register_count), -1);
  bool regular = true;
  for_each_instruction(code, [&](size_t at, const Instruction& i) {
    i.for_inputs([&](int32_t slot, int width) {
      const int32_t value = lives.owner[size_t(slot)];
      for (int k = 1; k < width; ++k) regular = regular && lives.owner[size_t(slot + k)] == value;
      if (size_t(slot) < constants)
        regular = regular && size_t(slot + width) <= constants;
      else if (value < 0)
        regular = false;
      else
        lives.values[size_t(value)].last_read = at;
    });
    i.for_outputs([&](int32_t slot, int width) {
      for (int k = 0; k < width; ++k) {
        regular = regular && lives.owner[size_t(slot + k)] < 0;
        lives.owner[size_t(slot + k)] = int32_t(lives.values.size());
      }
      lives.values.push_back({slot, width, at, at});
    });
  });
  return regular ? std::optional(std::move(lives)) : std::nullopt;
}

// The first gap of `width` in what is taken from `first` on.
int32_t first_gap(const std::vector<bool>& taken, size_t first, int width) {
  int free = 0;
  for (size_t r = first; r < taken.size(); ++r) {
    free = taken[r] ? 0 : free + 1;
    if (free == width) return int32_t(r) - width + 1;
  }
  return int32_t(taken.size()) - free;
}

}  // namespace

void Program::pack_registers() {
  if (std::optional<Lives> lives = find_lives(code_, constants_.size(), register_count_)) {
    std::vector<bool> taken(constants_.size(), true);
    std::vector<const Life*> alive;
    for (Life& value : lives->values) {
      std::erase_if(alive, [&](const Life* other) {
        const bool over = other->last_read < value.written;
        if (over) std::fill_n(taken.begin() + other->place, other->width, false);
        return over;
      });
      value.place = first_gap(taken, constants_.size(), value.width);
      if (size_t(value.place + value.width) > taken.size()) taken.resize(size_t(value.place + value.width));
      std::fill_n(taken.begin() + value.place, value.width, true);
      alive.push_back(&value);
    }
    const auto moved = [&](int32_t slot) {
      if (size_t(slot) < constants_.size()) return slot;
      const Life& value = lives->values[size_t(lives->owner[size_t(slot)])];
      return value.place + slot - value.slot;
    };
    for (size_t at = 0; at < code_.size();) {
      const Op& op = ops()[size_t(code_[at])];
      const size_t registers = std::strlen(op.outputs) + std::strlen(op.inputs);
      for (size_t k = 1; k <= registers; ++k) code_[at + k] = moved(code_[at + k]);
      at += size_t(op.width());
    }
    register_count_ = int(taken.size());
  }
  require(register_count_ <= kMaxRegisters, "the node program of '" + name_ + "': needs " + std::to_string(register_count_) +
                                                " registers; the most is " + std::to_string(kMaxRegisters));
}

}  // namespace gi
