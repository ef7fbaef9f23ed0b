// All light sources of a scene as one: choosing one for a point, and the densities that MIS needs when a ray finds one
// by itself. One header per kind of source beside this; the light tree picks among them.
#pragma once
#include <memory>
#include <optional>

#include "scene/scene.h"

namespace gi {

// Where light is wanted. Node programs of lights see the ray kind 0, as Cycles has it for sampled light.
struct LightQuery {
  Vec3 position;
  Vec3 normal;                // shading normal; zero where there is none (volumes)
  bool transmission = false;  // the surface also scatters from below
  PathState path;
  float world_share = 1.0f;   // of the world's light, for choosing: the rest is known otherwise
};

struct LightSample {
  Vec3 wi;                // unit, towards the light
  float distance = kInf;  // to the sampled point; infinite for sun and world
  Rgb radiance;           // L along -wi, shadowing left out; for delta lights irradiance-like, so that f cos · radiance / pdf estimates
  float pdf_dir = 0;      // per steradian, choice of light included; for delta lights the probability of the choice
  bool is_delta = false;
  uint32_t light = 0;  // index, below LightSet::count
  bool cast_shadow = true;
  bool use_mis = true;  // false: rays never find it by themselves, its weight is 1
  uint32_t visibility = 0xffffffffu;  // RayKind bits: what of a surface the light reaches
};

struct LightEval {
  Rgb radiance;
  float pdf_dir = 0;  // of LightSet::sample choosing this direction on this light; 0 if it never does
};

struct LampHit {
  float t = kInf;
  uint32_t lamp = 0;
};

// Light as it leaves a luminaire.
struct EmittedRay {
  Ray ray;
  Rgb power;  // radiance · cos / density: the mean of these is all that the scene's luminaires emit, watts
  uint32_t light = 0;
  bool cast_shadow = true;
  uint32_t visibility = 0xffffffffu;  // RayKind bits: what of a surface the light reaches
  Vec2 barycentrics = {};  // of its place on an emissive triangle
};

class LightSet {
 public:
  explicit LightSet(const Scene& scene, int threads = 0);  // threads for building; 0: one for each core
  ~LightSet();

  // Picks a light by its estimated contribution and a direction towards it.
  std::optional<LightSample> sample(const LightQuery& query, float u_choice, Vec2 u) const;
  // One given light; pdf_dir then leaves out the choice. u = (½, ½) is its centre (hard shadows).
  std::optional<LightSample> sample_light(uint32_t light, const LightQuery& query, Vec2 u) const;
  bool has_centre(uint32_t light) const { return light < count() && !is_world(light); }
  bool is_world(uint32_t light) const;
  uint32_t count() const;  // lamps, emissive triangles, the world
  bool empty() const { return count() == 0; }

  // Lamps are transparent: the nearest lamp with a shape that a ray of `visibility` meets in (t_min, t_max), or the next
  // one behind `after`. Lamps without multiple importance sampling are found by camera rays alone.
  bool has_findable_lamps() const { return has_findable_lamps_; }
  std::optional<LampHit> intersect_lamp(const Ray& ray, uint32_t visibility, const LampHit* after = nullptr) const;
  // `from` is where the ray left a surface; for its density alone.
  LightEval eval_lamp(const LightQuery& from, const Ray& ray, const LampHit& hit) const;
  // Suns of a visible size, seen along a ray that leaves the scene: one call per sun.
  uint32_t sun_count() const;
  LightEval eval_sun(uint32_t sun, const LightQuery& from, Vec3 direction, uint32_t visibility) const;
  // Density with which `sample` picks the direction towards the point of an emissive triangle that a ray hit.
  float pdf_triangle(const LightQuery& from, const ShadingPoint& point) const;
  // Density with which `sample` picks `direction` on the world.
  float pdf_world(const LightQuery& from, Vec3 direction) const;
  float world_radiance() const;                   // its mean over the sphere, |luminance|; 0 where it is not sampled
  float world_share_above(float radiance) const;  // of the world's light, what exceeds `radiance`, about
  // Probability with which `sample` picks the light.
  float pick_probability(const LightQuery& query, uint32_t light) const;
  // A luminaire chosen by its power, a place on it and a direction: where light starts.
  std::optional<EmittedRay> emit(float u_choice, Vec2 u_place, Vec2 u_direction) const;
  // Whether light that was emitted like this is what `position` sees: Blender's lamps of soft falloff turn to whoever looks.
  bool turns_to(const EmittedRay& emitted, Vec3 position) const;
  // What `sample` would have said at `query` of light that was emitted like this and arrived there, its choice of this light left out;
  // none where that point does not see it (lamps of soft falloff turn to whoever looks). The density of shapes costs about as much as all
  // else; without `with_pdf` it may be left at 0.
  std::optional<LightSample> arriving(const EmittedRay& emitted, const LightQuery& query, bool with_pdf = true) const;
  // Density with which `emit` makes the ray from `light` that arrives at `position` from `wi`: per steradian and square metre across
  // the ray, choice included. Where place or direction is fixed (delta lights) it is left out, and what remains is as seen from
  // `position`; so radiance / pdf_emit is the power of the ray for every kind of light.
  float pdf_emit(uint32_t light, Vec3 position, Vec3 wi) const;
  const LampData* lamp(uint32_t light) const;  // null for triangles and the world
  uint32_t light_of_triangle(uint32_t instance, uint32_t triangle) const;  // kNoId: none
  uint32_t light_of_sun(uint32_t sun) const;
  uint32_t world_light() const;
  float emitted_power() const;  // of everything, about, |luminance|
  std::string description() const;  // how many of what
  // Materials and the world that shine but are set not to be sampled: found by rays alone, they send nothing. Empty: none.
  std::string unsampled() const;

 private:
  struct Impl;
  std::unique_ptr<const Impl> impl_;
  bool has_findable_lamps_ = false;
};

}  // namespace gi
