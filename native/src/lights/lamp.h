// One lamp of the scene, whichever its kind: its shape, its bounds for the light tree, and where it shines from.
// Leaves out choosing and node programs (lights.cpp).
#pragma once
#include <variant>

#include "lights/area_light.h"
#include "lights/light_tree.h"
#include "lights/spot_light.h"
#include "lights/sun_light.h"

namespace gi {

using Shape = std::variant<PointLight, SpotLight, AreaLight, SunLight>;

struct Lamp {
  Shape shape;
  const LampData* data;
  Affine to_lamp;
  bool findable;  // has a shape that rays can meet
  float strength = 0;  // |luminance| of its colour times what its program makes of it, on average
};

inline Shape make_shape(const LampData& lamp) {
  switch (lamp.kind) {
    case LampKind::kSpot: return SpotLight(lamp);
    case LampKind::kArea: return AreaLight(lamp);
    case LampKind::kSun: return SunLight(lamp);
    case LampKind::kPoint: break;
  }
  return PointLight(lamp);
}

inline float magnitude(Rgb c) { return luminance(abs(c)); }

inline void bound(const PointLight& light, LightBounds& b) {
  const Vec3 r = Vec3{1, 1, 1} * light.radius;
  b.lo = light.center - r, b.hi = light.center + r;
  b.cos_normals = -1.0f, b.cos_emission = 0.0f, b.power = light.intensity();
}
inline void bound(const SpotLight& light, LightBounds& b) {
  bound(light.point, b);
  if (light.point.sphere) return;  // inside the sphere it shines everywhere
  // The cone does not fall off before its edge: as a cone of normals it is bounded better than by its axis.
  b.axis = light.axis, b.cos_normals = std::max(1.0f - light.one_minus_cos_world, -1.0f), b.cos_emission = 0.999f;
  b.power = light.point.intensity();
}
inline void bound(const AreaLight& light, LightBounds& b) {
  const Vec3 du = light.u * (0.5f * light.size_u), dv = light.v * (0.5f * light.size_v);
  Bounds box;
  for (int k = 0; k < 4; ++k) box.add(light.center + du * (k & 1 ? 1.0f : -1.0f) + dv * (k & 2 ? 1.0f : -1.0f));
  b.lo = box.lo, b.hi = box.hi, b.axis = light.normal, b.power = light.intensity();
  b.cos_emission = light.slats ? std::cos(std::atan(light.tan_spread)) : 0.0f;
}
inline void bound(const SunLight&, LightBounds&) {}

inline const PointLight* sphere_of(const Shape& shape) {  // null where the lamp is no sphere
  const auto* spot = std::get_if<SpotLight>(&shape);
  const PointLight* point = spot ? &spot->point : std::get_if<PointLight>(&shape);
  return point && point->sphere ? point : nullptr;
}

// A place on the lamp and a direction away from it, for trying out its program.
inline std::pair<Vec3, Vec3> emit(const PointLight& light, Vec2 u) {
  const Vec3 out = sample_uniform_sphere(u);
  return {light.center + out * light.radius, out};
}
inline std::pair<Vec3, Vec3> emit(const SpotLight& light, Vec2 u) {
  const Vec3 out = Frame::from_normal(light.axis).to_world(sample_cone(u, light.one_minus_cos_world));
  return {light.point.center + out * light.point.radius, out};
}
inline std::pair<Vec3, Vec3> emit(const AreaLight& light, Vec2 u) {
  return {light.center + light.u * (light.size_u * (u.x - 0.5f)) + light.v * (light.size_v * (u.y - 0.5f)), light.normal};
}
inline std::pair<Vec3, Vec3> emit(const SunLight& light, Vec2) { return {light.direction, -light.direction}; }

inline float weight_of(const Shape& shape) {  // of a lamp of colour 1: 0 leaves it out
  return std::visit(
      [](const auto& s) {
        if constexpr (std::is_same_v<std::decay_t<decltype(s)>, SunLight>) {
          return s.irradiance();
        } else {
          LightBounds b;
          bound(s, b);
          return b.power;
        }
      },
      shape);
}

}  // namespace gi
