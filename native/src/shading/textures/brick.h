// Blender's Brick texture at scaled coordinates.
#pragma once
#include "core/vec.h"

namespace gi::texture {

struct BrickSettings {
  float mortar_size = 0.02f, mortar_smooth = 0, bias = 0, width = 0.5f, row_height = 0.25f;
  float offset = 0.5f, squash = 1;
  int offset_frequency = 2, squash_frequency = 2;  // rows whose number they divide are shifted, squashed
};
struct Brick {
  float tint = 0, mortar = 0;  // both in [0, 1]
};

inline float brick_noise(uint32_t n) {  // the integer noise that sets the bricks' tints
  n = (n + 1013u) & 0x7fffffffu;
  n ^= n >> 13;
  return 0.5f * float((n * (n * n * 60493u + 19990303u) + 1376312589u) & 0x7fffffffu) / 1073741824.0f;
}

inline Brick brick(Vec3 p, const BrickSettings& s) {
  // Find the brick.
  const int row = int(std::floor(p.y / s.row_height));
  float width = s.width, offset = 0;
  if (s.offset_frequency > 0 && s.squash_frequency > 0) {
    if (row % s.squash_frequency == 0) width *= s.squash;
    if (row % s.offset_frequency == 0) offset = width * s.offset;
  }
  const int column = int(std::floor((p.x + offset) / width));
  const float x = p.x + offset - width * float(column), y = p.y - s.row_height * float(row);

  Brick b;
  b.tint = clamp01(brick_noise((uint32_t(row) << 16) + (uint32_t(column) & 0xffffu)) + s.bias);

  // Mortar, by the distance to the nearest side.
  const float distance = std::min({x, y, width - x, s.row_height - y});
  if (distance >= s.mortar_size) return b;
  b.mortar = 1;
  if (s.mortar_smooth != 0.0f) {
    const float t = clamp01((1.0f - distance / s.mortar_size) / s.mortar_smooth);
    b.mortar = t * t * (3.0f - 2.0f * t);
  }
  return b;
}

}  // namespace gi::texture
