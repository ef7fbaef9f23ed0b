// The scattering of one shading point: a weighted mix of lobes, what it emits and what it lets through.
// Integrators see only this; lobes live one to a header under lobes/ and know only their own local frame.
#pragma once
#include <optional>

#include "core/vec.h"
#include "shading/lobes/lobes.h"

namespace gi {

// Value and density of a BSDF (or lobe) for a pair of directions. `value` contains |cos θi|. `pdf_dir` per steradian.
struct BsdfSample {
  Vec3 wi;           // world space, unit, away from the surface
  Rgb value;         // f(wo, wi) |cos θi| of the whole mix; for delta lobes the factor itself
  float pdf_dir = 0; // of the whole mix, lobe choice included; for delta lobes the probability of the choice
  uint8_t flags = 0; // LobeFlags of the lobe that was sampled
  float roughness = 0;  // of the sampled lobe, for the footprint and for caustic filtering
};

class Bsdf {
 public:
  static constexpr int kMaxLobes = 24;

  // `without`: CausticFlags, lobes to leave out.
  void clear(Vec3 ng, Vec3 ns, uint8_t without = 0) {
    count_ = 0, ng_ = ng, ns_ = ns, without_ = without, emission = Rgb(), transparency = Rgb(), holdout = Rgb();
  }
  void set_geometric_normal(Vec3 ng) { ng_ = ng; }

  // Adds `lobe` in the frame whose z is the lobe's own (bumped) normal. Zero, negative or NaN weights are dropped.
  void add(Rgb weight, const Lobe& lobe, const Frame& frame);
  // Called once after the last add: selection probabilities from the lobes' albedos towards `wo`.
  void finish(Vec3 wo);

  LobeEval eval(Vec3 wo, Vec3 wi) const;                                   // delta lobes contribute nothing
  // As eval, but only lobes with one of `flags`: what passes and Light Path logic need.
  LobeEval eval(Vec3 wo, Vec3 wi, uint8_t flags) const;
  std::optional<BsdfSample> sample(Vec3 wo, Vec2 u, float u_lobe) const;
  float delta_probability() const;  // with which `sample` picks a delta lobe, transparency included
  // Picks among the delta lobes alone; pdf_dir is the probability within `sample` (not given that it is a delta lobe).
  std::optional<BsdfSample> sample_delta(Vec3 wo, float u_lobe) const;
  Rgb albedo(Vec3 wo) const;        // directional albedo, transparency left out
  Rgb diffuse_albedo() const;       // Σ weights of the diffuse lobes
  Vec3 mean_normal() const;         // albedo-weighted shading normal (Normal pass, denoising)
  uint8_t flags() const { return flags_; }
  bool is_delta() const { return (flags_ & (kDiffuse | kGlossy)) == 0; }  // nothing for light sampling to do
  int lobe_count() const { return count_; }
  Vec3 geometric_normal() const { return ng_; }

  Rgb emission;      // radiance leaving towards wo
  Rgb transparency;  // straight-through transmittance (Transparent BSDF); sampled by `sample` as a delta lobe
  Rgb holdout;       // part of the pixel's alpha that is cut out

 private:
  struct Entry {
    Lobe lobe;
    Rgb weight;
    Frame frame;
    float select = 0;  // probability
  };
  Entry entries_[kMaxLobes];
  int count_ = 0;
  uint8_t flags_ = 0, without_ = 0;
  float select_transparent_ = 0;
  Vec3 ng_{0, 0, 1}, ns_{0, 0, 1};  // both face wo
};

}  // namespace gi
