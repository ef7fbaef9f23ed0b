// Lambertian transmission: light leaves the far side with f = 1/π. The weight carries the colour.
#pragma once
#include "shading/lobes/lobe.h"

namespace gi {

struct Translucent {
  uint8_t flags() const { return kTransmission | kDiffuse; }
  LobeEval eval(Vec3, Vec3 wi) const {
    const float p = std::max(-wi.z, 0.0f) * kInvPi;
    return {Rgb(p), p};
  }
  std::optional<LobeSample> sample(Vec3, Vec2 u, float) const {
    Vec3 wi = sample_cosine_hemisphere(u);
    wi.z = -wi.z;
    const float p = -wi.z * kInvPi;
    if (p <= 0.0f) return {};
    return LobeSample{wi, Rgb(p), p, flags(), 1.0f};
  }
  Rgb albedo(Vec3) const { return Rgb(1.0f); }
};

}  // namespace gi
