// Irradiance caching [Ward 1988]: light from one diffuse surface to another is worked out at few places and interpolated between them
// [Ward & Heckbert 1992]. Everything else is path traced, and what paths meet behind mirrors and glass uses the cache too.
#include "integrators/integrator.h"
#include "transport/camera_path.h"
#include "transport/irradiance_records.h"

namespace gi {
namespace {

constexpr LightSampling kMode = LightSampling::kMis;
constexpr float kDiffuseShare = 0.1f;  // times as often as otherwise diffuse lobes are sampled that are cached: for luminaires alone
constexpr uint8_t kDiffuseLobes = kReflection | kTransmission | kDiffuse;

// A path under way. What it finds of luminaires and what of anything else may count differently: luminaires are sampled at every
// surface, also where all other light came from the cache. Of luminaires that it finds by way of mirrors and clear glass, the cache
// has what does not exceed a limit: the rest, which would leave bright spots around records, counts where it is found. So it is with the
// sky: the cache has what does not exceed a limit, and only the rest is sampled at every surface.
struct Walk {
  CameraPath path;            // its throughput is for all but luminaires
  Rgb to_luminaires{1.0f};
  Rgb to_known_sky{};         // the part of that whose sky the cache has; negative: brings it there
  Rgb to_excess{};            // of that rest; negative: leaves it out
  Rgb mirrors{1.0f};          // throughput of the mirrors since the last other surface
  bool by_mirror = false;     // there are some
  float first_distance = kInf;
  uint32_t bounce = 0;
  bool may_scatter = true;   // false past the last bounce: it may still meet a luminaire
  bool may_branch = false;   // where it first scatters
  float least_pdf = kInf;    // of the directions that it took
  float parts = 1.0f;        // of a path that it is one of

  void share(int branches) {
    const float part = 1.0f / float(branches);
    path.throughput *= part, to_luminaires *= part, to_known_sky *= part, to_excess *= part, parts *= float(branches);
  }
  bool is_over() const { return is_black(to_luminaires) && is_black(to_known_sky) && is_black(to_excess); }
};

// Where a path has arrived, and what of its light is known.
struct Arrival {
  const ShadingPoint& point;
  const Bsdf& bsdf;
  const LightQuery& query;
  float distance;  // since the last surface
  bool is_cached, may_mirror;
};

class IrradianceCacheIntegrator final : public Integrator {
 public:
  explicit IrradianceCacheIntegrator(const Parameters& p)
      : limits_{p.integer("max_bounces"), p.integer("diffuse_bounces"), p.integer("glossy_bounces"), p.integer("transmission_bounces"),
                p.integer("transparent_bounces")},
        clamp_direct_(p.real("clamp_direct")),
        clamp_indirect_(p.real("clamp_indirect")),
        no_caustics_(no_caustics(p)),
        filter_glossy_(p.real("filter_glossy")),
        cached_caustics_(p.real("cached_caustics")),
        cached_sky_(p.real("cached_sky")),
        branches_(p.integer("branches")),
        records_({p.real("error"),
                  p.integer("record_samples"),
                  p.integer("cached_bounces"),
                  p.real("refinement"),
                  p.real("smoothing"),
                  {p.real("min_spacing"), p.real("max_spacing"), p.real("min_length"), p.real("max_length")},
                  limits_}) {}

  void prepare(const RenderContext& context) override {
    known_sky_ = cached_sky_ * context.lights.world_radiance();
    sky_share_ = context.lights.world_share_above(known_sky_);
  }
  void render_pass(const RenderContext& context, int pass, Film& film) override {
    records_.before_pass(context, film, pass, [&](const CameraRay& from, const PathState& state, Sampler& sampler) -> GatheredRay {
      // Luminaires are sampled where the record is used. Of deeper records many are averaged: bright spots do no harm there.
      Walk walk{CameraPath(from), Rgb(), Rgb(-1.0f), records_.level_of(state) == 1 ? Rgb(-1.0f) : Rgb()};
      walk.path.state = state;
      walk.path.state.without = no_caustics_;
      walk.path.seen_from_camera = false;
      PixelSample found;
      trace(context, film, from, walk, sampler, found);
      return {found.radiance, walk.first_distance};
    });
    if (context.cancelled) return;
    for_each_pixel(context, pass, film, [&](const CameraRay& camera, Sampler& sampler, PixelSample& result) {
      Walk walk{CameraPath(camera)};
      walk.may_branch = true;
      trace(context, film, camera, walk, sampler, result);
    });
  }
  void finish_pass(const RenderContext& context, int pass) override { records_.after_pass(context, pass); }

