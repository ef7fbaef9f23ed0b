// Distribution ray tracing [Cook, Porter & Carpenter 1984]: soft shadows from lights of a size, blurred reflection and
// refraction, depth of field. Light that rough surfaces send to one another is left out.
#include "integrators/integrator.h"
#include "transport/camera_path.h"

namespace gi {
namespace {

class DistributedIntegrator final : public Integrator {
 public:
  explicit DistributedIntegrator(const Parameters& p)
      : limits_{p.integer("max_bounces"), 0, p.integer("glossy_bounces"), p.integer("transmission_bounces"),
                p.integer("transparent_bounces")} {}

  void render_pass(const RenderContext& context, int pass, Film& film) override {
    for_each_pixel(context, pass, film,
                   [&](const CameraRay& camera, Sampler& sampler, PixelSample& result) { trace(context, film, camera, sampler, result); });
  }

 private:
  void trace(const RenderContext& context, const Film& film, const CameraRay& camera, Sampler& sampler, PixelSample& result) const {
    constexpr LightSampling kMode = LightSampling::kMis;
    Bsdf bsdf;
    CameraPath path(camera);

    for (uint32_t bounce = 0;; ++bounce) {
      sampler.jump_to(bounce + 1);
      const uint32_t visibility = visibility_of(path.state.kind);
      const auto hit = context.scene.intersect(path.ray, visibility);
      result.radiance += path.throughput * lamps_along(context, path.ray, hit ? hit->t : kInf, path.origin, kMode, visibility);
      path.absorb(context, hit ? hit->t : kInf);
      if (!hit) {
        result.radiance += path.throughput * path.leave(context, film, kMode, result);
        break;
      }
      const ShadingPoint point = path.arrive(context, film, camera, *hit, bsdf, result);

      // Direct light: the surface's own, and one light's, weighed against the ray that follows.
      const Rgb emitted = surface_emission(context, point, bsdf.emission, path.origin, kMode);
      if (path.state.depth == 0) result.emission += path.throughput * emitted;
      const float u_choice = sampler.next_1d();
      const Vec2 u_light = sampler.next_2d();
      result.radiance += path.throughput * (emitted + sample_direct_light(context, point, bsdf, kMode, u_choice, u_light));

      // A ray drawn from a diffuse lobe only completes the estimate of direct light: it ends at the first surface.
      const float u_lobe = sampler.next_1d();
      const Vec2 u = sampler.next_2d();
      const auto next = bsdf.sample(point.wo, u, u_lobe);
      if (!next || !(next->pdf_dir > 0.0f)) break;
      path.throughput *= next->value / next->pdf_dir;
      if (is_black(path.throughput)) break;
      const bool within = advance(path.state, next->flags, limits_);
      if (next->flags & kTransparent) {
        if (!within) break;
        path.pass(point, bsdf, *next, hit->t);
        continue;
      }
      path.travelled += hit->t;
      path.ray = ray_from(point, next->wi);
      path.seen_from_camera = false;
      path.origin = {light_query(point, bsdf), next->flags & kSpecular ? kInf : next->pdf_dir};
      if (next->flags & kDiffuse) {
        result.radiance += path.throughput * direct_only(context, path);
        break;
      }
      if (!within) break;
    }
  }

  // Luminaires that a last ray meets.
  static Rgb direct_only(const RenderContext& context, const CameraPath& path) {
    const uint32_t visibility = visibility_of(path.state.kind);
    const auto hit = context.scene.intersect(path.ray, visibility);
    const Rgb lamps = lamps_along(context, path.ray, hit ? hit->t : kInf, path.origin, LightSampling::kMis, visibility);
    const Rgb passed = passed_by_absorbers(context, path.ray, hit ? hit->t : kInf, path.state);
    if (!hit) return lamps + passed * light_beyond(context, path.ray, path.origin, LightSampling::kMis, path.state);
    ShadingPoint point = context.scene.shading_point(path.ray, *hit, path.state);
    return lamps + passed * surface_emission(context, point, context.scene.emission(point), path.origin, LightSampling::kMis);
  }

  BounceLimits limits_;
};

}  // namespace

const Descriptor& distributed_descriptor() {
  using Kind = Parameter::Kind;
  static const Descriptor descriptor{
      "distributed",
      "Soft Shadows",
      "Distribution ray tracing: soft shadows and blurred reflections, no light from one rough surface to another",
      {
          {"max_bounces", "Total", Kind::kInt, 12, 0, 1024, "Reflections and refractions in a row"},
          {"glossy_bounces", "Glossy", Kind::kInt, 4, 0, 1024, "Glossy and mirror reflections"},
          {"transmission_bounces", "Transmission", Kind::kInt, 12, 0, 1024, "Refractions"},
          {"transparent_bounces", "Transparent", Kind::kInt, 8, 0, 1024, "Transparent surfaces passed by one ray"},
      },
      [](const Parameters& p) -> std::unique_ptr<Integrator> { return std::make_unique<DistributedIntegrator>(p); },
      /*bakes=*/false,
      /*kept_version=*/0,
      /*kept_by_place=*/false,
      kCarriesAbsorption | kCarriesPortals | kCarriesStrands};
  return descriptor;
}

}  // namespace gi
