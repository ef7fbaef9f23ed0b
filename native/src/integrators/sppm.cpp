// Stochastic progressive photon mapping: every pass sends out photons of its own, and eye paths read them where they meet diffuse surfaces,
// within a radius that shrinks from pass to pass [Hachisuka & Jensen 2009]; all pixels' alike, so that passes do not depend on each other
// [Knaus & Zwicker 2011]. Noise and blur both vanish in the end.
#include "integrators/integrator.h"
#include "transport/diffuse_end.h"
#include "transport/photon_map.h"

namespace gi {
namespace {

class SppmIntegrator final : public Integrator {
 public:
  explicit SppmIntegrator(const Parameters& p) : photons_(p.integer("photons")), radius_(p.real("radius")), alpha_(p.number("alpha")) {
    s_.limits = {p.integer("max_bounces"), p.integer("diffuse_bounces"), p.integer("glossy_bounces"), p.integer("transmission_bounces"),
                 p.integer("transparent_bounces")};
    s_.without = no_caustics(p);
  }

  void render_pass(const RenderContext& context, int pass, Film& film) override {
    const FilmSpec& spec = film.spec();
    SubpathSettings light;
    light.limits = s_.limits, light.without = s_.without, light.footprint = {context.camera, spec.width, spec.height}, light.weighs = false;
    if (guide_is_old_) {
      guide_ = learn_emission(context, light, photons_, kCausticPhoton | kGlobalPhoton,
                              find_ends(context, film, s_.limits, false, kLooksAcross));
      guide_is_old_ = context.cancelled;
    }
    light.guide = &guide_;
    sent_.clear();
    trace_photons(context, light, pass, photons_, kCausticPhoton | kGlobalPhoton, sent_);
    const PhotonMap map(sent_, photons_, context.pool);
    if (context.cancelled) return;
    const float scale = radius_ * float(std::sqrt(shrinking(pass, alpha_)));
    context.log.set("photons", double(map.size()));
    context.log.set("radius, pixels", double(scale));
    for_each_pixel(context, pass, film, [&](const CameraRay& camera, Sampler& sampler, PixelSample& result) {
      EndingPath ending{CameraPath(camera)};
      trace_to_diffuse(
          context, film, s_, camera, ending, sampler, result, [](const ShadingPoint&, const Bsdf&) { return Rgb(); },
          [&](const ShadingPoint& point, const Bsdf& bsdf, bool) {
            return std::optional(KnownLight{Rgb(), map.radiance(context.scene, point, bsdf, scale * point.footprint)});
          });
    });
  }

 private:
  int photons_;
  float radius_;
  double alpha_;
  DiffuseEndSettings s_;
  EmissionGuide guide_;
  bool guide_is_old_ = true;
  LargeVector<Photon> sent_;  // in this pass
};

}  // namespace

const Descriptor& sppm_descriptor() {
  using Kind = Parameter::Kind;
  static const Descriptor descriptor{
      "sppm",
      "Progressive Photon Mapping",
      "Photons of every pass are read within a radius that shrinks: caustics, also those seen in mirrors and through glass. Blurred at "
      "first, "
      "right in the end",
      {
          {"photons", "Photons", Kind::kInt, 200000, 1, 1e9,
           "Sent out in each pass: more make light smooth in fewer passes, which take longer"},
          {"radius", "Radius", Kind::kFloat, 6, 0.1, 1000,
           "Within which photons are read in the first pass: light is blurred by as much at first", "px"},
          {"alpha", "Alpha", Kind::kFloat, 0.6667, 0.05, 1,
           "How much of a disc's photons the next pass keeps: less is sharper and noisier"},
          {"max_bounces", "Total", Kind::kInt, 12, 0, 1024, "Bounces of any kind"},
          {"diffuse_bounces", "Diffuse", Kind::kInt, 4, 0, 1024, "Diffuse reflections"},
          {"glossy_bounces", "Glossy", Kind::kInt, 4, 0, 1024, "Glossy and mirror reflections"},
          {"transmission_bounces", "Transmission", Kind::kInt, 12, 0, 1024, "Refractions"},
          {"transparent_bounces", "Transparent", Kind::kInt, 8, 0, 1024, "Transparent surfaces passed by one ray"},
          {"caustics_reflective", "Reflective Caustics", Kind::kBool, 1, 0, 1, "Mirrors and glossy surfaces seen by diffuse ones"},
          {"caustics_refractive", "Refractive Caustics", Kind::kBool, 1, 0, 1, "Glass seen by diffuse surfaces"},
      },
      [](const Parameters& p) -> std::unique_ptr<Integrator> { return std::make_unique<SppmIntegrator>(p); }};
  return descriptor;
}

}  // namespace gi
