// Subpaths from the light: their vertices, how a vertex scatters light towards the eye, and the sums by which a strategy is weighed
// against the others. What Blender's materials are not - reciprocal - is dealt with here, once.
#pragma once
#include "core/sampler.h"
#include "scene/camera_lens.h"
#include "transport/direct_light.h"
#include "transport/emission_guide.h"

namespace gi {

// The function of densities that multiple importance sampling compares: the power heuristic of exponent 2 [Veach 1997, eq. 9.13],
// or the balance heuristic [eq. 9.8].
struct Heuristic {
  bool power = true;
  float operator()(float density) const { return power ? density * density : density; }
};

// Partial sums of the weight, for all strategies that end nearer to where the subpath began [Georgiev 2012, "Implementing vertex
// connection and merging", eq. 31, 32]. Of the arrived ray at a vertex; or, `scattered`, of the ray that leaves it.
struct PartialWeights {
  float vcm = 0, vc = 0;

  // [Georgiev 2012, eq. 34, 35] for a lobe with densities, [eq. 53, 54] for a delta lobe, which no other strategy can connect. `merged`:
  // the weight of merging at this vertex.
  PartialWeights scattered(Heuristic h, bool is_delta, float cos_out, float pdf_forward, float pdf_reverse, float merged) const {
    if (is_delta) return {0.0f, h(cos_out) * vc};
    return {h(1.0f / pdf_forward), h(cos_out / pdf_forward) * (merged + vcm + h(pdf_reverse) * vc)};
  }
  // The ray meets a surface: densities per steradian become densities per area.
  PartialWeights arrived(Heuristic h, float distance, float cos_in) const {
    return {vcm * h(sqr(distance) / cos_in), vc * h(1.0f / cos_in)};
  }
  // What the other strategies come to if this vertex were generated from the far side: `pdf_area` of itself, `pdf_reverse` of the one
  // before. [Georgiev 2012, eq. 37]
  float sum(Heuristic h, float pdf_area, float pdf_reverse, float merged) const {
    return h(pdf_area) * (merged + vcm + h(pdf_reverse) * vc);
  }
};

// Bounces by kind, as Blender's limits count them: the one nearest to the light, which light sampling makes, is free.
struct BounceCount {
  int total = 0, diffuse = 0, glossy = 0, transmission = 0;
  void add(const BounceCount& b) { total += b.total, diffuse += b.diffuse, glossy += b.glossy, transmission += b.transmission; }
  void add(uint8_t flags) {
    ++total;
    ++(flags & kTransmission ? transmission : flags & kDiffuse ? diffuse : glossy);
  }
  bool within(const BounceLimits& l) const {
    return total <= l.total && diffuse <= l.diffuse && glossy <= l.glossy && transmission <= l.transmission;
  }
};

struct LightVertex {
  ShadingPoint point;    // seen from where the light comes from: point.wo
  Bsdf bsdf;             // likewise
  Rgb power;             // of the particle, watts
  PartialWeights weights;
  BounceCount bounces;   // on the way here
  uint32_t seen_by = 0xffffffffu;  // RayKind bits: what of this surface sees where the light comes from
  Rgb by_mirrors{1.0f};            // the share of its power that no diffuse lobe scattered on the way
  Rgb last_by_mirrors;             // that none scattered last
  bool was_transmitted = false;    // last
  int scattered = 0;               // times on the way here, see-through surfaces left out; 0: lit by the luminaire itself
  int max_bounces = 1024;          // of the luminaire
  bool is_first() const { return scattered == 0; }
  // Whether diffuse lobes here do not see what `last_by_mirrors` is the share of. `without`: CausticFlags.
  bool hides_mirrors(uint8_t without) const { return without & (was_transmitted ? kNoRefractiveCaustics : kNoReflectiveCaustics); }
  int s() const { return scattered + 2; }  // vertices up to here, the one on the luminaire among them
};

// Of any number of light subpaths. Large, and kept for the next.
class LightVertices {
 public:
  LightVertex& grow() {
    if (all_.size() == count_) all_.emplace_back();
    return all_[count_];
  }
  void keep() { ++count_; }  // what grow() gave
  void clear() { count_ = 0; }
  size_t count() const { return count_; }
  const LightVertex& operator[](size_t i) const { return all_[i]; }

  EmissionNumbers start{};  // what the last subpath began with

