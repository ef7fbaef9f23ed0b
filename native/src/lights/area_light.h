// Area lamp: a rectangle or ellipse that shines along its −Z, through slats where its spread is below 180°.
// Rectangles are sampled by solid angle, ellipses by area; narrow spreads only where they can reach the point.
#pragma once
#include "lights/light_common.h"
#include "lights/spherical_rectangle.h"

namespace gi {

struct AreaLight {
  Vec3 center, u, v;         // u, v: unit, along the sides
  float size_u = 0, size_v = 0;
  Vec3 normal;               // the way it shines
  bool ellipse = false, orthogonal = true;
  float scale = 0;           // radiance along the normal without slats, for colour 1
  bool slats = false;
  float tan_spread = kInf, slats_norm = 0;

  explicit AreaLight(const LampData& lamp) : center(lamp.matrix.translation()), ellipse(lamp.ellipse) {
    const Vec3 side_u = lamp.matrix.column(0) * lamp.size_x, side_v = lamp.matrix.column(1) * lamp.size_y;
    size_u = length(side_u), size_v = length(side_v);
    u = normalize(side_u), v = normalize(side_v);
    normal = normalize(cross(u, v));
    if (dot(normal, lamp.matrix.column(2)) > 0.0f) normal = -normal;
    orthogonal = std::abs(dot(u, v)) < 1e-4f;
    if (area() > 0.0f) scale = kInvPi / (lamp.normalize ? area() : 1.0f);
    set_spread(std::max(lamp.spread, 0.0f));
  }

  float area() const { return (ellipse ? 0.25f * kPi : 1.0f) * size_u * size_v * length(cross(u, v)); }
  bool has_shape() const { return area() > 0.0f && tan_spread > 0.0f; }
  float intensity() const {
    constexpr float kMost = 1e4f;  // of a beam without spread
    return scale * area() * (!slats ? 1.0f : tan_spread > 0.0f ? std::min(tan_spread * slats_norm, kMost) : kMost);
  }

  // Radiance towards −wi per unit of colour.
  float radiance(Vec3, Vec3 wi) const {
    const float c = -dot(wi, normal);
    if (!(c > 0.0f)) return 0.0f;
    if (!slats) return scale;
    return scale * std::max((tan_spread - safe_sqrt(1.0f - c * c) / c) * slats_norm, 0.0f);
  }

  std::optional<ShapeSample> sample(const LightQuery& query, Vec2 rnd) const {
    const float height = dot(query.position - center, normal);
    if (!(height > 0.0f) || scale == 0.0f) return std::nullopt;
    if (tan_spread == 0.0f) return sample_beam(query, height);
    const Part part = reachable(query.position, height);
    if (part.shape == Part::kNothing) return std::nullopt;
    const Vec3 p = part.shape == Part::kRectangle ? rectangle(part, query.position).sample(rnd) : point_on(part, rnd);
    const Vec3 to = p - query.position;
    const float distance = length(to);
    if (!(distance > 0.0f) || !contains(p)) return std::nullopt;
    const Vec3 wi = to / distance;
    const float l = radiance(query.position, wi);
    if (l == 0.0f) return std::nullopt;
    return ShapeSample{wi, distance, l, pdf(part, query.position, wi, distance), false};
  }

  std::optional<float> intersect(const Ray& ray) const {
    const float c = dot(ray.direction, normal);
    if (!(c < 0.0f) || !has_shape()) return std::nullopt;
    const float t = dot(center - ray.origin, normal) / c;
    if (!(t > 0.0f) || !contains(ray.origin + ray.direction * t)) return std::nullopt;
    return t;
  }

  float pdf_dir(const LightQuery& query, Vec3 wi) const {
    const float height = dot(query.position - center, normal), c = -dot(wi, normal);
    if (!(height > 0.0f) || !(c > 0.0f)) return 0.0f;
    const Part part = reachable(query.position, height);
    return part.shape == Part::kNothing ? 0.0f : pdf(part, query.position, wi, height / c);
  }

