// Warps of the unit square and their densities. `pdf_dir` is per steradian, `pdf_area` per square metre.
#pragma once
#include "core/vec.h"

namespace gi {

struct SinCos {
  float sin, cos;
};
// Of |x| ≤ π/4 to a bit or two: several times as fast as libm's, and the same on every machine. [Moshier 1989, Cephes sinf, cosf]
inline SinCos sincos_octant(float x) {
  const float x2 = x * x;
  return {x + x * x2 * (-1.6666654611e-1f + x2 * (8.3321608736e-3f + x2 * -1.9515295891e-4f)),
          1.0f - 0.5f * x2 + x2 * x2 * (4.166664568298827e-2f + x2 * (-1.388731625493765e-3f + x2 * 2.443315711809948e-5f))};
}
// Of an angle of `turns` full turns, 0 ≤ turns ≤ 1.
inline SinCos sincos_turns(float turns) {
  const int quarter = int(4.0f * turns + 0.5f);
  const SinCos r = sincos_octant((2.0f * kPi) * (turns - 0.25f * float(quarter)));
  const SinCos swapped = quarter & 1 ? SinCos{r.cos, r.sin} : r;
  return {quarter & 2 ? -swapped.sin : swapped.sin, (quarter + 1) & 2 ? -swapped.cos : swapped.cos};
}

// [Shirley & Chiu 1997] concentric map to the unit disk; density 1/π.
inline Vec2 sample_disk(Vec2 u) {
  const float a = 2.0f * u.x - 1.0f, b = 2.0f * u.y - 1.0f;
  if (a == 0.0f && b == 0.0f) return {0, 0};
  const bool wide = std::abs(a) > std::abs(b);
  const SinCos t = sincos_octant((kPi / 4) * (wide ? b / a : a / b));
  return wide ? Vec2{a * t.cos, a * t.sin} : Vec2{b * t.sin, b * t.cos};
}
// Cosine-weighted hemisphere about +z; pdf_dir = cos θ / π.
inline Vec3 sample_cosine_hemisphere(Vec2 u) {
  const Vec2 d = sample_disk(u);
  return {d.x, d.y, safe_sqrt(1.0f - d.x * d.x - d.y * d.y)};
}
inline Vec3 from_spherical(float cos_theta, float phi) {
  const float s = safe_sqrt(1.0f - cos_theta * cos_theta);
  return {s * std::cos(phi), s * std::sin(phi), cos_theta};
}
inline Vec3 sample_uniform_hemisphere(Vec2 u) { return from_spherical(u.x, 2.0f * kPi * u.y); }         // pdf 1/2π
inline Vec3 sample_uniform_sphere(Vec2 u) { return from_spherical(1.0f - 2.0f * u.x, 2.0f * kPi * u.y); }  // pdf 1/4π
// Uniform over the cone about +z with 1 − cos(half angle) = `one_minus_cos`; pdf = 1/(2π one_minus_cos).
inline Vec3 sample_cone(Vec2 u, float one_minus_cos) {
  const float k = u.x * one_minus_cos, phi = 2.0f * kPi * u.y;  // 1 − cos θ, kept for tiny cones
  const float s = safe_sqrt(k * (2.0f - k));
  return {s * std::cos(phi), s * std::sin(phi), 1.0f - k};
}
// Barycentrics (b1, b2) uniform over a triangle. [Heitz 2019, "A low-distortion map between triangle and square"]
inline Vec2 sample_triangle(Vec2 u) {
  if (u.x < u.y) {
    const float b1 = u.x * 0.5f;
    return {b1, u.y - b1};
  }
  const float b2 = u.y * 0.5f;
  return {u.x - b2, b2};
}
inline float pdf_area_to_dir(float pdf_area, float distance, float cos_light) {
  return cos_light > 0.0f ? pdf_area * sqr(distance) / cos_light : 0.0f;
}

// Power heuristic with exponent 2. [Veach 1997, eq. 9.13]
inline float power_heuristic(float pdf_a, float pdf_b) {
  if (!std::isfinite(pdf_a)) return 1.0f;
  const float a = pdf_a * pdf_a, b = pdf_b * pdf_b;
  return a > 0.0f ? a / (a + b) : 0.0f;
}

}  // namespace gi
