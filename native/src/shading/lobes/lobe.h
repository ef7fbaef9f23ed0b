// What every lobe answers. Directions are unit, in the lobe's frame (z is its normal), away from the surface;
// wi.z < 0 is transmission. wo.z is positive but where a bumped normal turns from the viewer: glossy lobes are black there.
//
//   struct SomeLobe {
//     uint8_t flags() const;                                            // LobeFlags
//     LobeEval eval(Vec3 wo, Vec3 wi) const;                            // value = f |cos θi|, pdf_dir; zero for delta lobes
//     std::optional<LobeSample> sample(Vec3 wo, Vec2 u, float u_lobe) const;
//     Rgb albedo(Vec3 wo) const;                                        // directional albedo (or a close, positive estimate)
//     static constexpr bool kAllAround = true;                          // fibres': what they sample may be on any side of the surface
//   };
#pragma once
#include <optional>

#include "core/vec.h"
#include "core/warp.h"

namespace gi {

enum LobeFlags : uint8_t {
  kReflection = 1,
  kTransmission = 2,
  kDiffuse = 4,
  kGlossy = 8,
  kSpecular = 16,     // delta in direction
  kTransparent = 32,  // straight through, does not count as a bounce
  kSubsurface = 64,   // into the surface, to come out elsewhere: only where an integrator carries it
  kPortal = 128,      // with kTransparent: through a ray portal
};

struct LobeEval {
  Rgb value;
  float pdf_dir = 0;
};

struct LobeSample {
  Vec3 wi;
  Rgb value;           // f |cos θi|; for delta lobes the factor itself
  float pdf_dir = 0;   // for delta lobes the probability of this choice within the lobe
  uint8_t flags = 0;   // one of kReflection/kTransmission and one of kDiffuse/kGlossy/kSpecular
  float roughness = 0;
};

}  // namespace gi
