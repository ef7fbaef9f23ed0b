// Path tracing [Kajiya 1986] with Russian roulette and multiple importance sampling [Veach 1997].
// Each bounce: continue with probability α; draw ω from P; weigh by ρbd cos θ / (P(ω) α); add Le where a luminaire is met.
#include "integrators/integrator.h"
#include "transport/camera_path.h"
#include "transport/subsurface.h"

namespace gi {
namespace {

enum class DirectionSampling { kUniform, kCosine, kBsdf };
enum class Continuation { kAlbedo, kThroughput, kConstant };

constexpr uint32_t kWithin = 0x3ed1u;  // and of ways through media
constexpr uint32_t kBelow = 0x50b5u;  // random numbers of walks below surfaces

struct PathSettings {
  LightSampling light_sampling;
  DirectionSampling direction_sampling;
  Continuation continuation;
  float constant;
  int min_bounces;
  BounceLimits limits;
  float clamp_direct, clamp_indirect;
  uint8_t without;  // CausticFlags: what diffuse surfaces do not see
  float filter_glossy;
};

// Density of P towards `wi` about the shading normal, for the ways of drawing that know nothing of the BSDF.
float pdf_direction(const Bsdf& bsdf, const ShadingPoint& point, DirectionSampling mode, Vec3 wi) {
  const bool both_sides = bsdf.flags() & kTransmission;
  const float cosine = dot(point.ns, wi);
  if (cosine < 0.0f && !both_sides) return 0.0f;
  const float pdf = mode == DirectionSampling::kUniform ? 0.5f * kInvPi : std::abs(cosine) * kInvPi;
  return pdf * (both_sides ? 0.5f : 1.0f) * (1.0f - bsdf.delta_probability());
}

// The direction of the next ray from P(ω). Uniform and cosine replace what the BSDF would draw, except for delta lobes,
// which nothing else can hit.
std::optional<BsdfSample> sample_direction(const Bsdf& bsdf, const ShadingPoint& point, DirectionSampling mode, Vec2 u, float u_lobe) {
  if (mode == DirectionSampling::kBsdf) return bsdf.sample(point.wo, u, u_lobe);
  const float p_delta = bsdf.delta_probability();
  if (u_lobe < p_delta) return bsdf.sample_delta(point.wo, u_lobe / p_delta);
  const bool below = (bsdf.flags() & kTransmission) && (u_lobe - p_delta) < 0.5f * (1.0f - p_delta);
  const Vec3 local = mode == DirectionSampling::kUniform ? sample_uniform_hemisphere(u) : sample_cosine_hemisphere(u);
  const Vec3 wi = Frame::from_normal(below ? -point.ns : point.ns).to_world(local);
  const LobeEval e = bsdf.eval(point.wo, wi);
  const float pdf = pdf_direction(bsdf, point, mode, wi);
  if (!(pdf > 0.0f) || is_black(e.value)) return {};
  const uint8_t kind = bsdf.flags() & kDiffuse ? kDiffuse : kGlossy;
  return BsdfSample{wi, e.value, pdf, uint8_t((below ? kTransmission : kReflection) | kind), 1.0f};
}

float continuation_probability(const PathSettings& s, const PathState& path, Rgb throughput, Rgb weight) {
  if (path.depth <= s.min_bounces) return 1.0f;
  switch (s.continuation) {
    case Continuation::kAlbedo: return std::min(1.0f, max_component(weight));
    case Continuation::kConstant: return s.constant;
    case Continuation::kThroughput: break;
  }
  return std::min(1.0f, std::sqrt(max_component(throughput)));
}

class PathIntegrator final : public Integrator {
 public:
  explicit PathIntegrator(const Parameters& p)
      : s_{LightSampling(p.integer("light_sampling")),
           DirectionSampling(p.integer("direction_sampling")),
           Continuation(p.integer("continuation")),
           p.real("continuation_constant"),
           p.integer("min_bounces"),
           {p.integer("max_bounces"), p.integer("diffuse_bounces"), p.integer("glossy_bounces"), p.integer("transmission_bounces"),
            p.integer("transparent_bounces"), p.integer("volume_bounces")},
           p.real("clamp_direct"),
           p.real("clamp_indirect"),
           no_caustics(p),
           p.real("filter_glossy")} {}

