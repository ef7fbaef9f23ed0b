// Sun lamp: parallel light, or a uniform disk of the sky `angle` wide.
#pragma once
#include "lights/light_common.h"

namespace gi {

struct SunLight {
  Vec3 direction;           // towards the sun
  float half_angle = 0;
  float one_minus_cos = 0;  // of half the angle
  float scale = 1;          // radiance of a lamp of colour 1; irradiance across the direction where there is no angle

  explicit SunLight(const LampData& lamp)
      : direction(normalize(lamp.matrix.column(2))), half_angle(std::clamp(0.5f * lamp.angle, 0.0f, kPi)) {
    one_minus_cos = 2.0f * sqr(std::sin(0.5f * half_angle));
    const float sin2 = sqr(std::sin(half_angle));
    if (lamp.normalize && half_angle > 0.0f) scale = 1.0f / (kPi * std::max(sin2, 1e-12f));
  }

  bool has_shape() const { return half_angle > 0.0f; }
  float irradiance() const { return has_shape() ? scale * kPi * sqr(std::sin(std::min(half_angle, 0.5f * kPi))) : scale; }

  std::optional<ShapeSample> sample(const LightQuery&, Vec2 u) const {
    if (direction == Vec3{0, 0, 0}) return std::nullopt;
    if (!has_shape()) return ShapeSample{direction, kInf, scale, 1.0f, true};
    const Vec3 wi = normalize(Frame::from_normal(direction).to_world(sample_cone_concentric(u, one_minus_cos)));
    return ShapeSample{wi, kInf, scale, pdf_dir(), false};
  }
  bool shows(Vec3 wi) const {
    // 1 − cos θ = |a − b|²/2 keeps its digits for the half degree of the real sun.
    return has_shape() && 0.5f * length_squared(wi - direction) <= one_minus_cos;
  }
  float pdf_dir() const { return 1.0f / (2.0f * kPi * one_minus_cos); }
};

}  // namespace gi