  void take_over(const Kept& kept) override { records_.take_over(kept); }
  Kept keep() const override { return records_.keep(); }
  void continue_from(Integrator& earlier) override { records_.continue_from(static_cast<IrradianceCacheIntegrator&>(earlier).records_); }

 private:
  void trace(const RenderContext& context, const Film& film, const CameraRay& camera, Walk& walk, Sampler& sampler,
             PixelSample& result) const;
  void branch_off(const RenderContext& context, const Film& film, const CameraRay& camera, const Arrival& from, Walk walk,
                  const Sampler& sampler, PixelSample& result) const;
  // Draws a direction and sets off. False: the path ends.
  bool scatter(const Film& film, const Arrival& from, Vec2 u, float u_lobe, Walk& walk, Sampler& sampler) const;

  BounceLimits limits_;
  float clamp_direct_, clamp_indirect_;
  uint8_t no_caustics_;  // CausticFlags of what is left out
  float filter_glossy_;
  float cached_caustics_;  // radiance
  float cached_sky_;       // times the sky's mean
  int branches_;
  float known_sky_ = 0;    // radiance
  float sky_share_ = 1;    // of the sky's light, what exceeds that
  IrradianceRecords records_;
};

void IrradianceCacheIntegrator::trace(const RenderContext& context, const Film& film, const CameraRay& camera, Walk& walk, Sampler& sampler,
                                      PixelSample& result) const {
  Bsdf bsdf;
  CameraPath& path = walk.path;
  const auto add = [&](Rgb throughput, Rgb radiance, int depth) {
    if (is_black(radiance) || is_black(throughput)) return;
    result.radiance += clamp_contribution(throughput * radiance, depth > 1 ? clamp_indirect_ : clamp_direct_);
  };

  const auto add_luminaire = [&](Rgb radiance, int depth, Rgb known = {}) {
    add(Rgb(1.0f), walk.to_luminaires * radiance - known, depth);
    if (walk.by_mirror) add(walk.to_excess, positive(walk.mirrors * radiance - Rgb(cached_caustics_)), depth);
  };

  for (;; ++walk.bounce) {
    sampler.jump_to(walk.bounce + 1);
    const uint32_t visibility = visibility_of(path.state.kind);
    const int depth = path.state.depth;
    const auto hit = context.scene.intersect(path.ray, visibility);
    add_luminaire(lamps_along(context, path.ray, hit ? hit->t : kInf, path.origin, kMode, visibility), depth);
    const Rgb passed = passed_by_absorbers(context, path.ray, hit ? hit->t : kInf, path.state);
    path.throughput *= passed, walk.to_luminaires *= passed, walk.to_known_sky *= passed, walk.mirrors *= passed;
    if (!hit) {
      if (!path.seen_from_camera && walk.is_over()) break;
      const LightBeyond beyond = path.leave(context, film, kMode, result);
      add_luminaire(beyond, depth, walk.to_known_sky * min(beyond.world, Rgb(known_sky_)) * beyond.world_weight);
      break;
    }
    if (walk.bounce == 0) walk.first_distance = hit->t;
    const bool may_mirror = context.scene.material(context.scene.material_of(hit->instance, hit->triangle)).program.may_mirror();
    if (!walk.may_scatter || is_black(path.throughput)) {
      if (walk.is_over()) break;
      const bool goes_on = walk.may_scatter && may_mirror && !is_black(walk.to_excess);
      if (const auto emitted = goes_on ? std::nullopt : path.end(context, camera, *hit, kMode)) {
        add_luminaire(*emitted, depth);
        break;
      }
    }
    const ShadingPoint point = path.arrive(context, film, camera, *hit, bsdf, result);
    if (walk.least_pdf < filter_glossy_) bsdf.blur(0.5f * std::sqrt(1.0f - walk.least_pdf / filter_glossy_));

    const Rgb emitted = surface_emission(context, point, bsdf.emission, path.origin, kMode);
    if (depth == 0) result.emission += path.throughput * emitted;
    add_luminaire(emitted, depth);

    // Luminaires are sampled here; other light of the diffuse lobes is looked up.
    const float u_light_choice = sampler.next_1d(), u_lobe = sampler.next_1d();
    const Vec2 u_light = sampler.next_2d(), u = sampler.next_2d();
    LightQuery query = light_query(point, bsdf);
    bool is_cached = false;
    if (walk.may_scatter && !is_black(path.throughput)) {
      if ((bsdf.flags() & kDiffuse) && point.strand == kNoId) {
        const auto radiance = records_.read(point, bsdf, result);
        if (radiance) result.radiance += path.throughput * *radiance;
        is_cached = bool(radiance);
        if (is_cached && (bsdf.flags() & (kGlossy | kSpecular))) bsdf.favour(kDiffuse, kDiffuseShare);
      }
      if (is_cached && !(bsdf.flags() & kGlossy)) query.world_share = sky_share_;
      const auto scattered = [&](const LightSample& light, const LobeEval& e) {
        const bool is_known = is_cached && context.lights.is_world(light.light);
        const Rgb known = is_known ? bsdf.eval(point.wo, light.wi, kDiffuseLobes).value : Rgb();
        return e.value * light.radiance - known * min(light.radiance, Rgb(known_sky_));
      };
      const auto pdf_of = [](Vec3, const LobeEval& e) { return e.pdf_dir; };
      add(path.throughput, sample_direct_light(context, query, point, bsdf, kMode, u_light_choice, u_light, pdf_of, scattered), depth + 1);
    }

    // Go on; where light is not known, as on metal, in several directions: elsewhere there is hardly any noise.
    const Arrival here{point, bsdf, query, hit->t, is_cached, may_mirror};
    if (walk.may_branch && walk.may_scatter && !bsdf.is_delta() && !(bsdf.flags() & kTransparent)) {
      walk.may_branch = false;
      if (!is_cached) {
        ++walk.bounce;
        branch_off(context, film, camera, here, walk, sampler, result);
        break;
      }
    }
    if (!scatter(film, here, u, u_lobe, walk, sampler)) break;
  }
}

void IrradianceCacheIntegrator::branch_off(const RenderContext& context, const Film& film, const CameraRay& camera, const Arrival& from,
                                           Walk walk, const Sampler& sampler, PixelSample& result) const {
  walk.share(branches_);
  for (int k = 0; k < branches_; ++k) {
    Walk branch = walk;
    Sampler own = sampler.branch(uint32_t(k), uint32_t(branches_));
    own.jump_to(walk.bounce);
    const Vec2 u = own.next_2d();
    if (!scatter(film, from, u, own.next_1d(), branch, own)) continue;
    trace(context, film, camera, branch, own, result);
  }
}

bool IrradianceCacheIntegrator::scatter(const Film& film, const Arrival& from, Vec2 u, float u_lobe, Walk& walk, Sampler& sampler) const {
  const auto& [point, bsdf, query, distance, is_cached, may_mirror] = from;
  CameraPath& path = walk.path;
  const auto next = bsdf.sample(point.wo, u, u_lobe);
  if (!next || !(next->pdf_dir > 0.0f)) return false;
  const bool transparent = next->flags & kTransparent;
  if (!walk.may_scatter && !transparent) return false;
  if (transparent) {
    const Rgb weight = next->value / next->pdf_dir;
    path.throughput *= weight, walk.to_luminaires *= weight, walk.to_known_sky *= weight, walk.to_excess *= weight;
    if (!advance(path.state, next->flags, limits_)) return false;
    path.pass(point, bsdf, *next, distance);
    return true;
  }
  path.travelled += distance;

  // Follow it: to luminaires by all lobes, to all else by those that are not in the cache.
  const bool delta = next->flags & kSpecular;
  const Rgb weight = next->value / next->pdf_dir;
  walk.to_luminaires = path.throughput * weight;
  walk.to_known_sky = Rgb();
  if (delta) {
    walk.mirrors *= weight;
    walk.to_excess = may_mirror ? walk.to_excess : Rgb();
    path.throughput *= weight;
  } else {
    const Rgb known = is_cached ? bsdf.eval(point.wo, next->wi, kDiffuseLobes).value / next->pdf_dir : Rgb();
    walk.to_known_sky = path.throughput * known;
    walk.mirrors = Rgb(1.0f);
    walk.to_excess = records_.level_of(point.path) == 0 ? path.throughput * known : Rgb();
    path.throughput *= positive(weight - known);
  }
  walk.by_mirror = delta;
  if (walk.is_over()) return false;
  walk.may_scatter = advance(path.state, next->flags, limits_);
  const FilmSpec& spec = film.spec();
  if (!(spec.transparent_glass && (next->flags & kTransmission) && next->roughness <= spec.transparent_roughness))
    path.seen_from_camera = false;
  path.state.without = next->flags & kDiffuse ? no_caustics_ : 0;
  path.origin = {query, delta ? kInf : next->pdf_dir};
  if (!delta) walk.least_pdf = std::min(walk.least_pdf, next->pdf_dir);
  path.ray = ray_from(point, next->wi);

  // Russian roulette for all but luminaires, which the next ray meets anyway; of a branch as of the whole path.
  const float alpha = std::min(1.0f, std::sqrt(walk.parts * max_component(max(path.throughput, abs(walk.to_excess)))));
  if (alpha < 1.0f) {
    const float kept = sampler.next_1d() < alpha ? 1.0f / alpha : 0.0f;
    path.throughput *= kept, walk.to_excess *= kept;
  }
  return true;
}

}  // namespace

const Descriptor& irradiance_cache_descriptor() {
  using Kind = Parameter::Kind;
  static const Descriptor descriptor{
      "irradiance_cache",
      "Irradiance Caching",
      "Light between diffuse surfaces is worked out at few places and interpolated: smooth interiors soon. Biased by the error allowed; "
      "rough diffuse surfaces are read as if light came to them evenly",
      {
          {"error", "Error", Kind::kFloat, 0.15, 0.01, 1,
           "Allowed between records: less has more of them, shows finer changes of light and takes longer"},
          {"record_samples", "Samples", Kind::kInt, 128, 16, 1 << 20,
           "Rays of each record to begin with: some over all of the hemisphere, more where those found light. Refining adds as many as the "
           "latter"},
          {"refinement", "Refinement", Kind::kFloat, 0.25, 0, 0.95,
           "Share of the passes' time in which records get more rays: blotches fade as noise does. 0 leaves them as they were first"},
          {"smoothing", "Smoothing", Kind::kFloat, 3, 0, 10,
           "Evens out neighbouring records as far as their noise hides the difference: so many standard deviations. 0 leaves blotches"},
          {"cached_bounces", "Cached Bounces", Kind::kInt, 4, 1, IrradianceRecords::kMostLevels,
           "Diffuse bounces that have records; further ones are path traced"},
          {"cached_caustics", "Cached Caustics", Kind::kFloat, 10, 0, 1e9,
           "Radiance up to which what mirrors and glass throw is cached; what exceeds it is path traced: grain instead of bright spots"},
          {"cached_sky", "Cached Sky", Kind::kFloat, 4, 0, 1e9,
           "Radiance up to which light of the sky is cached, times the mean of the sky; what exceeds it, as the sun does, is sampled "
           "directly "
           "at every surface. 0 samples all of it directly: sharper, but grain in rooms"},
          {"branches", "Branches", Kind::kInt, 4, 1, 64,
           "Directions in which a path goes on from the first surface whose light is not cached, such as metal: most noise is there"},
          {"min_spacing", "Minimum Spacing", Kind::kFloat, 1.5, 0, 1e4,
           "For which a record holds at least: more is smoother where objects meet, and less true there", "px"},
          {"max_spacing", "Maximum Spacing", Kind::kFloat, 40, 1, 1e6,
           "For which a record holds at most: less shows finer changes of light on plain walls, and takes longer", "px"},
          {"min_length", "Minimum Distance", Kind::kFloat, 0, 0, 1e6, "The same as a length", "LENGTH"},
          {"max_length", "Maximum Distance", Kind::kFloat, 0, 0, 1e6, "The same as a length; 0 is off", "LENGTH"},
          {"max_bounces", "Total", Kind::kInt, 12, 0, 1024, "Bounces of any kind"},
          {"diffuse_bounces", "Diffuse", Kind::kInt, 4, 0, 1024, "Diffuse reflections"},
          {"glossy_bounces", "Glossy", Kind::kInt, 4, 0, 1024, "Glossy and mirror reflections"},
          {"transmission_bounces", "Transmission", Kind::kInt, 12, 0, 1024, "Refractions"},
          {"transparent_bounces", "Transparent", Kind::kInt, 8, 0, 1024, "Transparent surfaces passed by one ray"},
          {"clamp_direct", "Clamp Direct", Kind::kFloat, 0, 0, 1e9,
           "Largest radiance that one sample may add directly; 0 is off. Loses light"},
          {"clamp_indirect", "Clamp Indirect", Kind::kFloat, 0, 0, 1e9,
           "Largest radiance that one sample may add after a bounce; 0 is off. Loses light"},
          {"caustics_reflective", "Reflective Caustics", Kind::kBool, 1, 0, 1, "Mirrors and glossy surfaces seen by diffuse ones"},
          {"caustics_refractive", "Refractive Caustics", Kind::kBool, 1, 0, 1, "Glass seen by diffuse surfaces"},
          {"filter_glossy", "Filter Glossy", Kind::kFloat, 0, 0, 100,
           "Makes glossy surfaces rougher where unlikely paths see them: less noise, blurred caustics. 0 is off"},
      },
      [](const Parameters& p) -> std::unique_ptr<Integrator> { return std::make_unique<IrradianceCacheIntegrator>(p); },
      /*bakes=*/false,
      /*kept_version=*/5,
      /*kept_by_place=*/true,
      kCarriesAbsorption | kCarriesPortals | kCarriesStrands};
  return descriptor;
}

}  // namespace gi