  void render_pass(const RenderContext& context, int pass, Film& film) override {
    for_each_pixel(context, pass, film,
                   [&](const CameraRay& camera, Sampler& sampler, PixelSample& result) { trace(context, film, camera, sampler, result); });
  }

 private:
  enum class MediumStep { kPasses, kScatters, kEnds };

  // The way to the surface at `t_surface`, through what fills the place: what that emits, lamps seen through it, and maybe a scattering,
  // from which the path goes on.
  template <class Add>
  MediumStep go_through(const RenderContext& context, const Surroundings& around, CameraPath& path, float t_surface, LightSampling mode,
                        uint32_t visibility, bool& may_scatter, const Add& add) const {
    const Scene& scene = context.scene;
    const auto& [media, random] = around;
    const Vec3 wo = -path.ray.direction;
    const auto passed = [&](float t) { return media.transmittance(scene, path.ray, t, path.state, random); };
    add(lamps_along(context, path.ray, t_surface, path.origin, mode, visibility, passed), path.state.depth);
    const MediumEvent event = media.sample(scene, path.ray, t_surface, path.throughput, may_scatter, path.state, random);
    add(event.emitted, path.state.depth);
    path.throughput *= event.weight;
    if (is_black(path.throughput)) return MediumStep::kEnds;
    if (!event.scattered) return MediumStep::kPasses;

    // Scattered: lights first, then the next direction.
    const Vec3 position = path.ray.origin + path.ray.direction * event.t;
    path.travelled += event.t, path.seen_from_camera = false;
    path.state.ray_length = event.t;
    const LightQuery query{position, Vec3{}, true, path.state};
    const float u_choice = random.next_1d(), u_lobe = random.next_1d();
    const Vec2 u_light = random.next_2d(), u = random.next_2d();
    add(sample_light_in_medium(context, event.medium, around, query, wo, mode, u_choice, u_light), path.state.depth + 1);
    const auto next = event.medium.sample(wo, u, u_lobe);
    if (!next || !(next->pdf_dir > 0.0f)) return MediumStep::kEnds;
    const Rgb weight = next->value / next->pdf_dir;
    path.throughput *= weight;
    may_scatter = advance_in_medium(path.state, s_.limits);
    path.origin = {query, next->pdf_dir};
    path.ray = {position, next->wi, 0.0f, kInf};
    const float alpha = continuation_probability(s_, path.state, path.throughput, Rgb(1.0f));
    if (alpha < 1.0f) {
      if (random.next_1d() >= alpha) return MediumStep::kEnds;
      path.throughput *= 1.0f / alpha;
    }
    return MediumStep::kScatters;
  }