  Vec2 coordinates(Vec3 p) const {  // −½ … ½ over the sides
    const Vec3 d = p - center;
    if (orthogonal) return {dot(d, u) / size_u, dot(d, v) / size_v};
    const Vec3 n = cross(u, v);
    const float inv = 1.0f / length_squared(n);
    return {dot(cross(d, v), n) * inv / size_u, dot(cross(u, d), n) * inv / size_v};
  }

 private:
  // The part of the lamp that is sampled for a point: the whole, what a narrow spread lets through, or its bounds.
  struct Part {
    enum Shape { kNothing, kRectangle, kEllipse, kParallelogram } shape;
    Vec2 middle;  // metres along u, v from the centre
    Vec2 size;
  };

  void set_spread(float spread) {
    slats = spread < kPi - 1e-5f;
    if (!slats) return;
    const float h = 0.5f * spread;
    tan_spread = std::tan(h);
    // ∫ (tan h − tan θ) cos θ sin θ dθ over the cone is (tan h − h)/2; by its series where that cancels.
    slats_norm = h > 0.05f ? 1.0f / (tan_spread - h) : h > 0.0f ? 3.0f / (h * h * h) : 0.0f;
  }

  bool contains(Vec3 p) const {
    const Vec2 c = coordinates(p);
    constexpr float kHalf = 0.5f + 1e-6f;
    return ellipse ? c.x * c.x + c.y * c.y <= kHalf * kHalf : std::abs(c.x) <= kHalf && std::abs(c.y) <= kHalf;
  }

  Part reachable(Vec3 position, float height) const {
    const Part whole{!orthogonal ? ellipse ? Part::kEllipse : Part::kParallelogram
                     : ellipse   ? Part::kEllipse
                                 : Part::kRectangle,
                     {0, 0},
                     {size_u, size_v}};
    const float reach = slats ? height * tan_spread : kInf;  // radius of the circle above the point that can send light
    if (!orthogonal || !(reach < std::max(size_u, size_v) * 4.0f + 1e3f * height)) return whole;
    const Vec3 d = position - center;
    const float du = dot(d, u), dv = dot(d, v);
    const float u0 = std::max(du - reach, -0.5f * size_u), u1 = std::min(du + reach, 0.5f * size_u);
    const float v0 = std::max(dv - reach, -0.5f * size_v), v1 = std::min(dv + reach, 0.5f * size_v);
    if (!(u0 < u1) || !(v0 < v1)) return {Part::kNothing, {}, {}};
    const Part bounds{Part::kRectangle, {0.5f * (u0 + u1), 0.5f * (v0 + v1)}, {u1 - u0, v1 - v0}};
    if (!ellipse) return bounds;
    const Part circle{Part::kEllipse, {du, dv}, {2.0f * reach, 2.0f * reach}};
    const float areas[3] = {0.25f * kPi * size_u * size_v, bounds.size.x * bounds.size.y, kPi * reach * reach};
    return areas[1] < std::min(areas[0], areas[2]) ? bounds : areas[2] < areas[0] ? circle : whole;
  }

  Vec3 point_on(const Part& part, Vec2 rnd) const {
    const Vec2 p = part.shape == Part::kEllipse ? sample_disk(rnd) * 0.5f : rnd - Vec2{0.5f, 0.5f};
    return center + u * (part.middle.x + p.x * part.size.x) + v * (part.middle.y + p.y * part.size.y);
  }
  SphericalRectangle rectangle(const Part& part, Vec3 position) const {
    return {position, center + u * part.middle.x + v * part.middle.y, u, v, part.size};
  }
  float pdf(const Part& part, Vec3 position, Vec3 wi, float distance) const {
    const float c = -dot(wi, normal);
    if (part.shape == Part::kRectangle) return rectangle(part, position).pdf_dir(distance, c);
    const float part_area = (part.shape == Part::kEllipse ? 0.25f * kPi : 1.0f) * part.size.x * part.size.y * length(cross(u, v));
    return pdf_area_to_dir(1.0f / part_area, distance, c);
  }

  // Spread of 0: the lamp's outline, straight ahead.
  std::optional<ShapeSample> sample_beam(const LightQuery& query, float height) const {
    if (!contains(query.position - normal * height)) return std::nullopt;
    return ShapeSample{-normal, height, scale * kPi, 1.0f, true};
  }
};

}  // namespace gi
