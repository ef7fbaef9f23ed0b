// What the closure ops share: adding a lobe under Cycles' rules, normals, tangents, layering. Knows lobes, not node trees.
#pragma once
#include "shading/program.h"
#include "shading/shading_normal.h"

namespace gi {

enum Distribution { kGgx, kBeckmann, kAshikhminShirley, kMultiscatterGgx };  // what immediates mean by them

// Adds a lobe about normal `n`, with `tangent` as the frame's x axis unless it is zero.
template <class L>
void add_lobe(ShadeState& s, Rgb weight, const L& lobe, Vec3 n, Vec3 tangent, const Rgb* albedo = nullptr) {
  s.bsdf->add(weight, lobe, tangent == Vec3{} ? Frame::from_normal(n) : Frame::from_normal_and_tangent(n, tangent), albedo);
}
template <class L>
void add_lobe(ShadeState& s, Rgb weight, const L& lobe, Vec3 n) {
  s.bsdf->add(weight, lobe, Frame::from_normal(n));
}

// Lambert, or Oren-Nayar where it is rough. `color` is the albedo whose multiple scattering is kept.
inline void add_diffuse(ShadeState& s, Rgb weight, Rgb color, float roughness, Vec3 n) {
  const Rgb white(1.0f);
  if (roughness < 1e-5f) return s.bsdf->add(weight, Lambert{}, Frame::from_normal(n), &white);
  add_lobe(s, weight, OrenNayar(color, roughness), n);
}

// A normal socket's value; the shading normal where it is not linked.
inline Vec3 normal_or_shading(const ShadeState& s, Vec3 n) { return normalize_or(n, s.point.ns); }

inline Vec3 visible_normal(const ShadeState& s, Vec3 n) {
  return s.bsdf->bump_correction() && !s.bsdf->on_curve() ? valid_reflection_normal(s.point.ng, s.point.wo, n) : n;
}

// `v` turned by `angle` radians, right-handed, about the unit `axis`. [Rodrigues]
inline Vec3 rotated(Vec3 v, Vec3 axis, float angle) {
  const float c = std::cos(angle), sn = std::sin(angle);
  return v * c + cross(axis, v) * sn + axis * (dot(axis, v) * (1.0f - c));
}

struct Anisotropy {
  float alpha_x, alpha_y;
  Vec3 tangent;
};
// As the Principled and the Metallic BSDF read it: `rotation` in turns; isotropic where there is no tangent.
inline Anisotropy anisotropy(float roughness, float amount, float rotation, Vec3 n, Vec3 tangent) {
  const float alpha = sqr(roughness);
  if (amount <= 0.0f || tangent == Vec3{}) return {alpha, alpha, {}};
  const float aspect = std::sqrt(1.0f - 0.9f * amount);
  return {alpha / aspect, alpha * aspect, rotated(tangent, n, rotation * 2.0f * kPi)};
}

// `s.weight` has the albedo in it. Where light is not followed below the surface it is diffuse; by profiles it is not, as in Cycles, where
// a diffuse surface sees it: nobody could tell, and most rays that look for the surface miss it.
inline void add_subsurface(ShadeState& state, const Subsurface& s, Vec3 n) {
  const bool untold = s.method == SubsurfaceMethod::kProfile && state.point.path.after_diffuse;
  if (untold || !state.bsdf->carries_subsurface()) return add_diffuse(state, s.weight, s.albedo, 0.0f, n);
  state.bsdf->add_subsurface(s);
}

// The weight left for what lies under a layer that reflects `albedo` (its own weight included) out of `weight`: the channel
// that reflects most decides, so that no hue is made by layering.
inline Rgb under_layer(Rgb weight, Rgb albedo) {
  float most = 0.0f;
  const Rgb share = albedo / weight;
  for (int i = 0; i < 3; ++i) most = std::max(most, weight[i] != 0.0f ? share[i] : 0.0f);
  return weight * clamp01(1.0f - most);
}

}  // namespace gi
