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
inline ShapeEmission emit(const AreaLight& light, const SceneBall&, Vec2 u_place, Vec2 u_direction) {
  const Vec2 disk = sample_disk(u_place);
  const Vec2 at = light.ellipse ? disk * 0.5f : Vec2{u_place.x - 0.5f, u_place.y - 0.5f};
  const Vec3 origin = light.center + light.u * (light.size_u * at.x) + light.v * (light.size_v * at.y);
  if (light.tan_spread == 0.0f) return {origin, light.normal, light.scale * kPi * light.area()};
  // Cosine-weighted within what the slats let through.
  const float sin2 = std::isfinite(light.tan_spread) ? sqr(light.tan_spread) / (1.0f + sqr(light.tan_spread)) : 1.0f;
  const Vec2 d = sample_disk(u_direction) * std::sqrt(sin2);
  const Vec3 direction = Frame::from_normal(light.normal).to_world({d.x, d.y, safe_sqrt(1.0f - d.x * d.x - d.y * d.y)});
  return {origin, direction, light.radiance(origin, -direction) * kPi * sin2 * light.area()};
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

}  // namespace gi
