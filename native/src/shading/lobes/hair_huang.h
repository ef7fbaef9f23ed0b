// Blender's Principled Hair BSDF, model Huang: an elliptical fibre of coloured glass with rough, tilted scales, by reflection (R), two
// passages (TT), one inner reflection (TRT) and a residue. [Huang, Hullin & Hanika 2022, "A microfacet-based hair scattering model"]
// The lobe's frame: x along the fibre; z the ellipse's long axis, or across the fibre and wo.
// Evaluated with random numbers that are made from the directions themselves: right in the mean over directions.
#pragma once
#include "shading/lobes/hair_fibre.h"

namespace gi {

struct HairHuang {
  Rgb sigma;             // absorption per long radius of the fibre
  float r, tt, trt;      // what is made of the three, 1 as it is
  float alpha;           // roughness of the facets
  float tilt;            // of the scales, radians
  float eta;
  float aspect;          // short axis over long axis
  float h_from = -1, h_to = 1;  // where wo may meet the fibre, in long radii from its middle: all of it, or what a pixel sees

  struct Look {
    Rgb sigma;
    float roughness, offset, eta, aspect;
    float r = 1, tt = 1, trt = 1;
  };
  static HairHuang make(const Look& l) {
    return {
        l.sigma, std::max(l.r, 0.0f), std::max(l.tt, 0.0f), std::max(l.trt, 0.0f), std::clamp(l.roughness, 0.001f, 1.0f), -l.offset, l.eta,
        l.aspect};
  }
  // As wide as the fibre looks from wo, over its long axis.
  float projected_radius(Vec3 wo) const;

  static constexpr bool kAllAround = true;
  void blur(float a) { alpha = std::max(alpha, a); }
  uint8_t flags() const { return kReflection | kTransmission | kGlossy; }
  LobeEval eval(Vec3 wo, Vec3 wi) const { return {value(wo, wi), density(wo, wi)}; }
  std::optional<LobeSample> sample(Vec3 wo, Vec2 u, float u_lobe) const;
  Rgb albedo(Vec3 wo) const;

 private:
  Rgb value(Vec3 wo, Vec3 wi) const;
  float density(Vec3 wo, Vec3 wi) const;
};

}  // namespace gi
