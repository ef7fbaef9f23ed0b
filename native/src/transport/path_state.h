// What a path knows of its past, moved on at each bounce, and the limits that Blender's Light Paths panel sets.
#pragma once
#include "shading/bsdf.h"
#include "shading/shading_point.h"

namespace gi {

struct BounceLimits {
  int total = 12, diffuse = 4, glossy = 4, transmission = 12, transparent = 8, volume = 0;
};

// The RayKind bits by which objects and lamps decide whether the ray sees them: reflection kinds do not hold for
// transmitted rays.
inline uint32_t visibility_of(uint32_t kind) {
  if (kind & kRayTransmission) kind &= ~uint32_t(kRayDiffuse | kRayGlossy);
  return kind & (kRayCamera | kRayShadow | kRayDiffuse | kRayGlossy | kRayTransmission | kRayVolume);
}

// Moves `path` past a scattering event of the lobe `flags`. False when a limit is exceeded: the next surface then only
// emits, so that n bounces of indirect light are what light sampling at n surfaces sees.
inline bool advance(PathState& path, uint8_t flags, const BounceLimits& limits) {
  if (flags & kPortal) ++path.portal_depth;
  if (flags & kTransparent) return ++path.transparent_depth <= limits.transparent;
  ++path.depth;
  bool within = path.depth <= limits.total;
  if (flags & kTransmission) {
    path.kind = kRayTransmission;
    within = ++path.transmission_depth <= limits.transmission && within;
  } else {
    path.kind = kRayReflection;
    within = (flags & kDiffuse ? ++path.diffuse_depth <= limits.diffuse : ++path.glossy_depth <= limits.glossy) && within;
  }
  if (flags & kDiffuse) path.after_diffuse = true, path.least_pdf = std::min(path.least_pdf, kInvPi);  // or less: where it is not told
  path.kind |= flags & kDiffuse ? kRayDiffuse : flags & kGlossy ? kRayGlossy : uint32_t(kRayGlossy | kRaySingular);
  return within;
}

// The same for scattering in a medium.
inline bool advance_in_medium(PathState& path, const BounceLimits& limits) {
  path.kind = kRayVolume;
  path.least_pdf = 0.0f;
  const bool within = ++path.volume_depth <= limits.volume;
  return ++path.depth <= limits.total && within;
}

// A point moved off its surface to the side that `direction` leaves by, far enough not to meet it again.
// [Wächter & Binder 2019, Ray Tracing Gems ch. 6, with steps scaled to single-precision transforms]
inline Vec3 offset_point(Vec3 p, Vec3 ng, Vec3 direction) {
  const Vec3 n = dot(ng, direction) >= 0.0f ? ng : -ng;
  const float scale = std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z), 1e-2f});
  return p + n * (scale * 4e-6f);
}

// A ray that leaves a surface, or a strand, which it does not meet again wherever on it it begins.
inline Ray ray_from(const ShadingPoint& point, Vec3 direction, float t_max = kInf) {
  if (point.strand == kNoId) return {offset_point(point.position, point.ng, direction), direction, 0.0f, t_max};
  return {point.position, direction, 0.0f, t_max, point.instance, point.strand, direction == -point.wo};
}

// Blender's Clamp Direct/Indirect: `limit` is the largest mean of the channels; 0 is off.
inline Rgb clamp_contribution(Rgb value, float limit) {
  const Rgb size = abs(value);
  const float sum = size.r() + size.g() + size.b();
  return limit > 0.0f && sum > 3.0f * limit ? value * (3.0f * limit / sum) : value;
}

}  // namespace gi
