// Ray tracing [Whitted 1980]: mirror and glass chains down to the first rough surface, which every light illuminates
// from its centre alone: hard shadows, no light between rough surfaces. Reflection and refraction are not branched but
// drawn at random over the passes. The world has no centre: it is sampled at random.
#include "integrators/integrator.h"
#include "transport/camera_path.h"

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
                   [&](const CameraRay& camera, Sampler& sampler, PixelSample& result) { trace(context, film, camera, sampler, result); });
  }

 private:
  void trace(const RenderContext& context, const Film& film, const CameraRay& camera, Sampler& sampler, PixelSample& result) const {
    Bsdf bsdf;
    CameraPath path(camera);  // its origin is infinitely dense: every luminaire seen counts in full

    while (true) {
      const uint32_t visibility = visibility_of(path.state.kind);
      const auto hit = context.scene.intersect(path.ray, visibility);
      result.radiance += path.throughput * lamps_along(context, path.ray, hit ? hit->t : kInf, path.origin, LightSampling::kOn, visibility);
      path.absorb(context, hit ? hit->t : kInf);
      if (!hit) {
        result.radiance += path.throughput * path.leave(context, film, LightSampling::kOn, result);
        break;
      }
      const ShadingPoint point = path.arrive(context, film, camera, *hit, bsdf, result);
      if (path.state.depth == 0) result.emission += path.throughput * bsdf.emission;
      result.radiance += path.throughput * (bsdf.emission + light_from_centres(context, point, bsdf, sampler));

      const auto next = bsdf.sample_delta(point.wo, sampler.next_1d());
      if (!next || !advance(path.state, next->flags, limits_)) break;
      path.throughput *= next->value / next->pdf_dir * bsdf.delta_probability();
      if (is_black(path.throughput)) break;
      if (next->flags & kTransparent) {
        path.pass(point, bsdf, *next, hit->t);
        continue;
      }
      path.seen_from_camera = false;
      path.travelled += hit->t;
      path.ray = ray_from(point, next->wi);
    }
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
      [](const Parameters& p) -> std::unique_ptr<Integrator> { return std::make_unique<WhittedIntegrator>(p); },
      /*bakes=*/false,
      /*kept_version=*/0,
      /*kept_by_place=*/false,
      kCarriesAbsorption | kCarriesPortals | kCarriesStrands};
  return descriptor;
}

}  // namespace gi
