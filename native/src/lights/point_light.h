// Point lamp: a point, a sphere, or (Blender's Soft Falloff) a disk that always faces where light is wanted.
#pragma once
#include "lights/light_common.h"

namespace gi {

struct PointLight {
  Vec3 center;
  float radius = 0;
  bool sphere = false;
  float scale = 0;  // radiance of a lamp of colour 1; radiant intensity where there is no radius

  static constexpr float kLeastRadius = 1e-9f;  // smaller ones would overflow single precision

  explicit PointLight(const LampData& lamp)
      : center(lamp.matrix.translation()),
        radius(lamp.radius > kLeastRadius ? lamp.radius : 0.0f),
        sphere(!lamp.soft_falloff && radius > 0.0f) {
    const float area = radius > 0.0f ? 4.0f * kPi * radius * radius : 4.0f;
    scale = kInvPi / (lamp.normalize ? area : 1.0f);
  }

  bool has_shape() const { return radius > 0.0f; }
  // Radiant intensity per unit of colour.
  float intensity() const { return radius > 0.0f ? scale * kPi * radius * radius : scale; }

  std::optional<ShapeSample> sample(const LightQuery& query, Vec2 u) const {
    const Vec3 to = center - query.position;
    const float d2 = length_squared(to), d = std::sqrt(d2);
    if (sphere) return d2 > sqr(radius) ? sample_outside(to / d, d, u) : sample_inside(query, u);
    if (!(d > 0.0f)) return std::nullopt;
    if (radius == 0.0f) return ShapeSample{to / d, d, scale / d2, 1.0f, true};
    const Vec2 p = sample_disk(u);
    const Frame frame = Frame::from_normal(to / d);
    const Vec3 v = to + (frame.x * p.x + frame.y * p.y) * radius;
    const float distance = length(v);
    return ShapeSample{v / distance, distance, scale, pdf_disk(distance, d), false};
  }

  // The parameter at which a ray meets the lamp; from inside a sphere, its far side.
  std::optional<float> intersect(const Ray& ray) const {
    if (radius == 0.0f) return std::nullopt;
    const Vec3 to = center - ray.origin;
    const float d2 = length_squared(to), along = dot(to, ray.direction);
    if (!sphere) {
      if (!(along > 0.0f)) return std::nullopt;
      const float t = d2 / along;  // the disk's plane is across `to`
      if (length_squared(ray.direction * t - to) > sqr(radius)) return std::nullopt;
      return t;
    }
    const float r2 = sqr(radius);
    if (d2 > r2 && along < 0.0f) return std::nullopt;
    const float off2 = length_squared(to - ray.direction * along);
    if (off2 > r2) return std::nullopt;
    return along - std::copysign(std::sqrt(r2 - off2), d2 - r2);
  }

  // Radiance towards −wi at `position` per unit of colour, and the density of `sample`, on a line that meets the lamp.
  float radiance(Vec3, Vec3) const { return scale; }
  float pdf_dir(const LightQuery& query, Vec3 wi) const {
    const Vec3 to = center - query.position;
    const float d2 = length_squared(to);
    if (sphere) return d2 > sqr(radius) ? pdf_cone(d2) : pdf_around(query, wi);
    const float along = dot(to, wi);
    return along > 0.0f ? pdf_disk(d2 / along, std::sqrt(d2)) : 0.0f;
  }

  float one_minus_cos(float d2) const { return one_minus_cos_from_sin2(sqr(radius) / d2); }
  float pdf_cone(float d2) const { return 1.0f / (2.0f * kPi * one_minus_cos(d2)); }

 private:
  // Area density 1/πr² as seen from `d` in front of the disk's centre, `distance` from the point on it.
  float pdf_disk(float distance, float d) const { return distance * distance * distance / (d * kPi * sqr(radius)); }
  ShapeSample sample_outside(Vec3 axis, float d, Vec2 u) const {
    const Vec3 local = sample_cone_concentric(u, one_minus_cos(d * d));
    const float sin2 = local.x * local.x + local.y * local.y;
    const float t = d * local.z - safe_sqrt(sqr(radius) - d * d * sin2);
    return {normalize(Frame::from_normal(axis).to_world(local)), t, scale, pdf_cone(d * d), false};
  }
  std::optional<ShapeSample> sample_inside(const LightQuery& query, Vec2 u) const {
    const Vec3 wi = sample_around(query, u);
    const auto t = intersect({query.position, wi});
    if (!t) return std::nullopt;
    return ShapeSample{wi, *t, scale, pdf_around(query, wi), false};
  }
};

}  // namespace gi
