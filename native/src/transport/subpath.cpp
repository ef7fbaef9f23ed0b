// Walking from the light, and what a vertex sends on.
#include "transport/subpath.h"

#include <new>

namespace gi {
namespace {

constexpr uint32_t kIndirect = kRayDiffuse | kRayGlossy | kRayTransmission;

// Light of a delta lobe, as the eye will see it: f and the narrowing of the pencil, and both cosines about the true normal.
Rgb delta_factor(const RenderContext& context, const ShadingPoint& point, const BsdfSample& next, uint32_t seen_by) {
  static thread_local Bsdf bsdf;
  const uint32_t kind = next.flags & kTransmission ? kRayTransmission : kRayGlossy;
  if (!(seen_by & kind)) return Rgb();
  ShadingPoint turned = context.scene.turned(point, next.wi, point.path);
  context.scene.shade(turned, bsdf);
  const auto e = bsdf.eval_delta(next.wi, point.wo);
  if (!e) return Rgb();
  const float out = abs_dot(point.ng, next.wi) * abs_dot(e->normal, point.wo),
              in = abs_dot(point.ng, point.wo) * abs_dot(e->normal, next.wi);
  return in > 0.0f ? e->value * (out / in) : Rgb();
}

// Of what a vertex scatters towards wi, the part by diffuse lobes.
Rgb diffuse_share(const LightVertex& v, Vec3 wi) {
  if (!(v.bsdf.flags() & kDiffuse)) return Rgb();
  if (!(v.bsdf.flags() & kGlossy)) return Rgb(1.0f);
  const uint8_t side = dot(v.point.ng, wi) >= 0.0f ? kReflection : kTransmission;
  const Rgb all = v.bsdf.eval(v.point.wo, wi).value, diffuse = v.bsdf.eval(v.point.wo, wi, side | kDiffuse).value;
  return {safe_divide(diffuse.r(), all.r()), safe_divide(diffuse.g(), all.g()), safe_divide(diffuse.b(), all.b())};
}

}  // namespace

PathState unknown_state() {
  PathState state;
  state.kind = kRayDiffuse | kRayReflection, state.depth = 1;
  return state;
}

LobeEval eval_seen_by(const Bsdf& bsdf, Vec3 wo, Vec3 wi, uint32_t seen_by) {
  if ((seen_by & kIndirect) == kIndirect) return bsdf.eval(wo, wi);
  LightSample light;
  light.wi = wi, light.visibility = seen_by;
  return eval_for_light(bsdf, wo, light);
}

LobeEval eval_turned(const RenderContext& context, const ShadingPoint& point, const Bsdf& bsdf, Vec3 w, const PathState& path,
                     uint32_t seen_by) {
  const Program& program = context.scene.material(context.scene.material_of(point.instance, point.triangle)).program;
  if (!program.sees_view() && dot(point.ng, w) > 0.0f && bsdf.is_view_free()) return eval_seen_by(bsdf, w, point.wo, seen_by);
  static thread_local Bsdf other;
  ShadingPoint turned = context.scene.turned(point, w, path);
  turned.path.ray_length = point.path.ray_length;
  context.scene.shade(turned, other);
  return eval_seen_by(other, w, point.wo, seen_by);
}

uint8_t bounce_flags(const Bsdf& bsdf, const ShadingPoint& point, Vec3 wi) {
  if (dot(point.ng, wi) < 0.0f) return kTransmission | (bsdf.flags() & kDiffuse ? kDiffuse : kGlossy);
  if (!(bsdf.flags() & kDiffuse)) return kReflection | kGlossy;
  if (!(bsdf.flags() & kGlossy)) return kReflection | kDiffuse;
  const float diffuse = average(bsdf.eval(point.wo, wi, kReflection | kDiffuse).value);
  return kReflection | (diffuse >= 0.5f * average(bsdf.eval(point.wo, wi).value) ? kDiffuse : kGlossy);
}

Rgb passage(const RenderContext& context, Ray ray, uint32_t visibility, PathState path, int transparent_limit) {
  Rgb passed(1.0f);
  for (int layers = 0; layers <= transparent_limit; ++layers) {
    const auto hit = context.scene.intersect(ray, visibility);
    passed *= passed_by_absorbers(context, ray, hit ? hit->t : ray.t_max, path);
    if (!hit) return passed;
    ShadingPoint point = context.scene.shading_point(ray, *hit, path);
    passed *= context.scene.transparency(point);
    if (is_black(passed)) return Rgb();
    ++path.transparent_depth;
    ray = ray_from(point, ray.direction, ray.t_max - hit->t);
  }
  return Rgb();
}

Adjoint adjoint(const RenderContext& context, const ShadingPoint& point, const Bsdf& bsdf, const BsdfSample& next, const PathState& path,
                uint32_t seen_by) {
  if (next.flags & kSpecular) return {delta_factor(context, point, next, seen_by) / next.pdf_dir, 0.0f};
  const LobeEval e = eval_turned(context, point, bsdf, next.wi, path, seen_by);
  return {e.value * (abs_dot(point.ng, next.wi) / (abs_dot(point.ng, point.wo) * next.pdf_dir)), e.pdf_dir};
}

void trace_from_light(const RenderContext& context, const SubpathSettings& settings, Sampler& sampler, LightVertices& vertices) {
  const Heuristic h = settings.heuristic;
  const float u_choice = sampler.next_1d();
  const Vec2 u_place = sampler.next_2d(), u_direction = sampler.next_2d();
  EmissionNumbers& u = vertices.start = {u_choice, u_place.x, u_place.y, u_direction.x, u_direction.y};
  const float weight = settings.guide ? settings.guide->warp(u) : 1.0f;
  const auto emitted = context.lights.emit(u[0], {u[1], u[2]}, {u[3], u[4]});
  if (!emitted || !emitted->cast_shadow) return;
  const LampData* lamp = context.lights.lamp(emitted->light);
  Ray ray = emitted->ray;
  PathState state = unknown_state();
  LightVertex carried;  // what the next vertex begins with; its point and lobes are not used
  carried.max_bounces = lamp ? lamp->max_bounces : context.lights.is_world(emitted->light) ? context.scene.data().world.max_bounces : 1024;
  Rgb passed(1.0f);     // by see-through surfaces on the way
  float travelled = 0;

  for (uint32_t bounce = 0;; ++bounce) {
    sampler.jump_to(bounce + 1);
    const auto hit = context.scene.intersect(ray, kIndirect);
    if (!hit) return;
    const uint32_t visible = context.scene.instances()[hit->instance].data->visibility;
    passed *= passed_by_absorbers(context, ray, hit->t, state);
    LightVertex& v = vertices.grow();
    new (&v.point) ShadingPoint(context.scene.shading_point(ray, *hit, state));  // made in its place: it is large
    if (carried.is_first() && !(visible & kRayShadow)) {  // throws no shadow: the light goes on as if nothing were there
      ray = ray_from(v.point, ray.direction);
      continue;
    }
    if (v.point.strand != kNoId) {  // passes where that is see-through, and ends otherwise
      passed *= context.scene.transparency(v.point);
      if (is_black(passed) || !advance(state, kTransparent, settings.limits)) return;
      travelled += hit->t;
      ray = ray_from(v.point, ray.direction);
      continue;
    }
    v.point.footprint = settings.footprint(v.point.position);
    context.scene.shade(v.point, v.bsdf);
    const float cos_in = abs_dot(v.point.ng, v.point.wo);
    v.bounces = carried.bounces, v.seen_by = carried.seen_by, v.scattered = carried.scattered, v.by_mirrors = carried.by_mirrors;
    v.last_by_mirrors = carried.last_by_mirrors, v.was_transmitted = carried.was_transmitted;
    v.max_bounces = carried.max_bounces;
    if (!(cos_in > 0.0f)) return;
    if (v.is_first()) {
      const LightQuery query = light_query(v.point, v.bsdf);
      const auto light = context.lights.arriving(*emitted, query, settings.weighs);
      const float pdf_emit = context.lights.pdf_emit(emitted->light, v.point.position, v.point.wo);
      if (!light || !(pdf_emit > 0.0f)) return;
      v.weights = PartialWeights();
      if (settings.weighs) {
        // Densities of one path's two ends as sampled directly and by itself. [Georgiev 2012, eq. 31, 32 and 48 to 52, here per steradian
        // and area at this vertex, which serves lights near and far alike]
        const float pdf_joined = pdf_emit * cos_in * settings.joined;
        v.weights.vcm = h(light->pdf_dir * context.lights.pick_probability(query, emitted->light) / pdf_joined);
        v.weights.vc = light->is_delta || !light->use_mis ? 0.0f : h(1.0f / pdf_joined);
      }
      v.power = light->radiance * passed * (weight / pdf_emit);
      v.seen_by = light->visibility;
    } else {
      v.weights = carried.weights.arrived(h, travelled + hit->t, cos_in);
      v.power = carried.power * passed;
    }
    vertices.keep();
    const bool is_last = v.bounces.total >= std::min(settings.limits.total, v.max_bounces) - (v.is_first() ? 0 : 1);
    if (is_last && !(v.bsdf.flags() & kTransparent)) return;

    // Draw the next direction.
    const float u_lobe = sampler.next_1d(), u_continue = sampler.next_1d();
    const auto next = v.bsdf.sample(v.point.wo, sampler.next_2d(), u_lobe);
    if (!next || !(next->pdf_dir > 0.0f)) return;
    if (next->flags & kPortal) return;  // where light would come out there is no telling
    if (next->flags & kTransparent) {
      passed *= next->value / next->pdf_dir;
      if (!advance(state, next->flags, settings.limits) || is_black(passed)) return;
      travelled += hit->t;
      ray = ray_from(v.point, ray.direction);
      continue;
    }
    carried.bounces = v.bounces;
    if (!v.is_first()) carried.bounces.add(next->flags);
    // The next vertex will have to scatter too.
    if (!carried.bounces.within(settings.limits) || carried.bounces.total >= std::min(settings.limits.total, v.max_bounces)) return;

    const float cos_out = abs_dot(v.point.ng, next->wi);
    const bool is_delta = next->flags & kSpecular;
    const auto [factor, pdf_reverse] = adjoint(context, v.point, v.bsdf, *next, state, v.seen_by);
    if (is_black(factor)) return;

    // Russian roulette by what is left.
    const float alpha = std::min(1.0f, max_component(factor));
    if (u_continue >= alpha) return;
    carried.power = v.power * factor / alpha;
    carried.weights = v.weights.scattered(h, is_delta, cos_out, next->pdf_dir, pdf_reverse, settings.merged(v.point.position));
    const Rgb diffuse = is_delta ? Rgb() : diffuse_share(v, next->wi);
    if (v.hides_mirrors(settings.without)) carried.power *= Rgb(1.0f) - diffuse * v.last_by_mirrors;
    carried.last_by_mirrors = Rgb(1.0f) - diffuse;
    carried.by_mirrors = v.by_mirrors * carried.last_by_mirrors, carried.was_transmitted = next->flags & kTransmission;
    if (settings.only_by_mirrors && is_black(carried.by_mirrors)) return;
    carried.scattered = v.scattered + 1, carried.seen_by = visible;
    passed = Rgb(1.0f), travelled = 0;
    ray = ray_from(v.point, next->wi);
  }
}

std::optional<LensConnection> connect_to_lens(const RenderContext& context, const BounceLimits& limits, const LightVertex& v, int pixels,
                                              Vec2 u_lens) {
  const InstanceData& instance = *context.scene.instances()[v.point.instance].data;
  if (v.bsdf.is_delta() || instance.holdout || !(instance.visibility & kRayCamera)) return {};
  const auto lens = sample_lens(context.camera, v.point.position, u_lens);
  if (!lens) return {};
  const LobeEval e = eval_turned(context, v.point, v.bsdf, lens->wi, PathState(), v.seen_by);
  if (is_black(e.value)) return {};
  BounceCount bounces = v.bounces;
  if (!v.is_first()) bounces.add(bounce_flags(v.bsdf, v.point, lens->wi));
  if (!bounces.within(limits) || bounces.total > v.max_bounces) return {};
  const float cos_in = abs_dot(v.point.ng, v.point.wo), cos_out = abs_dot(v.point.ng, lens->wi);
  LensConnection c{*lens, v.power * e.value * (cos_out / cos_in * lens->density * float(pixels)), 0.0f, e.pdf_dir};
  const Ray seen{v.point.position + lens->wi * lens->free, -lens->wi};
  c.pdf_area = lens_density(context.camera, seen, lens->free) * float(pixels) * cos_out;
  return c;
}

Rgb passage_to_lens(const RenderContext& context, const BounceLimits& limits, const LightVertex& v, const LensSample& lens) {
  const Vec3 end = offset_point(v.point.position, v.point.ng, lens.wi);
  return passage(context, {end + lens.wi * lens.free, -lens.wi, 0.0f, lens.free * (1.0f - 1e-4f)}, kRayCamera, PathState(),
                 limits.transparent);
}

double splat_unit(const RenderContext& context) {
  const double radius = 0.5 * double(length(context.scene.bounds().extent()));
  const double unit = double(context.lights.emitted_power()) / (radius * radius) * 0x1p-44;
  return unit > 0 && std::isfinite(unit) ? unit : 1e-12;
}

}  // namespace gi
