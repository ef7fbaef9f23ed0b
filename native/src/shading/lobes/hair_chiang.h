// Blender's Principled Hair BSDF, model Chiang: a circular fibre of coloured glass, by what leaves it after 0 and 1 passages, after one
// inner reflection, and the rest. [Chiang et al. 2016, "A practical and controllable hair and fur model for production path tracing"]
// The lobe's frame: x along the fibre, z across it and wo.
#pragma once
#include <array>

#include "shading/lobes/fresnel.h"
#include "shading/lobes/hair_fibre.h"

namespace gi {

struct HairChiang {
  Rgb sigma;          // absorption per radius of the fibre
  float v, v_first;   // variance along the fibre; of the first reflection
  float s;            // scale around it
  float tilt;         // of the cuticle, radians
  float eta;
  float h;            // where wo meets the fibre: the sine of the angle to its middle, −1 to 1

  // `coat`: how much smoother the first reflection is.
  static HairChiang make(Rgb sigma, float roughness, float radial_roughness, float coat, float offset, float eta, float h) {
    const float along = std::clamp(roughness, 0.001f, 1.0f), around = std::clamp(radial_roughness, 0.001f, 1.0f);
    const float first = std::clamp((1.0f - clamp01(coat)) * along, 0.001f, 1.0f);
    return {sigma, variance(along), variance(first), scale(around), -offset, eta, std::clamp(h, -1.0f, 1.0f)};
  }
  static constexpr bool kAllAround = true;
  void blur(float alpha) { v = std::max(v, alpha), s = std::max(s, alpha), v_first = std::max(v_first, alpha); }
  uint8_t flags() const { return kReflection | kTransmission | kGlossy; }

  LobeEval eval(Vec3 wo, Vec3 wi) const { return eval_at(Fibre(*this, wo), wi); }

  std::optional<LobeSample> sample(Vec3 wo, Vec2 u, float u_lobe) const {
    const Fibre f(*this, wo);
    int p = 0;
    while (p < 3 && u_lobe >= f.share[size_t(p)]) u_lobe -= f.share[size_t(p)], ++p;
    const float left = std::clamp(safe_divide(u_lobe, f.share[size_t(p)]), 1e-5f, 1.0f);
    const auto [sin_o, cos_o] = f.tilted(p, tilt);
    const float sin_i = sample_along_fibre(sin_o, cos_o, variance_of(p), {left, u.y}), cos_i = cos_of_sin(sin_i);
    const float around = p < 3 ? deflection(p, f.gamma_o, f.gamma_t) + CutLogistic(s).sample(u.x) : 2.0f * kPi * u.x;
    const float phi = f.phi + around;
    const Vec3 wi{sin_i, -cos_i * std::sin(phi), cos_i * std::cos(phi)};
    const LobeEval e = eval_at(f, wi);
    if (!(e.pdf_dir > 0.0f)) return {};
    return LobeSample{wi, e.value, e.pdf_dir, uint8_t(kGlossy | (p == 0 ? kReflection : kTransmission)), v_first};
  }

  // [Chiang et al. 2016, eq. 9, inverted], with what is reflected first.
  Rgb albedo(Vec3 wo) const {
    const float f = fresnel_dielectric(cos_of_sin(wo.x) * cos_of_sin(h), eta), depth = absorption_depth(v);
    const auto passed = [&](float absorption) { return std::exp(-std::sqrt(absorption) * depth); };
    return Rgb(passed(sigma.r()), passed(sigma.g()), passed(sigma.b())) + Rgb(f);
  }

  // How √σ and the colour of many fibres' scattering are related, by the roughness around the fibre. [Chiang et al. 2016, eq. 9]
  static float absorption_depth(float x) { return 5.969f + x * (-0.215f + x * (2.532f + x * (-10.73f + x * (5.574f + x * 0.245f)))); }

 private:
  // Fits of looks that go evenly with roughness. [Chiang et al. 2016, eq. 7 and 8]
  static float variance(float x) { return sqr(0.726f * x + 0.812f * x * x + 3.7f * std::pow(x, 20.0f)); }
  static float scale(float x) { return (0.265f * x + 1.194f * x * x + 5.372f * std::pow(x, 22.0f)) * 0.626657069f; }  // √(π/8)
  float variance_of(int p) const { return p == 0 ? v_first : p == 1 ? 0.25f * v : 4.0f * v; }

  // What depends on wo alone.
  struct Fibre {
    float sin_o, cos_o, phi, gamma_o, gamma_t;
    std::array<Rgb, 4> attenuation;
    std::array<float, 4> share;

    Fibre(const HairChiang& m, Vec3 wo) {
      sin_o = std::clamp(wo.x, -1.0f, 1.0f), cos_o = cos_of_sin(sin_o), phi = std::atan2(-wo.y, wo.z);
      const float cos_t = cos_of_sin(sin_o / m.eta);
      const float sin_gamma_t = m.h * cos_o / std::sqrt(std::max(sqr(m.eta) - sqr(sin_o), 1e-12f));
      gamma_o = asin_safe(m.h), gamma_t = asin_safe(sin_gamma_t);
      const float r = fresnel_dielectric(cos_o * cos_of_sin(m.h), m.eta);
      const Rgb t = exp(m.sigma * (-2.0f * cos_of_sin(sin_gamma_t) / std::max(cos_t, 1e-6f)));
      attenuation[0] = Rgb(r), attenuation[1] = t * sqr(1.0f - r), attenuation[2] = attenuation[1] * t * r;
      for (int i = 0; i < 3; ++i) attenuation[3][i] = attenuation[2][i] * safe_divide(t[i] * r, 1.0f - t[i] * r);
      float sum = 0;
      for (size_t p = 0; p < 4; ++p) sum += share[p] = average(attenuation[p]);
      for (float& x : share) x = safe_divide(x, sum);
    }
    // sin and cos of the angle of wo as the scales of the cuticle turn it for the p-th lobe. [Chiang et al. 2016, §4.1.2]
    std::pair<float, float> tilted(int p, float tilt) const {
      if (p == 3) return {sin_o, cos_o};
      const float by = p == 0 ? -2.0f * tilt : p == 1 ? tilt : 4.0f * tilt, s = std::sin(by), c = std::cos(by);
      return {sin_o * c + cos_o * s, std::abs(cos_o * c - sin_o * s)};
    }
  };

  LobeEval eval_at(const Fibre& f, Vec3 wi) const {
    const float sin_i = std::clamp(wi.x, -1.0f, 1.0f), cos_i = cos_of_sin(sin_i), around = std::atan2(-wi.y, wi.z) - f.phi;
    const CutLogistic azimuth(s);
    LobeEval sum;
    for (int p = 0; p < 4; ++p) {
      const auto [sin_o, cos_o] = f.tilted(p, tilt);
      const float n = p < 3 ? azimuth.density(wrapped_angle(around - deflection(p, f.gamma_o, f.gamma_t))) : 0.5f * kInvPi;
      const float density = along_fibre(sin_i, cos_i, sin_o, cos_o, variance_of(p)) * n;
      sum.value += f.attenuation[size_t(p)] * density, sum.pdf_dir += f.share[size_t(p)] * density;
    }
    return sum;
  }
};

}  // namespace gi
