// Spot lamp: a point lamp that shines into a cone along its −Z, with a smoothstep edge.
// The lamp's own scale squeezes the cone; directions alone decide, also on a spot with a radius.
#pragma once
#include "lights/point_light.h"

namespace gi {

struct SpotLight {
  PointLight point;
  Affine to_lamp;
  Vec3 axis;           // the way it shines
  float cos_half = 0;  // of the cone in the lamp's own space
  float edge = 0;      // 1 / width of the blend, in cosine; 0 is a hard edge
  float one_minus_cos_world = 2;  // of the narrowest circular cone in the world that holds all of it

  explicit SpotLight(const LampData& lamp) : point(lamp), to_lamp(lamp.matrix.inverse()), axis(normalize(-lamp.matrix.column(2))) {
    const float half = std::clamp(0.5f * lamp.spot_size, 0.0f, kPi);
    cos_half = std::cos(half);
    const float width = (1.0f - cos_half) * lamp.spot_blend;
    edge = width > 0.0f ? 1.0f / width : 0.0f;
    const float squeeze = std::max(length_squared(lamp.matrix.column(0)), length_squared(lamp.matrix.column(1)));
    const float depth = length_squared(lamp.matrix.column(2));
    // Sheared or very wide cones: all directions.
    const bool orthogonal =
        std::abs(dot(axis, lamp.matrix.column(0))) + std::abs(dot(axis, lamp.matrix.column(1))) < 1e-4f * std::sqrt(squeeze);
    if (orthogonal && half < 0.49f * kPi && depth > 0.0f) {
      one_minus_cos_world = one_minus_cos_from_sin2(squeeze * sqr(std::tan(half)) / (squeeze * sqr(std::tan(half)) + depth));
    }
  }

  // Share of the light that leaves towards −wi.
  float attenuation(Vec3 wi) const {
    const float x = normalize(to_lamp.vector(wi)).z - cos_half;  // wi points against the shine
    if (x <= 0.0f) return 0.0f;
    const float s = edge > 0.0f ? std::min(x * edge, 1.0f) : 1.0f;
    return s * s * (3.0f - 2.0f * s);
  }

  std::optional<ShapeSample> sample(const LightQuery& query, Vec2 u) const {
    const float d2 = length_squared(point.center - query.position);
    const bool outside = d2 > sqr(point.radius);
    auto s = samples_cone(d2) ? sample_shine(query, u) : point.sample(query, u);
    if (!s) return std::nullopt;
    if (outside || !point.sphere) s->scale *= attenuation(s->wi);
    if (s->scale == 0.0f) return std::nullopt;
    return s;
  }

  std::optional<float> intersect(const Ray& ray) const { return point.intersect(ray); }

  float radiance(Vec3 position, Vec3 wi) const {
    const bool inside = point.sphere && length_squared(point.center - position) <= sqr(point.radius);
    return point.scale * (inside ? 1.0f : attenuation(wi));
  }
  float pdf_dir(const LightQuery& query, Vec3 wi) const {
    return samples_cone(length_squared(point.center - query.position)) ? pdf_shine() : point.pdf_dir(query, wi);
  }

 private:
  // Close to a large sphere the cone of the shine is narrower than the sphere looks.
  bool samples_cone(float d2) const { return point.sphere && d2 > sqr(point.radius) && one_minus_cos_world < point.one_minus_cos(d2); }
  float pdf_shine() const { return 1.0f / (2.0f * kPi * one_minus_cos_world); }
  std::optional<ShapeSample> sample_shine(const LightQuery& query, Vec2 u) const {
    const Vec3 wi = Frame::from_normal(-axis).to_world(sample_cone_concentric(u, one_minus_cos_world));
    const auto t = point.intersect({query.position, wi});
    if (!t) return std::nullopt;
    return ShapeSample{wi, *t, point.scale, pdf_shine(), false};
  }
};

}  // namespace gi
