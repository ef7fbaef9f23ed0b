// How image coordinates follow from points and directions: Blender's projections of Image and Environment textures.
#pragma once
#include "core/vec.h"

namespace gi::texture {

// Sphere and tube look at the unit box of Generated coordinates from its centre.
inline Vec2 project_to_sphere(Vec3 generated) {
  const Vec3 p = (generated - Vec3{0.5f, 0.5f, 0.5f}) * 2.0f;
  const float l = length(p);
  if (l == 0.0f) return {0, 0};
  const float u = p.x == 0.0f && p.y == 0.0f ? 0.0f : 0.5f - std::atan2(p.x, p.y) / (2.0f * kPi);
  return {u, 1.0f - std::acos(std::clamp(p.z / l, -1.0f, 1.0f)) * kInvPi};
}
inline Vec2 project_to_tube(Vec3 generated) {
  const Vec3 p = (generated - Vec3{0.5f, 0.5f, 0.5f}) * 2.0f;
  if (p.x == 0.0f && p.y == 0.0f) return {0, 0};
  return {(1.0f - std::atan2(p.x, p.y) * kInvPi) * 0.5f, (p.z + 1.0f) * 0.5f};
}

// Directions need not be unit.
inline Vec2 direction_to_equirectangular(Vec3 d) {
  d = normalize(d);
  if (d == Vec3{}) return {0, 0};
  return {0.5f - std::atan2(d.y, d.x) / (2.0f * kPi), 1.0f - std::acos(std::clamp(d.z, -1.0f, 1.0f)) * kInvPi};
}
inline Vec2 direction_to_mirror_ball(Vec3 d) {
  d = normalize(d);
  d.y -= 1.0f;
  const float div = 2.0f * std::sqrt(std::max(-0.5f * d.y, 0.0f));
  if (div > 0.0f) d = d / div;
  return {0.5f * (d.x + 1.0f), 0.5f * (d.z + 1.0f)};
}

// Share of each axis' image in a box projection, from the normal in object space. With blend 0 one side takes all;
// with more, two sides mix along edges and three around corners.
inline Vec3 box_weights(Vec3 normal, float blend) {
  Vec3 n = {std::abs(normal.x), std::abs(normal.y), std::abs(normal.z)};
  const float sum = n.x + n.y + n.z;
  if (sum == 0.0f) return {1, 0, 0};
  n = n / sum;
  const float limit = 0.5f * (1.0f + blend);
  for (int i = 0; i < 3; ++i) {
    const float a = n[(i + 1) % 3], b = n[(i + 2) % 3];
    if (n[i] > limit * (n[i] + a) && n[i] > limit * (n[i] + b)) {
      Vec3 w;
      w[i] = 1;
      return w;
    }
  }
  if (blend <= 0.0f) return {1, 0, 0};
  constexpr int kEdges[3][3] = {{2, 0, 1}, {0, 1, 2}, {1, 0, 2}};  // the axis that is out, and the two that mix
  for (const auto& [out, i, j] : kEdges) {
    if (n[out] < (1.0f - limit) * (n[i] + n[j])) {
      Vec3 w;
      w[i] = clamp01((n[i] / (n[i] + n[j]) - 0.5f * (1.0f - blend)) / blend);
      w[j] = 1.0f - w[i];
      return w;
    }
  }
  const auto share = [limit](float x) { return ((2.0f - limit) * x + (limit - 1.0f)) / (2.0f * limit - 1.0f); };
  return {share(n.x), share(n.y), share(n.z)};
}

}  // namespace gi::texture
