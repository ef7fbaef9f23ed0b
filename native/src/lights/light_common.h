// What the kinds of light share: their answers, and directions for a point that is inside its light.
#pragma once
#include <optional>

#include "core/warp.h"
#include "lights/lights.h"

namespace gi {

// One direction towards a light whose `color` is 1. For delta lights `scale` is the irradiance across the direction.
struct ShapeSample {
  Vec3 wi;
  float distance = kInf;
  float scale = 0;
  float pdf_dir = 0;  // 1 for delta lights
  bool is_delta = false;
};

// Uniform over the cone about +z, by the concentric map: (½, ½) is its axis.
inline Vec3 sample_cone_concentric(Vec2 u, float one_minus_cos) {
  const Vec2 d = sample_disk(u);
  const float k = (d.x * d.x + d.y * d.y) * one_minus_cos, s = safe_sqrt(one_minus_cos * (2.0f - k));
  return {d.x * s, d.y * s, 1.0f - k};
}
// 1 − cos of an angle, from its squared sine; keeps its digits for small angles.
inline float one_minus_cos_from_sin2(float sin2) { return sin2 / (1.0f + safe_sqrt(1.0f - sin2)); }

// Light from all around (a uniform world, the inside of a sphere): cosine-weighted about the normal, on both sides where
// the surface transmits. A tenth is uniform, since bumped lobes reach beyond the hemisphere of the normal.
inline constexpr float kAroundUniform = 0.1f;

inline float pdf_around(const LightQuery& query, Vec3 wi) {
  const float uniform = 0.25f * kInvPi;
  if (length_squared(query.normal) == 0.0f) return uniform;
  const float c = dot(query.normal, wi);
  const float cosine = query.transmission ? 0.5f * std::abs(c) * kInvPi : std::max(c, 0.0f) * kInvPi;
  return lerp(cosine, uniform, kAroundUniform);
}
inline Vec3 sample_around(const LightQuery& query, Vec2 u) {
  if (length_squared(query.normal) == 0.0f) return sample_uniform_sphere(u);
  if (u.x < kAroundUniform) return sample_uniform_sphere({u.x / kAroundUniform, u.y});
  u.x = std::min((u.x - kAroundUniform) / (1.0f - kAroundUniform), kOneMinusEpsilon);
  float side = 1.0f;
  if (query.transmission) {
    side = u.y < 0.5f ? 1.0f : -1.0f;
    u.y = u.y < 0.5f ? 2.0f * u.y : std::min(2.0f * u.y - 1.0f, kOneMinusEpsilon);
  }
  return Frame::from_normal(query.normal * side).to_world(sample_cosine_hemisphere(u));
}

}  // namespace gi
