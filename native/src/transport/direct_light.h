// Direct light, both ways: by choosing a light and a direction to it, and by what a ray meets by itself.
// The two are weighed by multiple importance sampling. [Veach 1997, ch. 9]
#pragma once
#include "transport/absorption.h"
#include "transport/path_state.h"
#include "transport/render_context.h"

namespace gi {

enum class LightSampling { kOff, kOn, kMis };

// Where a ray started and with which density its direction was drawn. Camera rays and delta lobes: infinite.
struct RayOrigin {
  LightQuery query;
  float pdf_dir = kInf;
};

inline LightQuery light_query(const ShadingPoint& point, const Bsdf& bsdf) {
  return {point.position, point.ns, (bsdf.flags() & kTransmission) != 0, point.path};
}

// Weight of light that a ray found by itself, against light sampling's density for the same direction.
inline float found_weight(LightSampling mode, float pdf_ray, float pdf_light) {
  if (mode == LightSampling::kOff || !(pdf_light > 0.0f) || !std::isfinite(pdf_ray)) return 1.0f;
  return mode == LightSampling::kOn ? 0.0f : power_heuristic(pdf_ray, pdf_light);
}

// f |cos| of the point for a sampled light, of the lobes that the light is visible to.
inline LobeEval eval_for_light(const Bsdf& bsdf, Vec3 wo, const LightSample& light) {
  LobeEval e = bsdf.eval(wo, light.wi);
  const auto sees = [&](uint32_t kind) { return (light.visibility & kind) == kind; };
  if (sees(kRayDiffuse | kRayGlossy | kRayTransmission)) return e;
  if (dot(bsdf.geometric_normal(), light.wi) < 0.0f) {
    if (!sees(kRayTransmission)) e.value = Rgb();
  } else if (!sees(kRayDiffuse | kRayGlossy)) {
    e.value = sees(kRayDiffuse)  ? bsdf.eval(wo, light.wi, kReflection | kDiffuse).value
              : sees(kRayGlossy) ? bsdf.eval(wo, light.wi, kReflection | kGlossy).value
                                 : Rgb();
  }
  return e;
}

// The media that a path is in, and random numbers for what goes through them.
struct Surroundings {
  const Media& media;
  Sampler& random;
};

inline PathState in_shadow(PathState path) {
  path.kind = kRayShadow;
  return path;
}

// What the media let pass of a shadow ray from a surface, on whichever side of it. Without `around`: those that only absorb.
inline Rgb through_media(const RenderContext& context, const ShadingPoint& point, const Ray& ray, const Surroundings* around) {
  if (!around) return passed_by_absorbers(context, ray, ray.t_max, in_shadow(point.path));
  Media beyond = around->media;
  if (dot(point.ng, ray.direction) < 0.0f) beyond.cross(context.scene, point, ray.direction);
  return beyond.transmittance_through(context.scene, ray, in_shadow(point.path), around->random);
}

// The share of a sampled light that arrives: what lies between is looked at last.
inline Rgb shadowed(const RenderContext& context, const ShadingPoint& point, const LightSample& light, Rgb contribution,
                    const Surroundings* around = nullptr) {
  if (!light.cast_shadow || is_black(contribution)) return contribution;
  // Towards the sampled point itself: the ray starts a little beside the point that it was sampled from, and would
  // otherwise pass or meet a luminaire that is very near.
  Ray ray = ray_from(point, light.wi);
  if (point.strand == kNoId) ray.origin = offset_point(context.scene.shadow_origin(point, light.wi), point.ng, light.wi);
  if (std::isfinite(light.distance)) {
    const Vec3 to = point.position + light.wi * light.distance - ray.origin;
    const float distance = length(to);
    if (!(distance > 0.0f)) return contribution;
    ray.direction = to / distance, ray.t_max = distance * (1.0f - 1e-4f);
  }
  contribution *= context.scene.transmittance(ray, point.path);
  return is_black(contribution) ? contribution : contribution * through_media(context, point, ray, around);
}

// One light, chosen by its importance: `scattered(light, e)` V / p, weighed. `pdf_of(wi, e)` is the density with which the next ray
// would be drawn towards wi.
template <class PdfOf, class Scattered>
Rgb sample_direct_light(const RenderContext& context, const LightQuery& query, const ShadingPoint& point, const Bsdf& bsdf,
                        LightSampling mode, float u_choice, Vec2 u, const PdfOf& pdf_of, const Scattered& scattered,
                        const Surroundings* around = nullptr) {
  if (mode == LightSampling::kOff || bsdf.is_delta()) return Rgb();
  const auto light = context.lights.sample(query, u_choice, u);
  if (!light || is_black(light->radiance) || !(light->pdf_dir > 0.0f)) return Rgb();
  const LobeEval e = eval_for_light(bsdf, point.wo, *light);
  const bool found_otherwise = mode == LightSampling::kMis && !light->is_delta && light->use_mis;
  const float weight = found_otherwise ? power_heuristic(light->pdf_dir, pdf_of(light->wi, e)) : 1.0f;
  return shadowed(context, point, *light, scattered(*light, e) * (weight / light->pdf_dir), around);
}

// All that its lobes scatter: f cos L.
template <class PdfOf>
Rgb sample_direct_light(const RenderContext& context, const ShadingPoint& point, const Bsdf& bsdf, LightSampling mode, float u_choice,
                        Vec2 u, const PdfOf& pdf_of, const Surroundings* around = nullptr) {
  const auto all = [](const LightSample& light, const LobeEval& e) { return e.value * light.radiance; };
  return sample_direct_light(context, light_query(point, bsdf), point, bsdf, mode, u_choice, u, pdf_of, all, around);
}

inline Rgb sample_direct_light(const RenderContext& context, const ShadingPoint& point, const Bsdf& bsdf, LightSampling mode,
                               float u_choice, Vec2 u) {
  return sample_direct_light(context, point, bsdf, mode, u_choice, u, [](Vec3, const LobeEval& e) { return e.pdf_dir; });
}

// Light that arrives at a place within a medium and is scattered towards `wo`.
inline Rgb sample_light_in_medium(const RenderContext& context, const Medium& medium, const Surroundings& around, const LightQuery& query,
                                  Vec3 wo, LightSampling mode, float u_choice, Vec2 u) {
  if (mode == LightSampling::kOff) return Rgb();
  const auto light = context.lights.sample(query, u_choice, u);
  if (!light || !(light->visibility & kRayVolume) || is_black(light->radiance) || !(light->pdf_dir > 0.0f)) return Rgb();
  const LobeEval e = medium.eval(wo, light->wi);
  const bool found_otherwise = mode == LightSampling::kMis && !light->is_delta && light->use_mis;
  const float weight = found_otherwise ? power_heuristic(light->pdf_dir, e.pdf_dir) : 1.0f;
  Rgb contribution = e.value * light->radiance * (weight / light->pdf_dir);
  if (!light->cast_shadow || is_black(contribution)) return contribution;
  const float reach = std::isfinite(light->distance) ? light->distance * (1.0f - 1e-4f) : kInf;
  const Ray ray{query.position, light->wi, 0.0f, reach};
  contribution *= context.scene.transmittance(ray, query.path);
  if (is_black(contribution)) return contribution;
  return contribution * around.media.transmittance_through(context.scene, ray, in_shadow(query.path), around.random);
}

// Lamps that a ray passes on its way to a surface at `t_surface`: they do not block it. passed(t): what of their light arrives from there.
template <class Passed>
Rgb lamps_along(const RenderContext& context, Ray ray, float t_surface, const RayOrigin& from, LightSampling mode, uint32_t visibility,
                const Passed& passed) {
  Rgb sum;
  if (!context.lights.has_findable_lamps()) return sum;
  ray.t_max = t_surface;
  auto hit = context.lights.intersect_lamp(ray, visibility);
  while (hit) {
    const LightEval e = context.lights.eval_lamp(from.query, ray, *hit);
    sum += e.radiance * found_weight(mode, from.pdf_dir, e.pdf_dir) * passed(hit->t);
    hit = context.lights.intersect_lamp(ray, visibility, &*hit);
  }
  return sum;
}
// The same through volumes that only absorb.
inline Rgb lamps_along(const RenderContext& context, const Ray& ray, float t_surface, const RayOrigin& from, LightSampling mode,
                       uint32_t visibility) {
  return lamps_along(context, ray, t_surface, from, mode, visibility,
                     [&](float t) { return passed_by_absorbers(context, ray, t, from.query.path); });
}

// Suns and the world, seen by a ray that leaves the scene: weighed, all in all and the world alone.
struct LightBeyond {
  Rgb suns, world;
  float world_weight = 1.0f;

