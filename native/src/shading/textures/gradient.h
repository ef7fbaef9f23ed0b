// Blender's Gradient texture, in [0, 1].
#pragma once
#include "core/vec.h"

namespace gi::texture {

enum class Gradient { kLinear, kQuadratic, kEasing, kDiagonal, kRadial, kSphericalQuadratic, kSpherical };

inline float gradient(Vec3 p, Gradient type) {
  // A little less than 1, so that unit vectors give exactly 0.
  const float ball = std::max(0.999999f - length(p), 0.0f), x = clamp01(p.x);
  switch (type) {
    case Gradient::kLinear: return x;
    case Gradient::kQuadratic: return clamp01(sqr(std::max(p.x, 0.0f)));
    case Gradient::kEasing: return x * x * (3.0f - 2.0f * x);
    case Gradient::kDiagonal: return clamp01((p.x + p.y) * 0.5f);
    case Gradient::kRadial: return clamp01(std::atan2(p.y, p.x) / (2.0f * kPi) + 0.5f);
    case Gradient::kSphericalQuadratic: return ball * ball;
    case Gradient::kSpherical: return ball;
  }
  return 0;
}

}  // namespace gi::texture
