// Rough diffuse reflection: Oren-Nayar in the form of [Fujii 2012] with the energy-preserving multiple-scattering term of
// OpenPBR; optionally mirrored through the surface (a thin sheet seen against the light). The weight carries the colour.
#pragma once
#include "shading/lobes/lobe.h"

namespace gi {

struct OrenNayar {
  OrenNayar(Rgb color, float roughness, bool transmits = false) : transmits_(transmits) {
    const float sigma = clamp01(roughness);
    a_ = 1.0f / (kPi + sigma * (kPi / 2 - 2.0f / 3.0f));
    b_ = sigma * a_;
    const float missing = 1.0f - average_albedo();
    for (int i = 0; i < 3; ++i) {
      const float rho = clamp01(color[i]);
      multiple_[i] = kInvPi * sqr(rho) * (1.0f - missing) / (missing * (1.0f - rho * missing));
    }
  }

  uint8_t flags() const { return kDiffuse | (transmits_ ? kTransmission : kReflection); }

  LobeEval eval(Vec3 wo, Vec3 wi) const {
    if (transmits_) wi.z = -wi.z;
    if (wi.z <= 0.0f) return {};
    const float cos_o = std::max(wo.z, 0.0f);  // bumped normals can turn away from the viewer
    float s = dot(wi, wo) - wi.z * cos_o;
    if (s > 0.0f) s /= std::max(wi.z, cos_o);
    const Rgb f = Rgb(a_ + b_ * s) + multiple_ * ((1.0f - single_albedo(cos_o)) * (1.0f - single_albedo(wi.z)));
    return {f * wi.z, wi.z * kInvPi};
  }
  std::optional<LobeSample> sample(Vec3 wo, Vec2 u, float) const {
    Vec3 wi = sample_cosine_hemisphere(u);
    if (transmits_) wi.z = -wi.z;
    const LobeEval e = eval(wo, wi);
    if (e.pdf_dir <= 0.0f) return {};
    return LobeSample{wi, e.value, e.pdf_dir, flags(), 1.0f};
  }
  Rgb albedo(Vec3 wo) const {
    const float e = single_albedo(wo.z);
    return Rgb(e) + multiple_ * (kPi * (1.0f - e) * (1.0f - average_albedo()));
  }

 private:
  // Directional albedo of the single-scattering part at cosine `c`, and its cosine-weighted mean (fitted in OpenPBR).
  float single_albedo(float c) const {
    c = clamp01(c);
    const float s = safe_sqrt(1.0f - c * c);
    // The limit of sin θ (1 − sin³ θ) / cos θ is (3/2) cos θ.
    const float tail = c > 1e-3f ? s * (1.0f - s * s * s) / c : 1.5f * c;
    const float g = s * (std::acos(c) - 2.0f / 3.0f - s * c) + (2.0f / 3.0f) * tail;
    return a_ * kPi + b_ * g;
  }
  float average_albedo() const { return a_ * kPi + b_ * (2.0f * kPi - 5.6f) / 3.0f; }

  float a_, b_;
  Rgb multiple_;
  bool transmits_;
};

}  // namespace gi
