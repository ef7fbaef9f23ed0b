// Normals of vertices made from the triangles around them.
#pragma once
#include <functional>
#include <vector>

#include "scene/scene_data.h"

namespace gi {

inline Vec3 vector_at(const float* numbers, size_t i) { return {numbers[3 * i], numbers[3 * i + 1], numbers[3 * i + 2]}; }

inline std::vector<Vec3> vectors_of(const float* numbers, size_t count) {
  std::vector<Vec3> vectors(count);
  for (size_t i = 0; i < count; ++i) vectors[i] = vector_at(numbers, i);
  return vectors;
}

// Sums of the unit normals of the triangles that `counts` (all, where it is null), whatever their size and angle, as Cycles takes them
// for displaced meshes; zero where none is.
inline std::vector<Vec3> vertex_normals(const std::vector<Vec3>& positions, const Array<const uint32_t>& indices,
                                        const std::function<bool(uint32_t)>& counts) {
  std::vector<Vec3> sums(positions.size());
  for (uint32_t t = 0; t < indices.size / 3; ++t) {
    if (counts && !counts(t)) continue;
    const uint32_t* v = indices.data + 3 * size_t(t);
    const Vec3 n = normalize(cross(positions[v[1]] - positions[v[0]], positions[v[2]] - positions[v[0]]));
    for (int k = 0; k < 3; ++k) sums[v[k]] += n;
  }
  return sums;
}

}  // namespace gi
