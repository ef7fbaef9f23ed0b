// Lambertian reflection: f = 1/π. The weight carries the albedo.
#pragma once
#include "shading/lobes/lobe.h"

namespace gi {

struct Lambert {
  uint8_t flags() const { return kReflection | kDiffuse; }
  LobeEval eval(Vec3, Vec3 wi) const {
    const float p = std::max(wi.z, 0.0f) * kInvPi;
    return {Rgb(p), p};
  }
  std::optional<LobeSample> sample(Vec3, Vec2 u, float) const {
    const Vec3 wi = sample_cosine_hemisphere(u);
    const float p = wi.z * kInvPi;
    if (p <= 0.0f) return {};
    return LobeSample{wi, Rgb(p), p, flags(), 1.0f};
  }
  Rgb albedo(Vec3) const { return Rgb(1.0f); }
};

}  // namespace gi
