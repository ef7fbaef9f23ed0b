// Paths from the eye that end at diffuse surfaces, where something else knows the light: they follow what is specular and glossy, and find
// what comes straight from luminaires by themselves.
#pragma once
#include "transport/camera_path.h"

namespace gi {

// The radiance of diffuse lobes, by how the light came there.
struct KnownLight {
  Rgb caustic, global;
};

struct DiffuseEndSettings {
  BounceLimits limits;
  uint8_t without = 0;          // CausticFlags: what a path does not see after a diffuse bounce
  bool direct_known = false;    // what is known where a path ends includes direct light: of one that has not gathered,
  bool direct_gathered = false;  // of one that has
  bool caustics_known = false;  // where a path gathers, the light that mirrors, glass and glossy surfaces throw is known
};

// A path under way. One that has gathered has left a diffuse surface to look for the light of others.
struct EndingPath {
  CameraPath path;
  bool gathered = false;
  float first_distance = kInf, last_distance = kInf;  // of rays
};

// Direct light by chance: luminaires that a ray of the chosen lobes meets before anything else.
inline Rgb meet_light(const RenderContext& context, const BounceLimits& limits, const ShadingPoint& point, const Bsdf& bsdf,
                      PathState state, Vec2 u, float u_lobe) {
  constexpr LightSampling kMode = LightSampling::kMis;
  const auto next = bsdf.sample(point.wo, u, u_lobe);
  if (!next || !(next->pdf_dir > 0.0f)) return Rgb();
  const RayOrigin origin{light_query(point, bsdf), next->pdf_dir};
  advance(state, next->flags, limits);
  const uint32_t visibility = visibility_of(state.kind);
  Ray ray = ray_from(point, next->wi);
  Rgb throughput = next->value / next->pdf_dir, found;
  do {
    const auto hit = context.scene.intersect(ray, visibility);
    found += throughput * lamps_along(context, ray, hit ? hit->t : kInf, origin, kMode, visibility);
    throughput *= passed_by_absorbers(context, ray, hit ? hit->t : kInf, state);
    if (!hit) return found + throughput * light_beyond(context, ray, origin, kMode, state);
    ShadingPoint met = context.scene.shading_point(ray, *hit, state);
    found += throughput * surface_emission(context, met, context.scene.emission(met), origin, kMode);
    throughput *= context.scene.transparency(met);
    ray = ray_from(met, ray.direction);
  } while (!is_black(throughput) && advance(state, kTransparent, limits));
  return found;
}

// Follows one path. `at_end(point, bsdf, gathered)`: what is known of the radiance of the diffuse lobes, as std::optional<KnownLight>.
// Nothing: it shall gather from here, though it may have before, and `at_gather(point, bsdf)` is what is known of caustics here.
template <class AtGather, class AtEnd>
void trace_to_diffuse(const RenderContext& context, const Film& film, const DiffuseEndSettings& s, const CameraRay& camera,
                      EndingPath& ending, Sampler& sampler, PixelSample& result, const AtGather& at_gather, const AtEnd& at_end) {
  constexpr LightSampling kMode = LightSampling::kMis;
  constexpr uint8_t kOthers = kGlossy | kSpecular | kTransparent;
  constexpr int kIndirectDepth = 1 << 20;
  Bsdf bsdf;
  CameraPath& path = ending.path;
  bool& gathered = ending.gathered;
  bool may_scatter = true;
  bool known = gathered && s.caustics_known;  // what shines here has been counted where the path gathered
  const int first_depth = context.lightmap ? context.lightmap->first_depth() : 0;
  LightTerm beyond = kDirectTerm;  // what comes from behind the first bounce belongs to
  const auto add_to = [&](LightTerm term, Rgb radiance, int depth) {
    if (depth < first_depth) return;
    const Rgb light = path.throughput * radiance;
    result.radiance += light, result.terms[term] += light;
  };
  const auto add = [&](Rgb radiance, int depth, LightTerm here) { add_to(path.state.depth == 0 ? here : beyond, radiance, depth); };
  // Luminaires that the ray itself meets: of one that left diffuse lobes, the other half of what light sampling finds.
  const auto add_met = [&](Rgb radiance) {
    const int depth = path.state.depth;
    add_to(depth == 0 || (depth == 1 && beyond == kGlobalTerm) ? kDirectTerm : beyond, radiance, depth);
  };

  for (uint32_t bounce = 0;; ++bounce) {
    sampler.jump_to(bounce + 1);
    const uint32_t visibility = visibility_of(path.state.kind);
    const auto hit = context.scene.intersect(path.ray, visibility);
    const int depth = path.state.depth;
    if (!known) add_met(lamps_along(context, path.ray, hit ? hit->t : kInf, path.origin, kMode, visibility));
    path.absorb(context, hit ? hit->t : kInf);
    if (!hit) {
      if (!known) add_met(path.leave(context, film, kMode, result));
      break;
    }
    if (bounce == 0) ending.first_distance = hit->t;
    ending.last_distance = hit->t;
    const ShadingPoint point = path.arrive(context, film, camera, *hit, bsdf, result);
    const Rgb emitted = known ? Rgb() : surface_emission(context, point, bsdf.emission, path.origin, kMode);
    if (depth == 0) result.emission += path.throughput * emitted;
    add_met(emitted);

    const float u_light_choice = sampler.next_1d(), u_lobe = sampler.next_1d();
    const Vec2 u_light = sampler.next_2d(), u = sampler.next_2d();
    // Of the lobes chosen, of which the next ray is drawn with probability `p`.
    const auto direct_light = [&](float p = 1.0f) {
      return sample_direct_light(context, point, bsdf, kMode, u_light_choice, u_light,
                                 [p](Vec3, const LobeEval& e) { return p * e.pdf_dir; });
    };
    float p_lobes = 1.0f;  // of the choice between diffuse lobes and others
    const bool on_strand = point.strand != kNoId;  // where no light path ends: nothing is known there
    const bool ends = may_scatter && (bsdf.flags() & kDiffuse) && !on_strand;
    const std::optional<KnownLight> found = ends ? at_end(point, bsdf, gathered) : std::nullopt;
    const bool gathers = ends && !found;
    if (gathers) {
      // From here either the diffuse lobes are followed, which then gather, or the others.
      add(at_gather(point, bsdf), kIndirectDepth, kCausticTerm);
      const float diffuse = average(bsdf.albedo(point.wo, kDiffuse));
      const float others = average(bsdf.albedo(point.wo, kGlossy | kSpecular) + bsdf.passed());
      const float p_diffuse = others > 0.0f ? std::clamp(diffuse / (diffuse + others), 0.1f, 0.9f) : 1.0f;
      if (p_diffuse == 1.0f) {
        add(direct_light(), depth + 1, kDirectTerm);
      } else {
        const bool follows_diffuse = sampler.next_1d() < p_diffuse;
        for (const bool last : {false, true}) {
          const bool is_for_diffuse = follows_diffuse == last;
          p_lobes = is_for_diffuse ? p_diffuse : 1.0f - p_diffuse;
          bsdf.choose(is_for_diffuse ? uint8_t(kDiffuse) : kOthers, point.wo);
          add(direct_light(p_lobes), depth + 1, is_for_diffuse ? kDirectTerm : kSpecularTerm);
        }
      }
    } else if (may_scatter) {
      // The diffuse lobes end the path, the others go on.
      if (found) {
        add(found->caustic, kIndirectDepth, kCausticTerm);
        add(found->global, kIndirectDepth, kGlobalTerm);
        bsdf.choose(kDiffuse, point.wo);
        if (!(gathered ? s.direct_gathered : s.direct_known)) {
          add(direct_light(), depth + 1, kDirectTerm);
          add(meet_light(context, s.limits, point, bsdf, path.state, u, u_lobe), depth + 1, kDirectTerm);
        }
        bsdf.choose(kOthers, point.wo);
      }
      if (on_strand || !(gathered && s.caustics_known)) add(direct_light(), depth + 1, kSpecularTerm);
    }

    const auto next = bsdf.sample(point.wo, u, u_lobe);
    if (!next || !(next->pdf_dir > 0.0f)) break;
    const bool transparent = next->flags & kTransparent;
    if (!may_scatter && !transparent) break;
    const Rgb weight = next->value / (p_lobes * next->pdf_dir);
    path.throughput *= weight;
    if (is_black(path.throughput)) break;
    if (transparent) {
      if (!advance(path.state, next->flags, s.limits)) break;
      path.pass(point, bsdf, *next, hit->t);
      continue;
    }
    path.travelled += hit->t;
    const bool gathers_next = gathers && (next->flags & kDiffuse);
    if (depth == 0) beyond = gathers_next ? kGlobalTerm : kSpecularTerm;
    may_scatter = advance(path.state, next->flags, s.limits);
    const FilmSpec& spec = film.spec();
    if (!(spec.transparent_glass && (next->flags & kTransmission) && next->roughness <= spec.transparent_roughness))
      path.seen_from_camera = false;
    known = gathered && !gathers_next && s.caustics_known && !on_strand;
    if (gathers_next) gathered = true;
    path.state.without = next->flags & kDiffuse ? s.without : 0;
    path.origin = {light_query(point, bsdf), next->flags & kSpecular ? kInf : p_lobes * next->pdf_dir};
    path.ray = ray_from(point, next->wi);

    const float alpha = std::min(1.0f, max_component(weight));
    if (alpha < 1.0f) {
      if (sampler.next_1d() >= alpha) break;
      path.throughput *= 1.0f / alpha;
    }
  }
}

}  // namespace gi
