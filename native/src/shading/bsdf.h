// The scattering of one shading point: a weighted mix of lobes, what it emits and what it lets through.
// Integrators see only this; lobes live one to a header under lobes/ and know only their own local frame.
#pragma once
#include <memory>
#include <optional>
#include <type_traits>

#include "core/vec.h"
#include "shading/lobes/lobes.h"
#include "shading/subsurface.h"

namespace gi {

// A direction drawn from a BSDF. `value` contains |cos θi|. `pdf_dir` per steradian.
struct BsdfSample {
  Vec3 wi;           // world space, unit, away from the surface
  Rgb value;         // f(wo, wi) |cos θi| of the whole mix; for delta lobes the factor itself
  float pdf_dir = 0; // of the whole mix, lobe choice included; for delta lobes the probability of the choice
  uint8_t flags = 0; // of the lobe that was sampled: side and kind; kTransparent alone for straight through
  float roughness = 0;  // of the sampled lobe, for the footprint and for caustic filtering
  int8_t which = -1;  // of what goes on elsewhere: the subsurface, where the flags say so (wi is then not set); the portal, if any
  bool is_delta() const { return flags & (kSpecular | kTransparent | kSubsurface); }
};

// A Ray Portal BSDF: what comes to it goes on at another place.
struct Portal {
  Vec3 position;   // world, metres
  Vec3 direction;  // unit
  Rgb weight;
  float select = 0;  // probability
};

// Reuse one object: 24 lobes are some kilobytes, and clear() touches none of them.
class Bsdf {
 public:
  static constexpr int kMaxLobes = 24;

  Bsdf() {}  // entries_ stay uninitialised
  // `without`: CausticFlags, sides of glossy lobes to leave out.
  void clear(Vec3 ng, Vec3 ns, uint8_t without = 0) {
    count_ = 0, subsurface_count_ = 0, portal_count_ = 0, flags_ = 0, chosen_ = kAll, ng_ = ng, ns_ = ns, without_ = without,
    on_curve_ = on_point_ = false, emission = Rgb(), transparency = Rgb(), holdout = Rgb();
  }
  // A curve takes nothing from bumped normals, and has no side but that of its shading normal `ns`: for a ribbon's own, which is the view,
  // it would be too dark. So in Cycles. After clear().
  void set_on_curve() { on_curve_ = true, ng_ = ns_; }
  bool on_curve() const { return on_curve_; }
  // Points are scattered below of as if they were dense. After clear().
  void set_on_point() { on_point_ = true; }
  uint8_t without() const { return without_; }
  void set_geometric_normal(Vec3 ng) { ng_ = ng; }
  // The object's shadow terminator offset, as a frequency: 1 / (1 − offset / 2). Survives clear().
  void set_terminator_frequency(float f) { terminator_ = f; }

  // Blender's Bump Map Correction: bent normals neither reflect what is below the surface nor make hard terminators. Survives clear().
  void set_bump_correction(bool on) { correct_bumps_ = on; }
  bool bump_correction() const { return correct_bumps_; }

  // Whether the integrator follows light below the surface; if not, it is diffuse of the same albedo. Survives clear().
  void carry_subsurface(bool on) { carries_subsurface_ = on; }
  bool carries_subsurface() const { return carries_subsurface_ && !on_point_; }
  // Where it is carried. Channels of no radius are diffuse.
  void add_subsurface(const Subsurface& s);
  const Subsurface& subsurface(int i) const { return subsurface_[i]; }
  int subsurface_count() const { return subsurface_count_; }

  // Drawn as what is transparent is.
  void add_portal(Vec3 position, Vec3 direction, Rgb weight);
  const Portal& portal(int i) const { return portals_[i]; }
  bool has_portals() const { return portal_count_ > 0; }
  Rgb passed() const;  // straight through, or by portals

  // Adds `lobe` in the frame whose z is the lobe's own (bumped) normal. Negative components count as 0; weights that come to
  // nothing are dropped, and so are lobes beyond kMaxLobes.
  // `albedo`: of the lobe towards the viewer, where the caller has it already.
  template <class L>
  void add(Rgb weight, const L& lobe, const Frame& frame, const Rgb* albedo = nullptr) {
    if (Entry* e = new_entry(weight, lobe.flags(), frame)) {
      if (albedo && e->flags == lobe.flags()) e->albedo = average(e->weight * *albedo);
      std::construct_at(&e->lobe, std::in_place_type<L>, lobe);
      if constexpr (requires { L::kAllAround; }) e->all_around = true;
      if constexpr (requires(L l) { l.remove(uint8_t(0)); }) {
        if (e->flags != lobe.flags()) std::get<L>(e->lobe).remove(lobe.flags() & ~e->flags);
      }
    }
  }
  // The lobe that was added last scatters to either side of the surface, whatever its own normal.
  void forget_last_bump() { entries_[count_ - 1].bumped = false; }
  // Called once after the last add: selection probabilities from the lobes' albedos towards `wo`.
  void finish(Vec3 wo);

