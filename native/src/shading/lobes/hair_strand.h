// Blender's Hair BSDF: one bounce off a fibre, or through it, by empirical distributions: Cauchy's along the fibre; around it a cosine for
// reflection, Cauchy's about straight on for transmission. Value and density are the same, as in Blender, whose edges are kept: what
// reflection throws more than 90° aside, yet not behind the surface, is drawn but not evaluated, and transmission is evaluated on the whole
// far side of the surface. Behind the surface reflection is all there: Blender finds lamps of some size there by its samples alone, whole,
// and lamps of no size not at all.
#pragma once
#include "shading/lobes/hair_fibre.h"

namespace gi {

struct HairStrand {
  Vec3 tangent{1, 0, 0};  // of the fibre, unit, in the lobe's frame
  float along = 0.1f, around = 0.1f;  // roughness
  float offset = 0;  // tilt of the cuticle, radians
  bool transmits = false;

  static HairStrand make(Vec3 tangent, float along, float around, float offset, bool transmits) {
    return {tangent, std::clamp(along, 0.001f, 1.0f), std::clamp(around, 0.001f, 1.0f), offset, transmits};
  }
  static constexpr bool kAllAround = true;
  void blur(float alpha) { along = std::max(along, alpha), around = std::max(around, alpha); }
  uint8_t flags() const { return (transmits ? kTransmission : kReflection | kTransmission) | kGlossy; }
  Rgb albedo(Vec3) const { return Rgb(1.0f); }

  LobeEval eval(Vec3 wo, Vec3 wi) const {
    const Angles o(*this, wo);
    const float sin_i = std::clamp(dot(tangent, wi), -1.0f, 1.0f), theta_i = std::asin(sin_i);
    if (is_along(theta_i)) return {};
    const float p = density_along(o, theta_i), phi = std::abs(std::atan2(dot(o.x, wi), dot(o.y, wi)));
    if (!transmits) {
      const float q = phi / around < kPi ? std::cos(0.5f * phi / around) * 0.25f / around : 0.0f;
      return {Rgb(phi < 0.5f * kPi || wi.z < 0.0f ? p * q : 0.0f), p * q};
    }
    const float away = kPi - phi, q = density_through(away);
    return {Rgb(p * q), away < 0.5f * kPi ? p * q : 0.0f};
  }
  std::optional<LobeSample> sample(Vec3 wo, Vec2 u, float) const {
    const Angles o(*this, wo);
    const float theta_i = 2.0f * (along * std::tan(lerp(o.from, o.to, u.x)) + offset) - o.theta;
    if (is_along(theta_i)) return {};
    const float phi = transmits ? kPi + around * std::tan(2.0f * std::atan(0.5f * kPi / around) * (u.y - 0.5f))
                                : 2.0f * asin_safe(1.0f - 2.0f * u.y) * around;
    const float q = transmits ? density_through(phi - kPi) : std::cos(0.5f * phi / around) * 0.25f / around;
    const float pdf = density_along(o, theta_i) * q, c = std::cos(theta_i);
    if (!(pdf > 0.0f)) return {};
    const Vec3 wi = o.y * (std::cos(phi) * c) + o.x * (std::sin(phi) * c) + tangent * std::sin(theta_i);
    return LobeSample{wi, Rgb(pdf), pdf, uint8_t(kGlossy | (transmits ? kTransmission : kReflection)), std::sqrt(along * around)};
  }

 private:
  // Of wo, and the limits between which half vectors are drawn.
  struct Angles {
    Vec3 x, y;  // across the fibre; y towards wo
    float theta, from, to;
    Angles(const HairStrand& s, Vec3 wo) {
      const float sin_o = std::clamp(dot(s.tangent, wo), -1.0f, 1.0f);
      y = normalize_or(wo - s.tangent * sin_o, Frame::from_normal(s.tangent).x), x = cross(s.tangent, y);
      theta = std::asin(sin_o);
      from = std::atan((0.5f * (theta - 0.5f * kPi) - s.offset) / s.along),
      to = std::atan((0.5f * (theta + 0.5f * kPi) - s.offset) / s.along);
    }
  };
  static bool is_along(float theta) { return 0.5f * kPi - std::abs(theta) < 1e-3f; }
  float density_along(const Angles& o, float theta_i) const {
    const float t = 0.5f * (theta_i + o.theta) - offset;
    return along / (2.0f * (t * t + along * along) * (o.to - o.from) * std::cos(theta_i));
  }
  float density_through(float away) const { return around / (2.0f * std::atan(0.5f * kPi / around) * (away * away + around * around)); }
};

}  // namespace gi
