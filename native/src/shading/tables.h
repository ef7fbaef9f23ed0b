// Lookups in a program's own tables: ramps and curves sampled at equal steps over 0..1. Ops name a table by its offset.
#pragma once
#include <bit>
#include <cmath>
#include <cstdint>

#include "core/vec.h"

namespace gi {

inline float float_of_bits(int32_t bits) { return std::bit_cast<float>(bits); }

// The entry before x (0..1, anything else is brought there) in a table of `size` entries, and how far x is past it.
struct TablePlace {
  int index;
  float past;
};
inline TablePlace table_place(float x, int size) {
  const float at = (x > 0.0f ? std::fmin(x, 1.0f) : 0.0f) * float(size - 1);  // NaN goes to 0
  const int i = std::clamp(int(at), 0, size - 1);
  return {i, at - float(i)};
}

// Linear in between. Beyond the ends: the end, or the line through the last two entries. Entries are `stride` floats apart.
inline float curve_lookup(const float* table, int size, int stride, float x, bool extrapolate) {
  const auto entry = [&](int i) { return table[i * stride]; };
  if (extrapolate && x < 0.0f) return entry(0) + (entry(0) - entry(1)) * -x * float(size - 1);
  if (extrapolate && x > 1.0f) return entry(size - 1) + (entry(size - 1) - entry(size - 2)) * (x - 1.0f) * float(size - 1);
  const TablePlace p = table_place(x, size);
  if (p.past <= 0.0f) return entry(p.index);
  return (1.0f - p.past) * entry(p.index) + p.past * entry(std::min(p.index + 1, size - 1));
}

// Whether the immediates (offset, size, …) name a table of `Stride` floats an entry within a program's tables.
template <int Stride>
bool curve_fits(const int32_t* immediates, size_t tables) {
  const int64_t offset = immediates[0], size = immediates[1];
  return offset >= 0 && size >= 2 && offset + size * Stride <= int64_t(tables);
}

}  // namespace gi
