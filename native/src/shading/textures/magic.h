// Blender's Magic texture: nested sines and cosines, `depth` (0 to 10) of them.
#pragma once
#include "core/vec.h"

namespace gi::texture {

inline Rgb magic(Vec3 p, float scale, int depth, float distortion) {
  // Reduced first, so that large coordinates neither lose precision nor overflow.
  const float px = std::fmod(p.x * scale, 2.0f * kPi), py = std::fmod(p.y * scale, 2.0f * kPi), pz = std::fmod(p.z * scale, 2.0f * kPi);
  float x = std::sin((px + py + pz) * 5.0f), y = std::cos((-px + py - pz) * 5.0f), z = -std::cos((-px - py + pz) * 5.0f);

  const float d = distortion;
  if (depth > 0) x *= d, y *= d, z *= d, y = -std::cos(x - y + z) * d;
  if (depth > 1) x = std::cos(x - y - z) * d;
  if (depth > 2) z = std::sin(-x - y - z) * d;
  if (depth > 3) x = -std::cos(-x + y - z) * d;
  if (depth > 4) y = -std::sin(-x + y + z) * d;
  if (depth > 5) y = -std::cos(-x + y + z) * d;
  if (depth > 6) x = std::cos(x + y + z) * d;
  if (depth > 7) z = std::sin(x + y - z) * d;
  if (depth > 8) x = -std::cos(-x - y + z) * d;
  if (depth > 9) y = -std::sin(x - y + z) * d;

  const float norm = d != 0.0f ? 1.0f / (2.0f * d) : 1.0f;
  return {0.5f - x * norm, 0.5f - y * norm, 0.5f - z * norm};
}

}  // namespace gi::texture