 private:
  std::vector<LightVertex> all_;
  size_t count_ = 0;
};

// The radius of a pixel on a surface that is seen directly: what textures and bumps of both kinds of subpath are filtered by.
struct PixelFootprint {
  Vec3 lens;
  float at_lens = 0, per_metre = 0;
  PixelFootprint() = default;
  PixelFootprint(const Camera& camera, int width, int height) : lens(camera.to_world.translation()) {
    const CameraRay middle = camera.sample({0.5f, 0.5f}, {1.0f / float(width), 1.0f / float(height)}, {0.5f, 0.5f});
    per_metre = middle.spread, at_lens = middle.footprint - middle.spread * camera.clip_start;
  }
  float operator()(Vec3 position) const { return at_lens + per_metre * length(position - lens); }
};

struct SubpathSettings {
  BounceLimits limits;
  Heuristic heuristic{};
  PixelFootprint footprint{};
  float joined = 1;  // light subpaths that each eye vertex is joined to, as the weights have it
  float merges = 0;  // η of merging [Georgiev 2012, eq. 20] where a pixel has radius 1: of photons over those joined; 0: nothing is merged
  const EmissionGuide* guide = nullptr;  // which strategies that weigh densities against others' know nothing of
  uint8_t without = 0;  // CausticFlags: what diffuse surfaces do not see of others; whoever stores vertices has to ask too
  bool weighs = true;  // vertices know what other strategies come to
  bool only_by_mirrors = false;  // ends at the first vertex all of whose light diffuse lobes scattered

  // The weight of merging at a vertex over that of joining it.
  float merged(Vec3 position) const { return merges > 0.0f ? heuristic(merges * sqr(footprint(position))) : 0.0f; }
};

// Follows light from a luminaire chosen by its power, and adds the surfaces that it meets. Lamps that throw no shadow are left to
// strategies that meet or choose them.
void trace_from_light(const RenderContext& context, const SubpathSettings& settings, Sampler& sampler, LightVertices& vertices);

// What the surface at `point`, seen from `w`, makes of light from point.wo: f |cos θ| for light that comes from there, and the density
// with which it would be followed from w to there. `bsdf` is the surface's as seen from point.wo.
LobeEval eval_turned(const RenderContext& context, const ShadingPoint& point, const Bsdf& bsdf, Vec3 w, const PathState& path,
                     uint32_t seen_by = 0xffffffffu);

// The state of a path at a surface that light has come to, while nothing is known of how the eye will see it: as diffuse light does.
PathState unknown_state();

// f |cos θ| of the lobes by which `seen_by` (RayKind bits) sees what is towards wi; the density is of all.
LobeEval eval_seen_by(const Bsdf& bsdf, Vec3 wo, Vec3 wi, uint32_t seen_by);

// What the surface makes of light from point.wo that goes on to `next`, as seen from there, in the measure of the true normal [Veach 1997,
// §5.3]; and the density of the way back, 0 for delta lobes.
struct Adjoint {
  Rgb factor;
  float pdf_reverse = 0;
};
Adjoint adjoint(const RenderContext& context, const ShadingPoint& point, const Bsdf& bsdf, const BsdfSample& next, const PathState& path,
                uint32_t seen_by = 0xffffffffu);

// Whether light subpaths may begin with a ray to this surface. They never end on strands: what a ribbon is depends on who looks, and which
// side of a fibre light comes in by is not known where it comes out.
inline bool meets_light(const Scene& scene, const ShadingPoint& point) {
  if (point.strand != kNoId) return false;
  const uint32_t v = scene.instances()[point.instance].data->visibility;
  return (v & kRayShadow) && (v & (kRayDiffuse | kRayGlossy | kRayTransmission));
}

// Kind and side of the bounce from wo to wi, for counting: of mixed lobes the one that scatters more.
uint8_t bounce_flags(const Bsdf& bsdf, const ShadingPoint& point, Vec3 wi);

// The share of light that passes along a ray which starts where it is seen from, as the kinds of ray `visibility` see what is there.
Rgb passage(const RenderContext& context, Ray ray, uint32_t visibility, PathState path, int transparent_limit);

// A light subpath's vertex joined to the lens.
struct LensConnection {
  LensSample lens;
  Rgb value;  // of a pixel whose filter is 1 there, but for what lies between, for one light path in all
  float pdf_area = 0;  // of the vertex, by the rays of one sample for each pixel
  float pdf_reverse = 0;  // of the vertex before, per steradian
};
std::optional<LensConnection> connect_to_lens(const RenderContext& context, const BounceLimits& limits, const LightVertex& vertex,
                                              int pixels, Vec2 u_lens);
Rgb passage_to_lens(const RenderContext& context, const BounceLimits& limits, const LightVertex& vertex, const LensSample& lens);

// What one count of the film's splats is worth in this scene: about 10⁻¹³ of what it sends to its surroundings.
double splat_unit(const RenderContext& context);

}  // namespace gi
