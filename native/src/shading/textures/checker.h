// Blender's Checker texture at scaled coordinates: 1 or 0.
#pragma once
#include "core/vec.h"

namespace gi::texture {

inline float checker(Vec3 p) {
  int odd[3];
  for (int i = 0; i < 3; ++i) {
    // Keeps faces that lie at whole coordinates off the border of two cells.
    const float x = (p[i] + 0.000001f) * 0.999999f;
    odd[i] = std::abs(int(std::floor(x))) % 2;
  }
  return (odd[0] == odd[1]) == bool(odd[2]) ? 1.0f : 0.0f;
}

}  // namespace gi::texture
