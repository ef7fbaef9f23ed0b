// Light as it leaves a lamp: a place, a direction, and the power that goes that way, for each shape. The adjoint of its `sample`.
// Leaves out choosing a lamp, colours and node programs (lights.cpp).
#pragma once
#include "lights/lamp.h"

namespace gi {

// One ray away from a lamp of colour 1. `power` is all that the lamp emits, were it all emitted like this: radiance · cos / density.
struct ShapeEmission {
  Vec3 origin, direction;
  float power = 0;
};

// The ball that holds everything: light from infinity comes through its cross-section.
struct SceneBall {
  Vec3 center;
  float radius = 1;
  explicit SceneBall(const Bounds& b) {
    if (!b.empty()) center = b.center(), radius = std::max(0.5f * length(b.extent()), 1e-6f) * 1.0001f;
  }
  float cross_section() const { return kPi * radius * radius; }
  // Where a ray starts that comes from `towards`.
  Vec3 entry(Vec3 towards, Vec2 u) const {
    const Frame frame = Frame::from_normal(towards);
    const Vec2 d = sample_disk(u);
    return center + (towards + frame.x * d.x + frame.y * d.y) * radius;
  }
};

// Seen along any direction a ball of even radiance is a disk across it; so is Blender's soft falloff from afar.
inline ShapeEmission emit_along(const PointLight& light, Vec3 direction, float solid_angle, Vec2 u_place) {
  if (light.radius == 0.0f) return {light.center, direction, light.scale * solid_angle};
  const Frame frame = Frame::from_normal(direction);
  const Vec2 d = sample_disk(u_place);
  const float ahead = light.sphere ? safe_sqrt(1.0f - d.x * d.x - d.y * d.y) : 0.0f;
  const Vec3 out = frame.x * d.x + frame.y * d.y + direction * ahead;
  return {light.center + out * light.radius, direction, light.scale * solid_angle * kPi * sqr(light.radius)};
}
inline ShapeEmission emit(const PointLight& light, const SceneBall&, Vec2 u_place, Vec2 u_direction) {
  return emit_along(light, sample_uniform_sphere(u_direction), 4.0f * kPi, u_place);
}
inline ShapeEmission emit(const SpotLight& light, const SceneBall&, Vec2 u_place, Vec2 u_direction) {
  const Vec3 direction = Frame::from_normal(light.axis).to_world(sample_cone(u_direction, light.one_minus_cos_world));
  ShapeEmission e = emit_along(light.point, direction, 2.0f * kPi * light.one_minus_cos_world, u_place);
  e.power *= light.attenuation(-direction);
  return e;
}
inline constexpr float kNarrow = 1.0f;  // tangent of half the spread below which directions follow the slats
inline float sin2_spread(const AreaLight& light) {
  return std::isfinite(light.tan_spread) ? sqr(light.tan_spread) / (1.0f + sqr(light.tan_spread)) : 1.0f;
}
// Density of the direction at an angle with this cosine, over the cosine.
inline float pdf_slats(const AreaLight& light, float cos) {
  if (!(cos > 0.0f)) return 0.0f;
  const float sin2 = std::max(1.0f - cos * cos, 0.0f), t = light.tan_spread;
  if (!(t < kNarrow)) return sin2 <= sin2_spread(light) * (1.0f + 1e-5f) ? kInvPi / sin2_spread(light) : 0.0f;
  return 3.0f * kInvPi * std::max(1.0f - std::sqrt(sin2) / (cos * t), 0.0f) / (sqr(t) * sqr(sqr(cos)));
}
inline ShapeEmission emit(const AreaLight& light, const SceneBall&, Vec2 u_place, Vec2 u_direction) {
  const Vec2 disk = sample_disk(u_place);
  const Vec2 at = light.ellipse ? disk * 0.5f : Vec2{u_place.x - 0.5f, u_place.y - 0.5f};
  const Vec3 origin = light.center + light.u * (light.size_u * at.x) + light.v * (light.size_v * at.y);
  if (light.tan_spread == 0.0f) return {origin, light.normal, light.scale * kPi * light.area()};
  Vec3 local;
  if (light.tan_spread < kNarrow) {
    // As the slats let it through but for a cos⁴: 6x(1 − x) of x = tan θ / tan(spread/2), by inverting the smoothstep that is its integral.
    const float x = 0.5f - std::sin(std::asin(1.0f - 2.0f * u_direction.x) / 3.0f), phi = 2.0f * kPi * u_direction.y;
    local = normalize({x * light.tan_spread * std::cos(phi), x * light.tan_spread * std::sin(phi), 1.0f});
  } else {
    const Vec2 d = sample_disk(u_direction) * std::sqrt(sin2_spread(light));
    local = {d.x, d.y, safe_sqrt(1.0f - d.x * d.x - d.y * d.y)};
  }
  const Vec3 direction = Frame::from_normal(light.normal).to_world(local);
  const float pdf = pdf_slats(light, local.z) / light.area();
  return {origin, direction, pdf > 0.0f ? light.radiance(origin, -direction) / pdf : 0.0f};
}
inline ShapeEmission emit(const SunLight& light, const SceneBall& ball, Vec2 u_place, Vec2 u_direction) {
  const auto s = light.sample({}, u_direction);
  if (!s) return {};
  return {ball.entry(s->wi, u_place), -s->wi, s->scale / s->pdf_dir * ball.cross_section()};
}

// Power of a lamp of colour 1, watts: exact but for suns wider than the sky.
inline float emitted_power(const PointLight& light, const SceneBall&) { return 4.0f * kPi * light.intensity(); }
inline float emitted_power(const SpotLight& light, const SceneBall&) {
  return 2.0f * kPi * light.one_minus_cos_world * light.point.intensity();  // its blend left out
}
inline float emitted_power(const AreaLight& light, const SceneBall&) { return light.scale * kPi * light.area(); }
inline float emitted_power(const SunLight& light, const SceneBall& ball) { return light.irradiance() * ball.cross_section(); }

// What the lamp's `sample` would have said where a ray that it emitted has arrived.
template <class S>
std::optional<ShapeSample> arriving(const S& light, const LightQuery& query, const Ray& emitted, bool with_pdf) {
  const Vec3 wi = -emitted.direction;
  if constexpr (std::is_same_v<S, SunLight>) {
    if (!light.has_shape()) return ShapeSample{wi, kInf, light.scale, 1.0f, true};
    return ShapeSample{wi, kInf, light.scale, light.pdf_dir(), false};
  } else {
    bool is_delta;
    if constexpr (std::is_same_v<S, AreaLight>)
      is_delta = light.tan_spread == 0.0f;
    else if constexpr (std::is_same_v<S, SpotLight>)
      is_delta = light.point.radius == 0.0f;
    else
      is_delta = light.radius == 0.0f;
    if (is_delta) {
      auto s = light.sample(query, {0.5f, 0.5f});
      if (s) s->wi = wi;
      return s;
    }
    const auto t = light.intersect({query.position, wi});
    if (!t) return std::nullopt;
    return ShapeSample{wi, *t, light.radiance(query.position, wi), with_pdf ? light.pdf_dir(query, wi) : 0.0f, false};
  }
}

// Density of `emit` for the ray that arrives at `position` from `wi`, per steradian and square metre across it; see LightSet::pdf_emit.
inline float pdf_along(const PointLight& light, Vec3 position, float pdf_dir) {
  const float d2 = length_squared(light.center - position), r2 = sqr(light.radius);
  if (r2 == 0.0f) return pdf_dir / d2;
  return light.sphere && d2 <= r2 ? 0.0f : pdf_dir * kInvPi / r2;  // nothing is emitted into a sphere
}
inline float pdf_ray(const PointLight& light, const SceneBall&, Vec3 position, Vec3) { return pdf_along(light, position, 0.25f * kInvPi); }
inline float pdf_ray(const SpotLight& light, const SceneBall&, Vec3 position, Vec3 wi) {
  if (0.5f * length_squared(light.axis + wi) > light.one_minus_cos_world * (1.0f + 1e-5f)) return 0.0f;
  return pdf_along(light.point, position, 0.5f * kInvPi / light.one_minus_cos_world);
}
inline float pdf_ray(const AreaLight& light, const SceneBall&, Vec3, Vec3 wi) {
  return (light.tan_spread == 0.0f ? 1.0f : pdf_slats(light, -dot(light.normal, wi))) / light.area();
}
inline float pdf_ray(const SunLight& light, const SceneBall& ball, Vec3, Vec3) {
  return (light.has_shape() ? light.pdf_dir() : 1.0f) / ball.cross_section();
}

}  // namespace gi
