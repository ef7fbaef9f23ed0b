// Distribution ray tracing [Cook, Porter & Carpenter 1984]: soft shadows from lights of a size, blurred reflection and
// refraction, depth of field. Light that rough surfaces send to one another is left out.
#include "integrators/integrator.h"
#include "transport/direct_light.h"
#include "transport/first_hit.h"

namespace gi {
namespace {

constexpr uint32_t kPairsPerBounce = 8;

class DistributedIntegrator final : public Integrator {
 public:
  explicit DistributedIntegrator(const Parameters& p)
      : limits_{p.integer("max_bounces"), 0, p.integer("glossy_bounces"), p.integer("transmission_bounces"),
                p.integer("transparent_bounces")} {}

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
    RayOrigin origin;
    Rgb throughput(1.0f);
    bool seen_from_camera = true;

    for (uint32_t bounce = 0;; ++bounce) {
      sampler.jump_to((bounce + 1) * kPairsPerBounce);
      const uint32_t visibility = visibility_of(path.kind);
      const auto hit = context.scene.intersect(ray, visibility);
      result.radiance += throughput * lamps_along(context, ray, hit ? hit->t : kInf, origin, LightSampling::kMis, visibility);
      if (!hit) {
        if (seen_from_camera && film.transparent) {
          result.alpha -= average(throughput);
          break;
        }
        const Rgb beyond = throughput * light_beyond(context, ray, origin, LightSampling::kMis, path);
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

      // Direct light: the surface's own, and one light's, weighed against the ray that follows.
      const Rgb emitted = throughput * surface_emission(context, point, bsdf, origin, LightSampling::kMis, hit->t);
      if (path.depth == 0) result.emission += emitted;
      const float u_choice = sampler.next_1d();
      const Vec2 u_light = sampler.next_2d();
      result.radiance += emitted + throughput * sample_direct_light(context, point, bsdf, LightSampling::kMis, u_choice, u_light);

      // A ray drawn from a diffuse lobe only completes the estimate of direct light: it ends at the first surface.
      const Vec2 u = sampler.next_2d();
      const float u_lobe = sampler.next_1d();
      const auto next = bsdf.sample(point.wo, u, u_lobe);
      if (!next || !(next->pdf_dir > 0.0f)) break;
      throughput *= next->value / next->pdf_dir;
      if (is_black(throughput)) break;
      const Ray onward{offset_point(point.position, point.ng, next->wi), next->wi, 0.0f, kInf};
      const bool diffuse = next->flags & kDiffuse;
      const bool within = advance(path, next->flags, limits_);
      if (next->flags & kTransparent) {
        if (!within) break;
        origin.query.path = path;
      } else {
        seen_from_camera = false;
        origin = {light_query(point, bsdf), next->flags & kSpecular ? kInf : next->pdf_dir};
      }
      if (diffuse) {
        result.radiance += throughput * direct_only(context, onward, origin, path);
        break;
      }
      if (!within) break;
      ray = onward;
    }
    return result;
  }

  // Luminaires that a last ray meets.
  static Rgb direct_only(const RenderContext& context, const Ray& ray, const RayOrigin& origin, const PathState& path) {
    static thread_local Bsdf bsdf;
    const uint32_t visibility = visibility_of(path.kind);
    const auto hit = context.scene.intersect(ray, visibility);
    Rgb sum = lamps_along(context, ray, hit ? hit->t : kInf, origin, LightSampling::kMis, visibility);
    if (!hit) return sum + light_beyond(context, ray, origin, LightSampling::kMis, path);
    ShadingPoint point = context.scene.shading_point(ray, *hit, path);
    context.scene.shade(point, bsdf);
    return sum + surface_emission(context, point, bsdf, origin, LightSampling::kMis, hit->t);
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
      [](const Parameters& p) -> std::unique_ptr<Integrator> { return std::make_unique<DistributedIntegrator>(p); }};
  return descriptor;
}

}  // namespace gi