  void trace(const RenderContext& context, const Film& film, const CameraRay& camera, Sampler& sampler, PixelSample& result) const {
    const LightSampling mode = s_.light_sampling;
    Bsdf bsdf;
    bsdf.carry_subsurface(!context.lightmap);
    CameraPath path(camera);
    static const Volumes kNone;
    const bool has_media = !context.volumes.empty() && !context.lightmap;
    Media media(has_media ? context.volumes : kNone);  // that the path is in
    if (has_media) media.begin_at(context.scene, path.ray.origin);
    Sampler within;
    const Surroundings around{media, within};
    bool may_scatter = true;  // false past the bounce limit: the next surface only emits

    const int first_depth = context.lightmap ? context.lightmap->first_depth() : 0;
    const auto add = [&](Rgb radiance, int depth) {
      if (is_black(radiance) || depth < first_depth) return;
      result.radiance += clamp_contribution(path.throughput * radiance, depth > 1 ? s_.clamp_indirect : s_.clamp_direct);
    };

    for (uint32_t bounce = 0;; ++bounce) {
      sampler.jump_to(bounce + 1);
      const uint32_t visibility = visibility_of(path.state.kind);
      const auto hit = context.scene.intersect(path.ray, visibility);

      // Lamps do not block the ray.
      if (has_media) within = sampler.fork(bounce + kWithin);
      if (!media.empty()) {
        const MediumStep step = go_through(context, around, path, hit ? hit->t : path.ray.t_max, mode, visibility, may_scatter, add);
        if (step == MediumStep::kEnds) break;
        if (step == MediumStep::kScatters) continue;
      } else {
        const auto all = [](float) { return Rgb(1.0f); };
        add(lamps_along(context, path.ray, hit ? hit->t : kInf, path.origin, mode, visibility, all), path.state.depth);
      }
      if (!hit) {
        add(path.leave(context, film, mode, result), path.state.depth);
        break;
      }

      if (!may_scatter) {
        if (const auto emitted = path.end(context, camera, *hit, mode)) {
          add(*emitted, path.state.depth);
          break;
        }
      }

      ShadingPoint point = path.arrive(context, film, camera, *hit, bsdf, result);
      // The less likely the path, the less sharp what it sees: as Blender's Filter Glossy does it.
      if (path.state.least_pdf < s_.filter_glossy) bsdf.blur(0.5f * std::sqrt(1.0f - path.state.least_pdf / s_.filter_glossy));

      // Add what the surface emits, then what lights send to it.
      const Rgb emitted = surface_emission(context, point, bsdf.emission, path.origin, mode);
      if (path.state.depth == 0) result.emission += path.throughput * emitted;
      add(emitted, path.state.depth);
      const float u_light_choice = sampler.next_1d(), u_lobe = sampler.next_1d();
      const Vec2 u_light = sampler.next_2d(), u = sampler.next_2d();
      const auto pdf_of = [&](Vec3 wi, const LobeEval& e) {
        return s_.direction_sampling == DirectionSampling::kBsdf ? e.pdf_dir : pdf_direction(bsdf, point, s_.direction_sampling, wi);
      };
      if (may_scatter) {
        add(sample_direct_light(context, point, bsdf, mode, u_light_choice, u_light, pdf_of, &around), path.state.depth + 1);
      }

      // Draw the next direction.
      auto next = sample_direction(bsdf, point, s_.direction_sampling, u, u_lobe);
      if (!next || !(next->pdf_dir > 0.0f)) break;
      const bool transparent = next->flags & kTransparent;
      if (!may_scatter && !transparent) break;
      Rgb weight = next->value / next->pdf_dir;
      path.throughput *= weight;
      if (is_black(path.throughput)) break;

      // Light that goes below the surface comes out elsewhere, diffusely: that is where lights are looked for, and the next direction.
      if (next->flags & kSubsurface) {
        Sampler below = sampler.fork(bounce + kBelow);
        const auto exit = scatter_below(context.scene, point, bsdf.subsurface(next->which), below.fork(kBelow));
        if (!exit) break;
        path.throughput *= exit->weight;
        weight *= exit->weight;
        point = exit->point;
        set_exit(*exit, bsdf);
        const float u_choice = below.next_1d(), u_exit = below.next_1d();
        const Vec2 u_to_light = below.next_2d(), u_out = below.next_2d();
        add(sample_direct_light(context, point, bsdf, mode, u_choice, u_to_light, pdf_of, &around), path.state.depth + 1);
        next = sample_direction(bsdf, point, s_.direction_sampling, u_out, u_exit);
        if (!next || !(next->pdf_dir > 0.0f)) break;
        path.throughput *= next->value / next->pdf_dir;
      }

      // Follow it. A transparent surface changes nothing but the throughput: the ray goes on as the one it was.
      if (has_media && (next->flags & (kTransparent | kTransmission)))
        media.cross(context.scene, point, transparent ? -point.wo : next->wi);
      if (transparent) {
        const bool is_there = !context.scene.material(context.scene.material_of(point.instance, point.triangle)).only_volume;
        if (is_there && !advance(path.state, next->flags, s_.limits)) break;
        path.pass(point, bsdf, *next, hit->t);
        continue;
      }
      path.travelled += hit->t;
      const float least_pdf = path.state.least_pdf;
      may_scatter = advance(path.state, next->flags, s_.limits);
      const FilmSpec& spec = film.spec();
      const bool through_glass = spec.transparent_glass && (next->flags & kTransmission) && next->roughness <= spec.transparent_roughness;
      if (!through_glass) path.seen_from_camera = false;
      path.state.without = next->flags & kDiffuse ? s_.without : 0;
      const bool delta = next->flags & kSpecular;
      path.origin = {light_query(point, bsdf), delta ? kInf : next->pdf_dir};
      path.state.least_pdf = delta ? least_pdf : std::min(least_pdf, next->pdf_dir);
      path.ray = ray_from(point, next->wi);

      // Russian roulette.
      const float alpha = continuation_probability(s_, path.state, path.throughput, weight);
      if (alpha < 1.0f) {
        if (sampler.next_1d() >= alpha) break;
        path.throughput *= 1.0f / alpha;
      }
    }
  }

