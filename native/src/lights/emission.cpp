// Light as it leaves luminaires: one chosen by its power, a place on it and a direction; and where it arrives, what sampling and
// finding that light by itself would have said.
#include "lights/light_set.h"

namespace gi {

std::optional<EmittedRay> LightSet::Impl::emit_lamp(uint32_t light, Vec2 u_place, Vec2 u_direction) const {
  const Lamp& lamp = lamps[light];
  const ShapeEmission e = std::visit([&](const auto& s) { return gi::emit(s, ball, u_place, u_direction); }, lamp.shape);
  if (!(e.power > 0.0f)) return std::nullopt;
  EmittedRay r{{e.origin, e.direction}, lamp.data->color * e.power, light, lamp.data->cast_shadow, lamp.data->visibility};
  const bool is_sun = std::holds_alternative<SunLight>(lamp.shape);
  // Programs see the lamp from a metre away: what they make of the distance is not known yet.
  if (is_sun)
    r.power *= lamp_program(lamp, ball.center, -e.direction, kInf, seen_by_light({}, kInf));
  else
    r.power *= lamp_program(lamp, e.origin + e.direction, -e.direction, 1.0f, seen_by_light({}, 1.0f));
  return r;
}

std::optional<EmittedRay> LightSet::Impl::emit_triangle(uint32_t light, Vec2 u_place, Vec2 u_direction) const {
  const TriangleLight& t = triangles[light - first_triangle()];
  const float sides = float(t.front + t.back);
  bool back = t.back;
  if (t.front && t.back) {
    back = u_direction.x >= 0.5f;
    u_direction.x = std::min(2.0f * u_direction.x - (back ? 1.0f : 0.0f), kOneMinusEpsilon);
  }
  const Vec3 n = back ? -t.normal() : t.normal();
  const Vec2 b = sample_triangle(u_place);
  const Vec3 direction = Frame::from_normal(n).to_world(sample_cosine_hemisphere(u_direction));
  const Vec3 place = t.a + b.x * t.ab + b.y * t.ac;
  const float scale = std::max({std::abs(place.x), std::abs(place.y), std::abs(place.z), 1e-2f});
  const Rgb power = triangle_emission(t, b, direction, {}, 1.0f) * (kPi * t.area() * sides);
  return EmittedRay{{place + n * (scale * 4e-6f), direction}, power, light, true, scene.instances()[t.instance].data->visibility, b};
}

EmittedRay LightSet::Impl::emit_world(Vec2 u_place, Vec2 u_direction) const {
  const auto [wi, pdf] = world.sample({}, u_direction);
  EmittedRay r{{ball.entry(wi, u_place), -wi}, Rgb(), world_light(), true, scene.data().world.visibility};
  if (pdf > 0.0f) r.power = scene.world_radiance(wi, seen_by_light({}, kInf)) * (ball.cross_section() / pdf);
  return r;
}

// ---------------------------------------------------------------- the other way round

std::optional<LightSample> LightSet::Impl::arriving_lamp(const EmittedRay& emitted, const LightQuery& query, bool with_pdf) const {
  const Lamp& lamp = lamps[emitted.light];
  const auto s = std::visit([&](const auto& shape) { return gi::arriving(shape, query, emitted.ray, with_pdf); }, lamp.shape);
  if (!s || !(s->scale > 0.0f)) return std::nullopt;
  LightSample l = lamp_sample(lamp, emitted.light, query, *s);
  if (!is_finite(l.radiance) || !std::isfinite(l.pdf_dir)) return std::nullopt;
  return l;
}

std::optional<LightSample> LightSet::Impl::arriving_triangle(const EmittedRay& emitted, const LightQuery& query, bool with_pdf) const {
  const TriangleLight& t = triangles[emitted.light - first_triangle()];
  const Vec3 wi = -emitted.ray.direction;
  const float pdf = with_pdf ? t.pdf_dir(query.position, wi) : 0.0f;
  if (with_pdf ? !(pdf > 0.0f) : !t.shines_to(query.position)) return std::nullopt;
  const Vec2 b = emitted.barycentrics;
  return triangle_sample(emitted.light, query, {wi, length(t.a + t.ab * b.x + t.ac * b.y - query.position), pdf, b.x, b.y});
}

std::optional<EmittedRay> LightSet::emit(float u_choice, Vec2 u_place, Vec2 u_direction) const {
  if (!(impl_->emitters.total() > 0)) return std::nullopt;
  const uint32_t light = uint32_t(impl_->emitters.sample(u_choice));
  auto r = light < impl_->first_triangle() ? impl_->emit_lamp(light, u_place, u_direction)
           : light < impl_->world_light()  ? impl_->emit_triangle(light, u_place, u_direction)
                                           : impl_->emit_world(u_place, u_direction);
  if (!r) return std::nullopt;
  r->power *= 1.0f / impl_->emitters.probability(light);
  if (!is_finite(r->power) || is_black(r->power)) return std::nullopt;
  return r;
}

bool LightSet::turns_to(const EmittedRay& emitted, Vec3 position) const {
  if (emitted.light >= impl_->first_triangle()) return true;
  const Shape& shape = impl_->lamps[emitted.light].shape;
  const auto* spot = std::get_if<SpotLight>(&shape);
  const PointLight* point = spot ? &spot->point : std::get_if<PointLight>(&shape);
  if (!point || point->sphere || !point->has_shape()) return true;
  return point->intersect({position, -emitted.ray.direction}).has_value();
}

float LightSet::emitted_power() const { return float(impl_->emitters.total()); }

std::optional<LightSample> LightSet::arriving(const EmittedRay& emitted, const LightQuery& query, bool with_pdf) const {
  const Impl& impl = *impl_;
  const Vec3 wi = -emitted.ray.direction;
  return emitted.light < impl.first_triangle() ? impl.arriving_lamp(emitted, query, with_pdf)
         : emitted.light < impl.world_light()  ? impl.arriving_triangle(emitted, query, with_pdf)
                                               : std::optional(impl.world_sample(query, wi, impl.world.pdf_dir(query, wi)));
}

float LightSet::pdf_emit(uint32_t light, Vec3 position, Vec3 wi) const {
  const Impl& impl = *impl_;
  if (light >= impl.emitters.size()) return 0.0f;
  const float choice = impl.emitters.probability(light);
  if (light < impl.first_triangle())
    return choice * std::visit([&](const auto& s) { return pdf_ray(s, impl.ball, position, wi); }, impl.lamps[light].shape);
  if (light < impl.world_light()) {
    const TriangleLight& t = impl.triangles[light - impl.first_triangle()];
    return t.shines_to(position) ? choice * kInvPi / (t.area() * float(t.front + t.back)) : 0.0f;
  }
  return choice * impl.world.pdf_dir({}, wi) / impl.ball.cross_section();
}

}  // namespace gi
