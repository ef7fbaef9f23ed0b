// The lights of a scene: what they are asked for, one by one and as a whole. What they are made of is in light_set.h.
#include "lights/light_set.h"

#include <set>
#include <thread>

namespace gi {

LightSet::LightSet(const Scene& scene, int threads)
    : impl_(std::make_unique<const Impl>(scene, threads > 0 ? threads : int(std::max(1u, std::thread::hardware_concurrency())))),
      has_findable_lamps_(!impl_->bvh.empty()) {}
LightSet::~LightSet() = default;

uint32_t LightSet::count() const { return impl_->count(); }
bool LightSet::is_world(uint32_t light) const { return light == impl_->world_light(); }
const LampData* LightSet::lamp(uint32_t light) const { return light < impl_->first_triangle() ? impl_->lamps[light].data : nullptr; }
uint32_t LightSet::light_of_triangle(uint32_t instance, uint32_t triangle) const {
  if (instance >= impl_->triangle_light.size() || impl_->triangle_light[instance].empty()) return kNoId;
  return impl_->triangle_light[instance][triangle];
}
uint32_t LightSet::light_of_sun(uint32_t sun) const { return impl_->suns[sun]; }
uint32_t LightSet::world_light() const { return impl_->world_light(); }
float LightSet::world_radiance() const { return impl_->world.radiance(); }
float LightSet::world_share_above(float radiance) const { return impl_->world.share_above(radiance); }
uint32_t LightSet::sun_count() const { return uint32_t(impl_->suns.size()); }

std::optional<LightSample> LightSet::sample(const LightQuery& query, float u_choice, Vec2 u) const {
  const auto pick = impl_->pick(query, u_choice);
  if (!pick || !(pick->probability > 0.0f)) return std::nullopt;
  auto s = impl_->sample_light(pick->light, query, u);
  if (s) s->pdf_dir *= pick->probability;
  return s;
}

std::optional<LightSample> LightSet::sample_light(uint32_t light, const LightQuery& query, Vec2 u) const {
  return impl_->sample_light(light, query, u);
}

float LightSet::pick_probability(const LightQuery& query, uint32_t light) const { return impl_->pick_probability(query, light); }

std::optional<LampHit> LightSet::intersect_lamp(const Ray& ray, uint32_t visibility, const LampHit* after) const {
  LampHit best;
  impl_->bvh.visit(ray, [&](uint32_t lamp) {
    const auto t = impl_->meet(lamp, ray, visibility);
    if (!t || !(*t > ray.t_min) || !(*t < ray.t_max)) return;
    // In order of (t, lamp), so that lamps in the same plane are all met.
    if (after && (*t < after->t || (*t == after->t && lamp <= after->lamp))) return;
    if (*t < best.t || (*t == best.t && lamp < best.lamp)) best = {*t, lamp};
  });
  if (best.t == kInf) return std::nullopt;
  return best;
}

LightEval LightSet::eval_lamp(const LightQuery& from, const Ray& ray, const LampHit& hit) const {
  const Lamp& lamp = impl_->lamps[hit.lamp];
  const Vec3 wi = ray.direction;
  if (from.path.depth > lamp.data->max_bounces) return {};
  LightEval e;
  std::visit(
      [&](const auto& s) {
        if constexpr (!std::is_same_v<std::decay_t<decltype(s)>, SunLight>) {
          e.radiance = lamp.data->color * s.radiance(ray.origin, wi);
          e.pdf_dir = s.pdf_dir(from, wi);
        }
      },
      lamp.shape);
  if (is_black(e.radiance)) return {};
  e.radiance = e.radiance * impl_->lamp_program(lamp, ray.origin, wi, hit.t, seen_by_light(from.path, hit.t));
  e.pdf_dir *= impl_->pick_probability(from, hit.lamp);
  return e;
}

LightEval LightSet::eval_sun(uint32_t sun, const LightQuery& from, Vec3 direction, uint32_t visibility) const {
  const uint32_t index = impl_->suns[sun];
  const Lamp& lamp = impl_->lamps[index];
  const SunLight& shape = std::get<SunLight>(lamp.shape);
  if (!(lamp.data->visibility & visibility) || !(lamp.data->use_mis || (visibility & kRayCamera))) return {};
  if (from.path.depth > lamp.data->max_bounces || !shape.shows(direction)) return {};
  return {lamp.data->color * shape.scale * impl_->lamp_program(lamp, from.position, direction, kInf, seen_by_light(from.path, kInf)),
          shape.pdf_dir() * impl_->pick_probability(from, index)};
}

float LightSet::pdf_triangle(const LightQuery& from, const ShadingPoint& point) const {
  const uint32_t light = light_of_triangle(point.instance, point.triangle);
  if (light == kNoId) return 0.0f;
  // By the direction, not by the ray's length: transparent surfaces on the way may have begun the ray anew.
  const float pdf = impl_->triangles[light - impl_->first_triangle()].pdf_dir(from.position, -point.wo);
  return pdf > 0.0f ? pdf * impl_->pick_probability(from, light) : 0.0f;
}

float LightSet::pdf_world(const LightQuery& from, Vec3 direction) const {
  if (!impl_->world.emits() || from.path.depth > impl_->scene.data().world.max_bounces) return 0.0f;
  return impl_->world.pdf_dir(from, direction) * impl_->pick_probability(from, impl_->world_light());
}

std::string LightSet::description() const {
  return std::to_string(impl_->lamps.size()) + " lamps, " + std::to_string(impl_->triangles.size()) + " emissive triangles, " +
         (impl_->world.emits() ? impl_->world.map_width() ? "world map " + std::to_string(impl_->world.map_width()) : "uniform world"
                               : "no world");
}

std::string LightSet::unsampled() const {
  const Scene& scene = impl_->scene;
  std::set<std::string> names;
  const auto shines = [&](int32_t material) { return material >= 0 && scene.material(material).program.has_emission(); };
  for (const Instance& i : scene.instances())
    for (const int32_t m : i.data->materials)
      if (shines(m) && scene.material(m).emission_sampling == EmissionSampling::kNone)
        names.insert("material '" + scene.material(m).program.name() + "'");
  const WorldData& world = scene.data().world;
  if (!world.sampled && shines(world.program)) names.insert("the world");
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace gi
