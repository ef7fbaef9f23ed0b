// Phase functions: how media scatter. Directions are those that light travels, before and after; densities per steradian.
#pragma once
#include "core/vec.h"

namespace gi {

// [Henyey & Greenstein 1941]
inline float henyey_greenstein(float cosine, float g) {
  if (std::abs(g) < 1e-3f) return 0.25f * kInvPi;
  const float d = 1.0f + g * g - 2.0f * g * cosine;
  return 0.25f * kInvPi * (1.0f - g * g) / (d * std::sqrt(d));
}

inline Vec3 around(Vec3 direction, float cosine, float turns) {
  const float sine = safe_sqrt(1.0f - cosine * cosine), phi = 2.0f * kPi * turns;
  return Frame::from_normal(direction).to_world({sine * std::cos(phi), sine * std::sin(phi), cosine});
}

inline Vec3 sample_henyey_greenstein(Vec3 direction, float g, Vec2 u) {
  float cosine = 1.0f - 2.0f * u.x;
  if (std::abs(g) >= 1e-3f) {
    const float k = (1.0f - g * g) / (1.0f - g + 2.0f * g * u.x);
    cosine = (1.0f + g * g - k * k) / (2.0f * g);
  }
  return around(direction, std::clamp(cosine, -1.0f, 1.0f), u.y);
}

}  // namespace gi
