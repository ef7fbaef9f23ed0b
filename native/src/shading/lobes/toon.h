// Cartoon shading: a constant cone about the normal (diffuse) or the mirror direction (glossy), faded linearly in the angle
// over `smooth`. Not reciprocal, as in Cycles. The weight carries the colour.
#pragma once
#include "shading/lobes/lobe.h"

namespace gi {

struct Toon {
  Toon(float size, float smooth, bool glossy)
      : size_(std::clamp(size, 1e-5f, 1.0f) * (kPi / 2)), smooth_(clamp01(smooth) * (kPi / 2)), glossy_(glossy) {
    one_minus_cos_ = 2.0f * sqr(std::sin(0.5f * edge()));
  }

  uint8_t flags() const { return kReflection | (glossy_ ? kGlossy : kDiffuse); }

  LobeEval eval(Vec3 wo, Vec3 wi) const {
    if (wi.z <= 0.0f || (glossy_ && wo.z <= 0.0f)) return {};
    const Vec3 axis = this->axis(wo);
    // The angle from the chord: exact for tiny cones, where acos of a dot product is not.
    const float angle = 2.0f * std::asin(std::min(1.0f, 0.5f * length(wi - axis)));
    if (angle >= edge()) return {};
    const float p = 0.5f * kInvPi / one_minus_cos_;
    return {Rgb(p * intensity(angle)), p};
  }
  std::optional<LobeSample> sample(Vec3 wo, Vec2 u, float) const {
    const Vec3 w = sample_cone(u, one_minus_cos_), axis = this->axis(wo);
    const Vec3 wi = normalize(Frame::from_normal(axis).to_world(w));
    if (wi.z <= 0.0f || (glossy_ && wo.z <= 0.0f)) return {};
    const float p = 0.5f * kInvPi / one_minus_cos_;
    const float angle = 2.0f * std::asin(std::min(1.0f, safe_sqrt(0.5f * u.x * one_minus_cos_)));
    return LobeSample{wi, Rgb(p * intensity(angle)), p, flags(), glossy_ ? size_ / (kPi / 2) : 1.0f};
  }
  Rgb albedo(Vec3) const { return Rgb(1.0f); }

 private:
  Vec3 axis(Vec3 wo) const { return glossy_ ? Vec3{-wo.x, -wo.y, wo.z} : Vec3{0, 0, 1}; }
  float edge() const { return std::min(size_ + smooth_, kPi / 2); }
  float intensity(float angle) const {
    if (angle < size_) return 1.0f;
    return angle < size_ + smooth_ ? 1.0f - (angle - size_) / smooth_ : 0.0f;
  }

  float size_, smooth_, one_minus_cos_;
  bool glossy_;
};

}  // namespace gi