  operator Rgb() const { return suns + world * world_weight; }
};
inline LightBeyond light_beyond(const RenderContext& context, const Ray& ray, const RayOrigin& from, LightSampling mode,
                                const PathState& path) {
  const uint32_t visibility = visibility_of(path.kind);
  LightBeyond found;
  for (uint32_t sun = 0; sun < context.lights.sun_count(); ++sun) {
    const LightEval e = context.lights.eval_sun(sun, from.query, ray.direction, visibility);
    if (!is_black(e.radiance)) found.suns += e.radiance * found_weight(mode, from.pdf_dir, e.pdf_dir);
  }
  if (context.scene.data().world.visibility & visibility) {
    found.world = context.scene.world_radiance(ray.direction, path);
    const bool weighed = mode != LightSampling::kOff && std::isfinite(from.pdf_dir) && !is_black(found.world);
    if (weighed) found.world_weight = found_weight(mode, from.pdf_dir, context.lights.pdf_world(from.query, ray.direction));
  }
  return found;
}

// Emission of the surface that a ray met, weighed.
inline Rgb surface_emission(const RenderContext& context, const ShadingPoint& point, Rgb emission, const RayOrigin& from,
                            LightSampling mode) {
  if (is_black(emission)) return Rgb();
  const bool weighed = mode != LightSampling::kOff && std::isfinite(from.pdf_dir);
  return emission * (weighed ? found_weight(mode, from.pdf_dir, context.lights.pdf_triangle(from.query, point)) : 1.0f);
}

}  // namespace gi
