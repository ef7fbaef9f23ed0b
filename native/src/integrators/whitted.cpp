// Ray tracing [Whitted 1980]: mirror and glass chains down to the first rough surface, which every light illuminates
// from its centre alone: hard shadows, no light between rough surfaces. Reflection and refraction are not branched but
// drawn at random over the passes. The world has no centre: it is sampled at random.
#include "integrators/integrator.h"
#include "transport/direct_light.h"
#include "transport/first_hit.h"

namespace gi {
namespace {

// More lights than this are drawn at random.
constexpr uint32_t kAllLights = 32;

class WhittedIntegrator final : public Integrator {
 public:
  explicit WhittedIntegrator(const Parameters& p)
      : limits_{p.integer("max_bounces"), 0, p.integer("max_bounces"), p.integer("max_bounces"), p.integer("transparent_bounces")} {}

  void render_pass(const RenderContext& context, int pass, Film& film) override {
    for_each_pixel(context, pass, film,
                   [&](const CameraRay& camera, Sampler& sampler) { return trace(context, film.spec(), camera, sampler); });
  }

 private:
  PixelSample trace(const RenderContext& context, const FilmSpec& film, const CameraRay& camera, Sampler& sampler) const {
    static thread_local Bsdf bsdf;
    PixelSample result;
    Ray ray = camera.ray;
    PathState path;
    RayOrigin origin;  // infinitely dense: every luminaire seen counts in full
    Rgb throughput(1.0f);
    bool seen_from_camera = true;

    while (true) {
      const uint32_t visibility = visibility_of(path.kind);
      const auto hit = context.scene.intersect(ray, visibility);
      result.radiance += throughput * lamps_along(context, ray, hit ? hit->t : kInf, origin, LightSampling::kOn, visibility);
      if (!hit) {
        if (seen_from_camera && film.transparent) {
          result.alpha -= average(throughput);
          break;
        }
        const Rgb beyond = throughput * light_beyond(context, ray, origin, LightSampling::kOn, path);
        if (seen_from_camera) result.environment += beyond;
        result.radiance += beyond;
        break;
      }
      ShadingPoint point = context.scene.shading_point(ray, *hit, path, camera.footprint + camera.spread * hit->t);
      context.scene.shade(point, bsdf);
      if (path.depth == 0) record_surface(context, point, bsdf, result);
      if (seen_from_camera) {
        if (context.scene.instances()[point.instance].data->holdout) bsdf.hold_out();
        result.alpha -= average(throughput * bsdf.holdout);
      }
      if (path.depth == 0) result.emission += throughput * bsdf.emission;
      result.radiance += throughput * (bsdf.emission + light_from_centres(context, point, bsdf, sampler));

      const auto next = bsdf.sample_delta(point.wo, sampler.next_1d());
      if (!next || !advance(path, next->flags, limits_)) break;
      if (!(next->flags & kTransparent)) seen_from_camera = false;
      throughput *= next->value / next->pdf_dir * bsdf.delta_probability();
      if (is_black(throughput)) break;
      ray = {offset_point(point.position, point.ng, next->wi), next->wi, 0.0f, kInf};
    }
    return result;
  }

  static Rgb light_from_centres(const RenderContext& context, const ShadingPoint& point, const Bsdf& bsdf, Sampler& sampler) {
    if (bsdf.is_delta()) return Rgb();
    const uint32_t lights = context.lights.count(), taken = std::min(lights, kAllLights);
    const LightQuery query = light_query(point, bsdf);
    Rgb sum;
    for (uint32_t i = 0; i < taken; ++i) {
      const uint32_t light = taken == lights ? i : std::min(uint32_t(sampler.next_1d() * float(lights)), lights - 1);
      const Vec2 u = context.lights.has_centre(light) ? Vec2{0.5f, 0.5f} : sampler.next_2d();
      const auto s = context.lights.sample_light(light, query, u);
      if (!s || !(s->pdf_dir > 0.0f)) continue;
      const Rgb value = eval_for_light(bsdf, point.wo, *s).value * s->radiance / s->pdf_dir;
      sum += shadowed(context, point, *s, value);
    }
    return sum * safe_divide(float(lights), float(taken));
  }

  BounceLimits limits_;
};

}  // namespace

const Descriptor& whitted_descriptor() {
  using Kind = Parameter::Kind;
  static const Descriptor descriptor{
      "whitted",
      "Ray Tracing",
      "Mirrors, glass and hard shadows from the centres of lights (Whitted)",
      {
          {"max_bounces", "Bounces", Kind::kInt, 12, 0, 1024, "Reflections and refractions in a row"},
          {"transparent_bounces", "Transparent", Kind::kInt, 8, 0, 1024, "Transparent surfaces passed by one ray"},
      },
      [](const Parameters& p) -> std::unique_ptr<Integrator> { return std::make_unique<WhittedIntegrator>(p); }};
  return descriptor;
}

}  // namespace gi