  // Makes glossy and specular lobes at least as rough as `alpha`; diffuse ones stay as they are. After finish().
  void blur(float alpha);
  // Lobes of other kinds than `kinds` (kDiffuse, kGlossy, kSpecular, and kTransparent) are neither evaluated nor sampled from now
  // on. After finish(), any number of times.
  void choose(uint8_t kinds, Vec3 wo);
  // Lobes of `kinds` are sampled `share` times as often, compared with others: values stay, densities do not. After finish().
  void favour(uint8_t kinds, float share);
  // Turns the whole surface, but for what it lets through, into a hole of the picture. After finish().
  void hold_out();

  LobeEval eval(Vec3 wo, Vec3 wi) const;  // delta lobes contribute nothing
  // As eval, but the value is only of lobes whose side and kind for this pair (say kReflection and kDiffuse) are both in
  // `flags`; the density stays that of the whole mix. For passes and Light Path logic.
  LobeEval eval(Vec3 wo, Vec3 wi, uint8_t flags) const;
  // A direction on the wrong side of the geometric normal for its lobe ends the path: no sample.
  std::optional<BsdfSample> sample(Vec3 wo, Vec2 u, float u_lobe) const;
  // Whether no lobe's share of the samples depends on the view: its own setting up aside, the mix is the same for all directions.
  bool is_view_free() const;
  // The delta lobes that turn `wi` into `wo`, for paths from the light: what they do to light, and how much narrower a pencil of it
  // leaves than it came, |dωo cos θo / dωi cos θi| about the lobe's normal (η² where it refracts); nothing if there are none.
  struct DeltaEval {
    Rgb value;       // factor and narrowing
    Vec3 normal;     // of the lobe
  };
  std::optional<DeltaEval> eval_delta(Vec3 wo, Vec3 wi) const;
  float delta_probability() const;  // with which `sample` picks a delta lobe, transparency included
  // Picks among the delta lobes alone; pdf_dir is the probability within `sample` (not given that it is a delta lobe).
  std::optional<BsdfSample> sample_delta(Vec3 wo, float u_lobe) const;
  Rgb albedo(Vec3 wo) const;        // directional albedo, transparency left out
  Rgb albedo(Vec3 wo, uint8_t flags) const;  // only of lobes with a kind (kDiffuse, kGlossy, kSpecular) in `flags`
  Rgb diffuse_albedo() const;       // Σ weights of the diffuse lobes
  Rgb diffuse_albedo(Vec3 wo, uint8_t side) const;  // directional, of those that reflect or those that transmit
  Vec3 diffuse_normal() const;      // weighted mean of the diffuse lobes'
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
    Frame frame;
    Rgb weight;
    float albedo = -1;  // weight included, mean of the channels; negative: not known yet
    float select = 0;   // probability
    uint8_t flags = 0;
    bool bumped = false;  // its normal is not ns_
    bool all_around = false;  // samples may be on any side
  };
  static_assert(std::is_trivially_copyable_v<Entry>);
  Entry* new_entry(Rgb weight, uint8_t flags, const Frame& frame);  // all but its lobe; null if it comes to nothing
  const Entry* begin() const { return entries_; }
  const Entry* end() const { return entries_ + count_; }
  float shadowing(const Entry& e, Vec3 wi, float cos_i, bool sampled) const;
  template <class Accept>
  LobeEval eval_if(Vec3 wo, Vec3 wi, const Entry* skipped, Accept accept) const;
  std::optional<BsdfSample> sample_entry(const Entry& e, Vec3 wo, Vec2 u, float u_lobe) const;
  std::optional<BsdfSample> sample_elsewhere(Vec3 wo, float left) const;

  static constexpr int kMaxSubsurface = 4, kMaxPortals = 4;
  union {
    Entry entries_[kMaxLobes];
  };
  union {
    Subsurface subsurface_[kMaxSubsurface];
  };
  union {
    Portal portals_[kMaxPortals];
  };
  int subsurface_count_ = 0, portal_count_ = 0;
  bool carries_subsurface_ = false;
  static constexpr uint8_t kAll = kDiffuse | kGlossy | kSpecular | kTransparent;
  int count_ = 0;
  uint8_t flags_ = 0, without_ = 0, chosen_ = kAll;
  float select_transparent_ = 0;
  float terminator_ = 1;
  bool correct_bumps_ = true, on_curve_ = false, on_point_ = false;
  Vec3 ng_{0, 0, 1}, ns_{0, 0, 1};  // both face wo
};

}  // namespace gi
