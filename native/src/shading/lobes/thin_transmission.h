// What a thin rough sheet of glass lets through: a GGX reflection mirrored through the surface; straight on where smooth.
// The weight carries the sheet's transmittance.
#pragma once
#include "shading/lobes/microfacet.h"

namespace gi {

struct ThinTransmission {
  ThinTransmission(float alpha, float cos_o) : lobe_(GgxLobe::reflection(alpha, alpha, Fresnel::none())) {
    lobe_.preserve_energy(cos_o, Rgb(1.0f));
  }

  void blur(float alpha) { lobe_.blur(alpha); }
  uint8_t flags() const { return turned(lobe_.flags()); }
  LobeEval eval(Vec3 wo, Vec3 wi) const { return lobe_.eval(wo, {wi.x, wi.y, -wi.z}); }
  std::optional<LobeSample> sample(Vec3 wo, Vec2 u, float u_lobe) const {
    std::optional<LobeSample> s = lobe_.sample(wo, u, u_lobe);
    if (!s) return {};
    s->wi.z = -s->wi.z;
    s->flags = turned(s->flags);
    return s;
  }
  Rgb albedo(Vec3) const { return Rgb(1.0f); }

 private:
  static uint8_t turned(uint8_t flags) { return uint8_t((flags & ~kReflection) | kTransmission); }
  GgxLobe lobe_;
};

}  // namespace gi
