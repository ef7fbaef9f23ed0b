// The world as a light: by an importance map of its radiance over the sphere, or, where it is the same all around, by the
// cosine of the surface that asks.
#pragma once
#include "core/distribution.h"
#include "lights/light_common.h"

namespace gi {

class WorldLight {
 public:
  WorldLight() = default;
  // Reads the world's program. `threads` ≥ 1.
  WorldLight(const Scene& scene, int threads);

  bool emits() const { return mean_ > 0.0f; }
  float irradiance() const { return kPi * mean_; }  // on a surface that sees all of its hemisphere, about
  std::pair<Vec3, float> sample(const LightQuery& query, Vec2 u) const {
    if (map_.empty()) {
      const Vec3 wi = sample_around(query, u);
      return {wi, pdf_around(query, wi)};
    }
    const Vec2 p = map_.sample(u);
    const float theta = kPi * p.y, phi = 2.0f * kPi * p.x - kPi;
    const float s = std::sin(theta);
    const Vec3 wi{s * std::cos(phi), s * std::sin(phi), -std::cos(theta)};
    return {wi, pdf_dir(query, wi)};
  }
  float pdf_dir(const LightQuery& query, Vec3 wi) const {
    if (map_.empty()) return pdf_around(query, wi);
    const float s = std::sqrt(wi.x * wi.x + wi.y * wi.y);
    if (s == 0.0f) return 0.0f;
    const Vec2 p{(std::atan2(wi.y, wi.x) + kPi) / (2.0f * kPi), std::atan2(s, -wi.z) / kPi};
    return map_.pdf(p) / (2.0f * kPi * kPi * s);
  }
  int map_width() const { return map_.width(); }

 private:
  Distribution2D map_;  // x: longitude from −π; y: angle from −Z, times sine
  float mean_ = 0;      // |luminance| over the sphere
};

}  // namespace gi
