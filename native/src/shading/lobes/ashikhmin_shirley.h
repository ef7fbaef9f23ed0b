// The anisotropic Phong model of Ashikhmin & Shirley, specular part without Fresnel, as Blender's Glossy BSDF offers it.
// [Ashikhmin & Shirley 2000, "An anisotropic Phong BRDF model"]
#pragma once
#include "shading/lobes/lobe.h"

namespace gi {

struct AshikhminShirley {
  float alpha_x = 1, alpha_y = 1;
  float exponent_x = 0, exponent_y = 0;

  static AshikhminShirley make(float alpha_x, float alpha_y) {
    const float ax = std::clamp(alpha_x, 1e-4f, 1.0f), ay = std::clamp(alpha_y, 1e-4f, 1.0f);
    return {ax, ay, 2.0f / (ax * ax) - 2.0f, 2.0f / (ay * ay) - 2.0f};
  }
  void blur(float alpha) { *this = make(std::max(alpha_x, alpha), std::max(alpha_y, alpha)); }
  bool smooth() const { return std::max(alpha_x, alpha_y) <= 1e-4f; }
  uint8_t flags() const { return kReflection | (smooth() ? kSpecular : kGlossy); }

  LobeEval eval(Vec3 wo, Vec3 wi) const {
    if (smooth() || wo.z <= 0.0f || wi.z <= 0.0f) return {};
    const Vec3 h = normalize(wo + wi);
    const float cos_h = std::max(dot(h, wo), 1e-6f);
    const float pdf = normal_density(h) / (4.0f * cos_h);  // their eq. 8
    return {Rgb(pdf * wi.z / std::max(std::max(wo.z, wi.z), 1e-6f)), pdf};
  }
  std::optional<LobeSample> sample(Vec3 wo, Vec2 u, float) const {
    if (wo.z <= 0.0f) return {};
    if (smooth()) return LobeSample{{-wo.x, -wo.y, wo.z}, Rgb(1.0f), 1.0f, flags(), 0.0f};
    const Vec3 wi = reflect(wo, sample_normal(u));
    if (wi.z <= 0.0f) return {};
    const LobeEval e = eval(wo, wi);
    return LobeSample{wi, e.value, e.pdf_dir, flags(), std::sqrt(alpha_x * alpha_y)};
  }
  Rgb albedo(Vec3) const { return Rgb(1.0f); }

 private:
  float normal_density(Vec3 h) const {
    const float sin2 = h.x * h.x + h.y * h.y;
    const float e = sin2 > 0.0f ? (exponent_x * h.x * h.x + exponent_y * h.y * h.y) / sin2 : 0.0f;
    return std::sqrt((exponent_x + 1.0f) * (exponent_y + 1.0f)) * (0.5f * kInvPi) * std::pow(std::min(h.z, 1.0f), e);
  }
  // Each quadrant by their eq. 9, the square folded so that neighbours stay neighbours.
  Vec3 sample_normal(Vec2 u) const {
    const float x = 4.0f * u.x, quadrant = std::min(std::floor(x), 3.0f);
    const bool mirrored = int(quadrant) & 1;
    const float f = mirrored ? 1.0f - (x - quadrant) : x - quadrant;
    const float angle = std::atan(std::sqrt((exponent_x + 1.0f) / (exponent_y + 1.0f)) * std::tan(0.5f * kPi * std::min(f, 0.999999f)));
    const float phi = (quadrant + (mirrored ? 1.0f : 0.0f)) * 0.5f * kPi + (mirrored ? -angle : angle);
    const float c = std::cos(phi), s = std::sin(phi);
    const float z = std::pow(1.0f - u.y, 1.0f / (exponent_x * c * c + exponent_y * s * s + 1.0f));
    const float r = safe_sqrt(1.0f - z * z);
    return {r * c, r * s, z};
  }
};

}  // namespace gi
