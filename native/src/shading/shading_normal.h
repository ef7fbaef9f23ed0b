// What bumped and interpolated normals need so that surfaces neither leak light nor turn black.
// Normals are unit and face the viewer. Leaves out how a normal is bumped (ops_normal).
#pragma once
#include "core/vec.h"

namespace gi {

// The normal nearest to `n`, on the way to `ng`, whose mirror direction of `wo` leaves the surface by a little. For glossy lobes.
inline Vec3 valid_reflection_normal(Vec3 ng, Vec3 wo, Vec3 n) {
  const float wo_z = dot(wo, ng), lowest = std::min(0.9f * wo_z, 0.01f);
  if (n == ng || dot(reflect(wo, n), ng) >= lowest) return n;
  // In the plane of n and ng, with n' = (√(1−z²), z), the condition 2 (n'·wo) z − wo_z = lowest is a quadratic in z².
  const Vec3 x = normalize_or(n - ng * dot(n, ng), n);
  const float wo_x = dot(wo, x), a = wo_x * wo_x + wo_z * wo_z, b = 2.0f * (a + wo_z * lowest), c = sqr(lowest + wo_z);
  const float root = safe_sqrt(b * b - 4.0f * a * c);
  const float z2 = 0.25f * (wo_x < 0.0f ? b + root : b - root) / a;
  return safe_sqrt(1.0f - z2) * x + safe_sqrt(z2) * ng;
}

// Shadowing of diffuse light by bumps: a GGX surface as rough as n is bent. [Conty Estévez et al. 2019, "A microfacet-based
// shadowing function to solve the bump terminator problem"]
inline float bump_shadowing(float cos_ns_wi, float cos_ns_n) {
  const float ci = std::abs(cos_ns_wi), cn = std::abs(cos_ns_n);
  if (cn >= 1.0f || ci >= 1.0f) return 1.0f;
  if (ci < 1e-6f) return 0.0f;
  const float alpha2 = clamp01(0.125f * (1.0f / (cn * cn) - 1.0f));
  return 2.0f / (1.0f + std::sqrt(1.0f + alpha2 * (1.0f / (ci * ci) - 1.0f)));
}

// Darkens towards the terminator, which then comes at an angle of 90°/frequency: hides the facets of coarse meshes with smooth normals.
inline float terminator_shift(float cos_i, float frequency) {
  if (frequency <= 1.0f || cos_i <= 0.0f) return 1.0f;
  const float c = std::min(cos_i, 1.0f);
  return std::max(std::cos(std::acos(c) * frequency), 0.0f) / c;
}

}  // namespace gi
