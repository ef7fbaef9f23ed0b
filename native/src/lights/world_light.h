// The world as a light: by an importance map of its radiance over the sphere whose brightest texels are maps themselves (a
// sun's disc is smaller than a texel), or, where it is the same all around, by the cosine of the surface that asks.
#pragma once
#include "core/distribution.h"
#include "core/parallel.h"
#include "lights/light_common.h"

namespace gi {

class WorldLight {
 public:
  WorldLight() = default;
  // Reads the world's program. `threads` ≥ 1.
  WorldLight(const Scene& scene, int threads);

  bool emits() const { return mean_ > 0.0f; }
  float radiance() const { return mean_; }          // |luminance|, mean over the sphere
  float irradiance() const { return kPi * mean_; }  // on a surface that sees all of its hemisphere, about
  // Of all its light, what exceeds `radiance`, by the importance map: about.
  float share_above(float radiance) const;
  std::pair<Vec3, float> sample(const LightQuery& query, Vec2 u) const {
    if (map_.empty()) {
      const Vec3 wi = sample_around(query, u);
      return {wi, pdf_around(query, wi)};
    }
    Vec2 p = map_.sample(u);
    const Texel t = texel_of(p);
    const Distribution2D* fine = refinement(t);
    if (fine) p = t.place(fine->sample(t.within(p, map_)), map_);
    const float theta = kPi * p.y, phi = 2.0f * kPi * p.x - kPi;
    const float s = std::sin(theta);
    const Vec3 wi{s * std::cos(phi), s * std::sin(phi), -std::cos(theta)};
    return {wi, pdf_at(p, t, fine, s)};
  }
  float pdf_dir(const LightQuery& query, Vec3 wi) const {
    if (map_.empty()) return pdf_around(query, wi);
    const float s = std::sqrt(wi.x * wi.x + wi.y * wi.y);
    if (s == 0.0f) return 0.0f;
    const Vec2 p{(std::atan2(wi.y, wi.x) + kPi) / (2.0f * kPi), std::atan2(s, -wi.z) / kPi};
    const Texel t = texel_of(p);
    return pdf_at(p, t, refinement(t), s);
  }
  int map_width() const { return map_.width(); }

 private:
  void refine(const Scene& scene, std::vector<float>& density, int width, ThreadPool& pool);

  struct Texel {
    int x, y;
    Vec2 within(Vec2 p, const Distribution2D& map) const {
      return {clamp01(p.x * float(map.width()) - float(x)), clamp01(p.y * float(map.height()) - float(y))};
    }
    Vec2 place(Vec2 inside, const Distribution2D& map) const {
      return {(float(x) + inside.x) / float(map.width()), (float(y) + inside.y) / float(map.height())};
    }
  };
  float pdf_at(Vec2 p, Texel t, const Distribution2D* fine, float sin_theta) const {
    return map_.pdf(p) * (fine ? fine->pdf(t.within(p, map_)) : 1.0f) / (2.0f * kPi * kPi * sin_theta);
  }
  Texel texel_of(Vec2 p) const {
    return {std::clamp(int(p.x * float(map_.width())), 0, map_.width() - 1),
            std::clamp(int(p.y * float(map_.height())), 0, map_.height() - 1)};
  }
  const Distribution2D* refinement(Texel t) const {
    if (!row_is_fine_[size_t(t.y)]) return nullptr;
    const int32_t i = fine_of_[size_t(t.y) * size_t(map_.width()) + size_t(t.x)];
    return i < 0 ? nullptr : &fine_[size_t(i)];
  }

  std::vector<int32_t> fine_of_;  // of every texel: its own map, or -1
  std::vector<uint8_t> row_is_fine_;  // whether any texel of the row has one
  std::vector<Distribution2D> fine_;
  Distribution2D map_;  // x: longitude from −π; y: angle from −Z, times sine
  float mean_ = 0;      // |luminance| over the sphere
};

}  // namespace gi