  PathSettings s_;
};

}  // namespace

const Descriptor& path_descriptor() {
  using Kind = Parameter::Kind;
  static const Descriptor descriptor{
      "path",
      "Path Tracing",
      "All of global illumination by random walks from the camera; unbiased",
      {
          {"light_sampling",
           "Light Sampling",
           Kind::kChoice,
           2,
           0,
           2,
           "How direct light is found: the picture is the same, its noise is not",
           "",
           {{"OFF", "Off",
             "Only rays that happen to meet a luminaire count: the naive method, a reference for the others. Point lights and suns without "
             "a size are not seen"},
            {"ON", "On", "A light is chosen at every surface; luminaires that rays meet by chance are left out"},
            {"MIS", "Multiple Importance", "Both ways, weighed by the power heuristic"}}},
          {"direction_sampling",
           "Direction Sampling",
           Kind::kChoice,
           2,
           0,
           2,
           "The density P from which directions are drawn: the picture is the same, its noise is not",
           "",
           {{"UNIFORM", "Uniform", "Every direction of the hemisphere alike"},
            {"COSINE", "Cosine", "Proportional to the cosine with the normal"},
            {"BSDF", "BSDF", "As the surface scatters"}}},
          {"continuation",
           "Continuation",
           Kind::kChoice,
           1,
           0,
           2,
           "The probability with which a path goes on after a bounce: the picture is the same; low ones make it faster and noisier",
           "",
           {{"ALBEDO", "Albedo", "What the surface reflects"},
            {"THROUGHPUT", "Throughput", "Square root of what the whole path still carries"},
            {"CONSTANT", "Constant", "A fixed number"}}},
          {"continuation_constant", "Constant", Kind::kFloat, 0.7, 0.01, 1, "Probability of going on where it is constant"},
          {"min_bounces", "Minimum Bounces", Kind::kInt, 0, 0, 1024, "Bounces before roulette begins"},
          {"max_bounces", "Total", Kind::kInt, 12, 0, 1024, "Bounces of any kind"},
          {"diffuse_bounces", "Diffuse", Kind::kInt, 4, 0, 1024, "Diffuse reflections"},
          {"glossy_bounces", "Glossy", Kind::kInt, 4, 0, 1024, "Glossy and mirror reflections"},
          {"transmission_bounces", "Transmission", Kind::kInt, 12, 0, 1024, "Refractions"},
          {"volume_bounces", "Volume", Kind::kInt, 0, 0, 1024, "Scatterings in volumes after the first"},
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
      [](const Parameters& p) -> std::unique_ptr<Integrator> { return std::make_unique<PathIntegrator>(p); },
      /*bakes=*/true,
      /*kept_version=*/0,
      /*kept_by_place=*/false,
      kCarriesSubsurface | kCarriesAbsorption | kCarriesVolumes | kCarriesPortals | kCarriesStrands};
  return descriptor;
}

}  // namespace gi
