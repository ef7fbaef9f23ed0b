// Light tracing, the adjoint of path tracing: particles from the luminaires are joined to the lens at every surface they meet
// [Arvo 1986; Dutre 1993]. A reference: what stands between two perfect mirrors' images, the lens and the lights, it does not find.
#include "integrators/integrator.h"
#include "transport/camera_path.h"
#include "transport/light_path.h"
#include "transport/subpath.h"

namespace gi {
namespace {

class LightIntegrator final : public Integrator {
 public:
  explicit LightIntegrator(const Parameters& p)
      : s_{{p.integer("max_bounces"), p.integer("diffuse_bounces"), p.integer("glossy_bounces"), p.integer("transmission_bounces"),
            p.integer("transparent_bounces")}},
        clamp_direct_(p.real("clamp_direct")),
        clamp_indirect_(p.real("clamp_indirect")) {}

  void render_pass(const RenderContext& context, int pass, Film& film) override {
    if (pass == 0) film.start_splats(splat_unit(context));
    s_.footprint = {context.camera, film.spec().width, film.spec().height};
    for_each_pixel(context, pass, film,
                   [&](const CameraRay& camera, Sampler& sampler, PixelSample& result) { look(context, film, camera, sampler, result); });
    const int count = film.spec().region_width() * film.spec().region_height();
    for_each_light_path(context, pass, count, [&](Sampler& sampler, uint32_t) { shine(context, film, count, sampler); });
    film.end_splats(!context.cancelled);
  }

 private:
  // What shines by itself, and the data passes.
  void look(const RenderContext& context, const Film& film, const CameraRay& camera, Sampler& sampler, PixelSample& result) const {
    Bsdf bsdf;
    CameraPath path(camera);
    for (uint32_t bounce = 0;; ++bounce) {
      sampler.jump_to(bounce + 1);
      const auto hit = context.scene.intersect(path.ray, kRayCamera);
      result.radiance +=
          path.throughput * lamps_along(context, path.ray, hit ? hit->t : kInf, path.origin, LightSampling::kOff, kRayCamera);
      path.absorb(context, hit ? hit->t : kInf);
      if (!hit) {
        result.radiance += path.throughput * path.leave(context, film, LightSampling::kOff, result);
        return;
      }
      const ShadingPoint point = path.arrive(context, film, camera, *hit, bsdf, result);
      result.radiance += path.throughput * bsdf.emission;
      result.emission += path.throughput * bsdf.emission;

      // Through what is transparent, and no further.
      const auto next = bsdf.sample(point.wo, sampler.next_2d(), sampler.next_1d());
      if (!next || !(next->flags & kTransparent) || !advance(path.state, next->flags, s_.limits)) return;
      path.throughput *= next->value / next->pdf_dir;
      path.pass(point, bsdf, *next, hit->t);
    }
  }

  // One particle, joined to the lens wherever it comes by.
  void shine(const RenderContext& context, Film& film, int count, Sampler& sampler) const {
    static thread_local LightVertices path;
    path.clear();
    trace_from_light(context, s_, sampler, path);
    const int pixels = film.spec().width * film.spec().height;
    for (size_t k = 0; k < path.count(); ++k) {
      const LightVertex& v = path[k];
      sampler.jump_to(uint32_t(k) + 1);
      sampler.next_2d(), sampler.next_2d();  // those the walk took
      const Vec2 u_lens = sampler.next_2d(), u_pixel = sampler.next_2d();
      const auto c = connect_to_lens(context, s_.limits, v, pixels, u_lens);
      if (!c) continue;
      const Rgb value = c->value * passage_to_lens(context, s_.limits, v, c->lens) / float(count);
      film.splat(c->lens.film, film_wraps(context.camera), clamp_contribution(value, v.is_first() ? clamp_direct_ : clamp_indirect_),
                 u_pixel);
    }
  }

  SubpathSettings s_;
  float clamp_direct_, clamp_indirect_;
};

}  // namespace

const Descriptor& light_descriptor() {
  using Kind = Parameter::Kind;
  static const Descriptor descriptor{
      "light",
      "Light Tracing",
      "Particles from the lights, joined to the lens where they meet a surface: a reference. Does not see through perfect mirrors and "
      "glass, "
      "nor lamps that throw no shadow and emitters that are not sampled",
      {
          {"max_bounces", "Total", Kind::kInt, 12, 0, 1024, "Bounces of any kind"},
          {"diffuse_bounces", "Diffuse", Kind::kInt, 4, 0, 1024, "Diffuse reflections"},
          {"glossy_bounces", "Glossy", Kind::kInt, 4, 0, 1024, "Glossy and mirror reflections"},
          {"transmission_bounces", "Transmission", Kind::kInt, 12, 0, 1024, "Refractions"},
          {"transparent_bounces", "Transparent", Kind::kInt, 8, 0, 1024, "Transparent surfaces passed by one ray"},
          {"clamp_direct", "Clamp Direct", Kind::kFloat, 0, 0, 1e9,
           "Largest radiance that one sample may add directly; 0 is off. Loses light"},
          {"clamp_indirect", "Clamp Indirect", Kind::kFloat, 0, 0, 1e9,
           "Largest radiance that one sample may add after a bounce; 0 is off. Loses light"},
      },
      [](const Parameters& p) -> std::unique_ptr<Integrator> { return std::make_unique<LightIntegrator>(p); }};
  return descriptor;
}

}  // namespace gi
