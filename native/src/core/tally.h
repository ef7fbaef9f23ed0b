// Counting from many threads: each has a counter of its own, since a shared one would cost more than it tells.
#pragma once
#include <array>
#include <atomic>
#include <cstdint>

namespace gi {

class Tally {
 public:
  void add() { slots_[slot()].value.fetch_add(1, std::memory_order_relaxed); }
  uint64_t total() const {
    uint64_t sum = 0;
    for (const Slot& s : slots_) sum += s.value.load(std::memory_order_relaxed);
    return sum;
  }

 private:
  struct alignas(64) Slot {
    std::atomic<uint64_t> value{0};
  };
  static constexpr size_t kSlots = 64;
  static size_t slot() {
    static std::atomic<size_t> threads_seen{0};
    static thread_local const size_t mine = threads_seen++ % kSlots;
    return mine;
  }
  std::array<Slot, kSlots> slots_;
};

}  // namespace gi
