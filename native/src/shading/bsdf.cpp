// Mixes lobes: one-sample model over all of them with densities summed [Veach 1997, §9.2.4]; what bumped normals need
// (shading_normal.h) is applied here, once, for every lobe.
#include "shading/bsdf.h"

#include "shading/shading_normal.h"
#include "shading/shading_point.h"

namespace gi {
namespace {

constexpr float kLeastWeight = 1e-5f;  // Blender's own cut-off
// Albedos are estimates, which may be 0 where the lobe is not (rough refraction past the critical angle): all keep a chance.
constexpr float kLeastShare = 0.02f;
constexpr uint8_t kKinds = kDiffuse | kGlossy | kSpecular;

uint8_t flags_of(const Lobe& lobe) {
  return std::visit([](const auto& l) { return l.flags(); }, lobe);
}
LobeEval eval_of(const Lobe& lobe, const Frame& frame, Vec3 wo, Vec3 wi, float cos_i) {
  if (const Lambert* lambert = std::get_if<Lambert>(&lobe)) return lambert->eval({}, {0, 0, cos_i});  // the commonest needs no frame
  const Vec3 wo_local = frame.to_local(wo), wi_local{dot(frame.x, wi), dot(frame.y, wi), cos_i};
  return std::visit([&](const auto& l) { return l.eval(wo_local, wi_local); }, lobe);
}
Rgb albedo_of(const Lobe& lobe, Vec3 wo) {
  return std::visit([&](const auto& l) { return l.albedo(wo); }, lobe);
}
std::optional<LobeSample> sample_of(const Lobe& lobe, Vec3 wo, Vec2 u, float u_lobe) {
  return std::visit([&](const auto& l) { return l.sample(wo, u, u_lobe); }, lobe);
}

// Far side over near side; 1 where nothing is bent.
float refraction_index(const Lobe& lobe) {
  return std::visit(
      [](const auto& l) {
        if constexpr (requires { l.fresnel.ior; })
          return std::abs(l.fresnel.ior - 1.0f) < 1e-4f ? 1.0f : float(l.fresnel.ior);
        else
          return 1.0f;
      },
      lobe);
}

// The sides of a lobe that caustics switches take away: glossy ones only, diffuse light makes no caustics.
uint8_t sides_without(uint8_t flags, uint8_t without) {
  if (flags & kDiffuse) return 0;
  return flags & ((without & kNoReflectiveCaustics ? kReflection : 0) | (without & kNoRefractiveCaustics ? kTransmission : 0));
}

void blur_lobe(Lobe& lobe, float alpha) {
  std::visit(
      [alpha](auto& l) {
        if constexpr (requires { l.blur(alpha); }) l.blur(alpha);
      },
      lobe);
}

}  // namespace

Bsdf::Entry* Bsdf::new_entry(Rgb weight, uint8_t flags, const Frame& frame) {
  const Rgb w = positive(weight);
  if (!(average(w) >= kLeastWeight) || !is_finite(w) || count_ == kMaxLobes) return nullptr;
  const uint8_t left = flags & ~sides_without(flags, without_);
  if (!(left & (kReflection | kTransmission))) return nullptr;
  Entry& e = entries_[count_++];
  e.frame = frame, e.weight = w, e.albedo = -1.0f, e.flags = left, e.bumped = !on_curve_ && !(frame.z == ns_), e.all_around = false;
  flags_ |= left;
  return &e;
}

void Bsdf::add_subsurface(const Subsurface& given) {
  constexpr float kLeastRadius = 1e-8f;  // metres
  Subsurface s = given;
  s.anisotropy = std::clamp(s.anisotropy, -0.99f, s.method == SubsurfaceMethod::kWalk ? 0.99f : 0.9f);
  s.ior = std::clamp(s.ior, 1.01f, 3.8f), s.weight = positive(s.weight), s.radius = positive(s.radius), s.albedo = positive(s.albedo);
  Rgb diffuse;
  for (int i = 0; i < 3; ++i)
    if (!(s.radius[i] >= kLeastRadius)) diffuse[i] = s.weight[i], s.weight[i] = 0.0f;
  const Rgb white(1.0f);
  if (!is_black(diffuse)) add(diffuse, Lambert{}, Frame::from_normal(s.normal), &white);
  if (!(average(s.weight) >= kLeastWeight) || !is_finite(s.weight) || subsurface_count_ == kMaxSubsurface) return;
  subsurface_[subsurface_count_++] = s;
}

void Bsdf::add_portal(Vec3 position, Vec3 direction, Rgb weight) {
  const Rgb w = positive(weight);
  if (!(average(w) >= kLeastWeight) || !is_finite(w) || !is_finite(position) || portal_count_ == kMaxPortals) return;
  portals_[portal_count_++] = {position, direction, w};
}

Rgb Bsdf::passed() const {
  Rgb sum = transparency;
  for (int i = 0; i < portal_count_; ++i) sum += portals_[i].weight;
  return sum;
}

void Bsdf::finish(Vec3 wo) {
  float sum = std::max(average(transparency), 0.0f);
  for (int i = 0; i < subsurface_count_; ++i) sum += subsurface_[i].select = average(subsurface_[i].weight), flags_ |= kSubsurface;
  for (int i = 0; i < portal_count_; ++i) sum += portals_[i].select = average(portals_[i].weight), flags_ |= kTransparent | kPortal;
  const bool single = count_ == 1 && sum == 0.0f;
  select_transparent_ = std::max(average(transparency), 0.0f);
  for (int i = 0; i < count_; ++i) {
    Entry& e = entries_[i];
    if (e.albedo < 0.0f && !single) e.albedo = average(e.weight * albedo_of(e.lobe, e.frame.to_local(wo)));
    e.select = single ? 1.0f : std::max(kLeastShare * average(e.weight), e.albedo);
    sum += e.select;
  }
  if (select_transparent_ > 0.0f) flags_ |= kTransparent;
  const float scale = sum > 0.0f ? 1.0f / sum : 0.0f;
  select_transparent_ *= scale;
  for (int i = 0; i < count_; ++i) entries_[i].select *= scale;
  for (int i = 0; i < subsurface_count_; ++i) subsurface_[i].select *= scale;
  for (int i = 0; i < portal_count_; ++i) portals_[i].select *= scale;
}

void Bsdf::blur(float alpha) {
  flags_ &= kTransparent | kSubsurface | kPortal;
  for (int i = 0; i < count_; ++i) {
    Entry& e = entries_[i];
    blur_lobe(e.lobe, alpha);
    e.flags = uint8_t((e.flags & ~kKinds) | (flags_of(e.lobe) & kKinds));
    flags_ |= e.flags;
  }
}

void Bsdf::choose(uint8_t kinds, Vec3 wo) {
  chosen_ = kinds, flags_ = 0;
  float sum = select_transparent_ = kinds & kTransparent ? std::max(average(transparency), 0.0f) : 0.0f;
  for (int i = 0; i < portal_count_; ++i) {
    portals_[i].select = kinds & kTransparent ? average(portals_[i].weight) : 0.0f;
    if (kinds & kTransparent) sum += portals_[i].select, flags_ |= kTransparent | kPortal;
  }
  for (int i = 0; i < count_; ++i) {
    Entry& e = entries_[i];
    e.select = 0.0f;
    if (!(e.flags & kinds & kKinds)) continue;
    if (e.albedo < 0.0f) e.albedo = average(e.weight * albedo_of(e.lobe, e.frame.to_local(wo)));
    sum += e.select = std::max(kLeastShare * average(e.weight), e.albedo);
    flags_ |= e.flags;
  }
  if (select_transparent_ > 0.0f) flags_ |= kTransparent;
  const float scale = sum > 0.0f ? 1.0f / sum : 0.0f;
  select_transparent_ *= scale;
  for (int i = 0; i < count_; ++i) entries_[i].select *= scale;
  for (int i = 0; i < portal_count_; ++i) portals_[i].select *= scale;
}

void Bsdf::favour(uint8_t kinds, float share) {
  float before = 0.0f, sum = 0.0f;
  for (int i = 0; i < count_; ++i) {
    Entry& e = entries_[i];
    before += e.select;
    if (e.flags & kinds & kKinds) e.select *= share;
    sum += e.select;
  }
  if (!(sum > 0.0f)) return;
  for (int i = 0; i < count_; ++i) entries_[i].select *= before / sum;
}

void Bsdf::hold_out() {
  count_ = subsurface_count_ = portal_count_ = 0;
  emission = Rgb(), holdout = Rgb(1.0f) - transparency;
  flags_ &= kTransparent;
  select_transparent_ = flags_ ? 1.0f : 0.0f;
}

// What a bumped normal takes away. Interpolated normals let light in from beyond the geometric horizon, or terminators would show
// facets; a bumped normal may not let it in from beyond the interpolated horizon, or surfaces would leak.
float Bsdf::shadowing(const Entry& e, Vec3 wi, float cos_i, bool sampled) const {
  float s = 1.0f;
  if (e.bumped) {
    const bool diffuse = e.flags & kDiffuse;
    const float cos_ns_wi = dot(ns_, wi), cos_ns_n = dot(ns_, e.frame.z);
    if (cos_ns_wi * cos_ns_n * cos_i < 0.0f && (!sampled || diffuse)) return 0.0f;
    if (diffuse && correct_bumps_) s = bump_shadowing(cos_ns_wi, cos_ns_n);
  }
  return terminator_ > 1.0f ? s * terminator_shift(cos_i, terminator_) : s;
}

template <class Accept>
LobeEval Bsdf::eval_if(Vec3 wo, Vec3 wi, const Entry* skipped, Accept accept) const {
  LobeEval sum;
  for (const Entry& e : *this) {
    if (&e == skipped || (e.flags & kSpecular) || !(e.flags & chosen_)) continue;
    const float cos_i = dot(e.frame.z, wi);
    if (!(e.flags & (cos_i < 0.0f ? kTransmission : kReflection))) continue;
    const float s = shadowing(e, wi, cos_i, false);
    if (s == 0.0f) continue;
    const LobeEval l = eval_of(e.lobe, e.frame, wo, wi, cos_i);
    sum.pdf_dir += e.select * l.pdf_dir;
    if (accept(e, cos_i)) sum.value += e.weight * l.value * s;
  }
  return sum;
}

LobeEval Bsdf::eval(Vec3 wo, Vec3 wi) const {
  return eval_if(wo, wi, nullptr, [](const Entry&, float) { return true; });
}

LobeEval Bsdf::eval(Vec3 wo, Vec3 wi, uint8_t flags) const {
  return eval_if(wo, wi, nullptr, [flags](const Entry& e, float cos_i) {
    return (flags & e.flags & kKinds) && (flags & (cos_i < 0.0f ? kTransmission : kReflection));
  });
}

std::optional<BsdfSample> Bsdf::sample(Vec3 wo, Vec2 u, float u_lobe) const {
  // Choose a lobe, and keep what is left of the number for the lobe's own choices.
  float left = u_lobe;
  for (const Entry& e : *this) {
    if (left < e.select) return sample_entry(e, wo, u, std::min(left / e.select, kOneMinusEpsilon));
    left -= e.select;
  }
  if (const auto elsewhere = sample_elsewhere(wo, left)) return elsewhere;
  // Rounding left a little over: it belongs to the last lobe that can be chosen.
  for (int i = count_ - 1; i >= 0; --i)
    if (entries_[i].select > 0.0f) return sample_entry(entries_[i], wo, u, kOneMinusEpsilon);
  return {};
}

bool Bsdf::is_view_free() const {
  if (count_ == 1 && select_transparent_ == 0.0f && !has_portals()) return true;
  return std::all_of(begin(), end(), [](const Entry& e) { return std::holds_alternative<Lambert>(e.lobe); });
}

std::optional<Bsdf::DeltaEval> Bsdf::eval_delta(Vec3 wo, Vec3 wi) const {
  constexpr float kSame = 1e-3f;  // between unit vectors: what rounding and a normal that heeds the view may do
  std::optional<DeltaEval> sum;
  for (const Entry& e : *this) {
    if (!(e.flags & kSpecular) || !(e.flags & chosen_)) continue;
    const Vec3 wi_local = e.frame.to_local(wi);
    for (const float u_lobe : {0.0f, kOneMinusEpsilon}) {  // reflection comes first where there is any
      const auto s = sample_of(e.lobe, e.frame.to_local(wo), {0.5f, 0.5f}, u_lobe);
      if (!s || length_squared(s->wi - wi_local) > sqr(kSame)) continue;
      if (!sum) sum = DeltaEval{Rgb(), e.frame.z};
      sum->value += e.weight * s->value * (s->flags & kTransmission ? sqr(refraction_index(e.lobe)) : 1.0f);
      break;
    }
  }
  return sum;
}

float Bsdf::delta_probability() const {
  float sum = select_transparent_;
  for (const Entry& e : *this)
    if (e.flags & kSpecular) sum += e.select;
  for (int i = 0; i < subsurface_count_; ++i) sum += subsurface_[i].select;
  for (int i = 0; i < portal_count_; ++i) sum += portals_[i].select;
  return sum;
}

std::optional<BsdfSample> Bsdf::sample_delta(Vec3 wo, float u_lobe) const {
  float left = u_lobe * delta_probability();
  for (const Entry& e : *this) {
    if (!(e.flags & kSpecular)) continue;
    if (left < e.select) return sample_entry(e, wo, {0.5f, 0.5f}, std::min(left / e.select, kOneMinusEpsilon));
    left -= e.select;
  }
  return sample_elsewhere(wo, left);
}

// Whatever does not scatter where it is met, by what is left of the number after the lobes.
std::optional<BsdfSample> Bsdf::sample_elsewhere(Vec3 wo, float left) const {
  for (int i = 0; i < subsurface_count_; ++i) {
    const Subsurface& s = subsurface_[i];
    if (left < s.select) return BsdfSample{{}, s.weight, s.select, kSubsurface, 1.0f, int8_t(i)};
    left -= s.select;
  }
  for (int i = 0; i < portal_count_; ++i) {
    const Portal& p = portals_[i];
    const bool is_last = i + 1 == portal_count_ && !(select_transparent_ > 0.0f);  // what rounding left over is its
    if (p.select > 0.0f && (left < p.select || is_last))
      return BsdfSample{p.direction, p.weight, p.select, kTransparent | kPortal, 0.0f, int8_t(i)};
    left -= p.select;
  }
  if (!(select_transparent_ > 0.0f)) return {};
  return BsdfSample{-wo, transparency, select_transparent_, kTransparent, 0.0f};
}

std::optional<BsdfSample> Bsdf::sample_entry(const Entry& e, Vec3 wo, Vec2 u, float u_lobe) const {
  const Lambert* lambert = std::get_if<Lambert>(&e.lobe);  // the commonest needs no view
  const auto s = lambert ? lambert->sample({}, u, u_lobe) : sample_of(e.lobe, e.frame.to_local(wo), u, u_lobe);
  if (!s || !(s->pdf_dir > 0.0f)) return {};
  const Vec3 wi = e.frame.to_world(s->wi);
  const bool transmitted = s->flags & kTransmission;
  if (!e.all_around && (dot(ng_, wi) < 0.0f) != transmitted) return {};

  const float shadow = transmitted ? 1.0f : shadowing(e, wi, s->wi.z, true);
  BsdfSample result{wi, e.weight * s->value * shadow, e.select * s->pdf_dir, s->flags, s->roughness};
  if (count_ > 1 && !(s->flags & kSpecular)) {
    const LobeEval others = eval_if(wo, wi, &e, [](const Entry&, float) { return true; });
    result.value += others.value, result.pdf_dir += others.pdf_dir;
  }
  return result;
}

Rgb Bsdf::albedo(Vec3 wo) const { return albedo(wo, kKinds); }

Rgb Bsdf::albedo(Vec3 wo, uint8_t flags) const {
  Rgb sum;
  for (const Entry& e : *this)
    if (e.flags & flags & kKinds) sum += e.weight * albedo_of(e.lobe, e.frame.to_local(wo));
  if (flags & kDiffuse)
    for (int i = 0; i < subsurface_count_; ++i) sum += subsurface_[i].weight;
  return sum;
}

Rgb Bsdf::diffuse_albedo() const {
  Rgb sum;
  for (const Entry& e : *this)
    if (e.flags & kDiffuse) sum += e.weight;
  return sum;
}

Rgb Bsdf::diffuse_albedo(Vec3 wo, uint8_t side) const {
  Rgb sum;
  for (const Entry& e : *this)
    if ((e.flags & kDiffuse) && (e.flags & side)) sum += e.weight * albedo_of(e.lobe, e.frame.to_local(wo));
  return sum;
}

Vec3 Bsdf::diffuse_normal() const {
  Vec3 sum;
  for (const Entry& e : *this)
    if (e.flags & kDiffuse) sum += e.frame.z * average(e.weight);
  return normalize_or(sum, ns_);
}

Vec3 Bsdf::mean_normal() const {
  Vec3 sum;
  for (const Entry& e : *this) sum += e.frame.z * e.select;
  for (int i = 0; i < subsurface_count_; ++i) sum += subsurface_[i].normal * subsurface_[i].select;
  return normalize_or(sum, ns_);
}

}  // namespace gi
