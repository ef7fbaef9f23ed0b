// Ops that end a node tree: each adds lobes, emission, transparency or holdout to state.bsdf. The first input is always the
// weight that Mix Shader leaves. A zero vector for a normal or a tangent means "not linked". Leaves out volumes and hair.
#include "shading/closures.h"
#include "shading/medium.h"
#include "shading/ops.h"

namespace gi {
namespace {

void mix_weights(const Operands& o, ShadeState&) {
  const float w = o.f(2), second = clamp01(o.f(3));
  o.set(0, w * (1.0f - second)), o.set(1, w * second);
}

void emission(const Operands& o, ShadeState& s) {
  const Rgb light = o.c(1) * (o.f(0) * o.f(2));
  if (s.bsdf) s.bsdf->emission += light;
  if (s.medium) s.medium->emission += light;
}

void transparent(const Operands& o, ShadeState& s) {
  if (s.bsdf) s.bsdf->transparency += o.c(1) * o.f(0);
}

// weight, color, position, direction; whether there is a position. A zero vector for a direction is straight on.
void ray_portal(const Operands& o, ShadeState& s) {
  if (!s.bsdf) return;
  s.bsdf->add_portal(o.imm(4) ? o.v(2) : s.point.position, normalize_or(o.v(3), -s.point.wo), o.c(1) * o.f(0));
}

// What Alpha lets through; the lobes that go with it scale their own weight.
void alpha(const Operands& o, ShadeState& s) {
  if (s.bsdf) s.bsdf->transparency += Rgb(o.f(0) * (1.0f - clamp01(o.f(1))));
}

void holdout(const Operands& o, ShadeState& s) {
  if (s.bsdf) s.bsdf->holdout += Rgb(o.f(0));
}

void diffuse(const Operands& o, ShadeState& s) {
  if (s.bsdf) add_diffuse(s, o.c(1) * o.f(0), o.c(1), o.f(2), normal_or_shading(s, o.v(3)));
}

// weight, color, scale, radius, ior, roughness, anisotropy, normal; method
void subsurface(const Operands& o, ShadeState& s) {
  if (!s.bsdf) return;
  const Vec3 n = normal_or_shading(s, o.v(7));
  Subsurface below;
  below.albedo = positive(o.c(1)), below.weight = o.c(1) * o.f(0), below.radius = o.c(3) * o.f(2);
  below.ior = o.f(4), below.alpha = clamp01(o.f(5)), below.anisotropy = o.f(6), below.normal = visible_normal(s, n);
  below.method = SubsurfaceMethod(o.imm(8));
  if (below.method == SubsurfaceMethod::kSkin) below.alpha = 1.0f;
  add_subsurface(s, below, n);
}

void translucent(const Operands& o, ShadeState& s) {
  if (!s.bsdf) return;
  add_lobe(s, o.c(1) * o.f(0), Translucent{}, visible_normal(s, normal_or_shading(s, o.v(2))));
}

void sheen(const Operands& o, ShadeState& s) {
  if (!s.bsdf) return;
  const Vec3 n = normal_or_shading(s, o.v(3));
  add_lobe(s, o.c(1) * o.f(0), Sheen(o.f(2), dot(n, s.point.wo)), n);
}

void velvet(const Operands& o, ShadeState& s) {
  if (s.bsdf) add_lobe(s, o.c(1) * o.f(0), Velvet(o.f(2)), normal_or_shading(s, o.v(3)));
}

void toon(const Operands& o, ShadeState& s) {
  if (!s.bsdf) return;
  add_lobe(s, o.c(1) * o.f(0), Toon(o.f(2), o.f(3), o.imm(5) != 0), normal_or_shading(s, o.v(4)));
}

// A GGX or Beckmann lobe made by `make<LobeType>()`. Only Multiscatter GGX gets back what single bounces lose.
template <class Make>
void add_facets(ShadeState& s, Rgb weight, int distribution, Vec3 n, Vec3 tangent, Make make) {
  if (distribution == kBeckmann) return add_lobe(s, weight, make.template operator()<BeckmannLobe>(), n, tangent);
  GgxLobe lobe = make.template operator()<GgxLobe>();
  if (distribution == kMultiscatterGgx) lobe.preserve_energy(clamp01(dot(n, s.point.wo)));
  add_lobe(s, weight, lobe, n, tangent);
}

void glossy(const Operands& o, ShadeState& s) {
  if (!s.bsdf) return;
  const Rgb color = positive(o.c(1));
  const Vec3 n = visible_normal(s, normal_or_shading(s, o.v(5)));
  const float alpha = sqr(clamp01(o.f(2))), a = std::clamp(o.f(3), -0.99f, 0.99f);
  float ax = alpha, ay = alpha;
  Vec3 tangent = o.v(6);
  if (std::abs(a) > 1e-4f && !(tangent == Vec3{})) {
    ax = a < 0.0f ? alpha / (1.0f + a) : alpha * (1.0f - a);
    ay = a < 0.0f ? alpha * (1.0f + a) : alpha / (1.0f - a);
    tangent = rotated(tangent, n, o.f(4) * 2.0f * kPi);
  }
  const int distribution = o.imm(7);
  if (distribution == kAshikhminShirley) return add_lobe(s, color * o.f(0), AshikhminShirley::make(ax, ay), n, tangent);
  if (distribution == kBeckmann) return add_lobe(s, color * o.f(0), BeckmannLobe::reflection(ax, ay, Fresnel::none()), n, tangent);
  GgxLobe lobe = GgxLobe::reflection(ax, ay, Fresnel::none());
  if (distribution == kMultiscatterGgx) lobe.preserve_energy(clamp01(dot(n, s.point.wo)), color);
  add_lobe(s, color * o.f(0), lobe, n, tangent);
}

void refraction(const Operands& o, ShadeState& s) {
  if (!s.bsdf) return;
  const float ior = std::max(o.f(3), 1e-5f), alpha = sqr(o.f(2));
  const Fresnel f = Fresnel::none(s.point.backfacing ? 1.0f / ior : ior);
  add_facets(s, o.c(1) * o.f(0), o.imm(5), visible_normal(s, normal_or_shading(s, o.v(4))), {},
             [&]<class L>() { return L::refraction(alpha, f); });
}

void glass(const Operands& o, ShadeState& s) {
  if (!s.bsdf) return;
  const Rgb color = positive(o.c(1));
  const float alpha = sqr(clamp01(o.f(2))), ior = std::max(o.f(3), 1e-5f), film_ior = std::max(o.f(6), 1e-5f);
  const bool inside = s.point.backfacing;
  const Fresnel bare = Fresnel::schlick(inside ? 1.0f / ior : ior, Rgb(f0_from_ior(ior)), Rgb(1.0f), color, color);
  const Fresnel f = bare.with_film(o.f(5), inside ? film_ior / ior : film_ior);
  add_facets(s, Rgb(o.f(0)), o.imm(7), visible_normal(s, normal_or_shading(s, o.v(4))), {}, [&]<class L>() { return L::glass(alpha, f); });
}

void metallic(const Operands& o, ShadeState& s) {
  if (!s.bsdf) return;
  const bool physical = o.imm(11) != 0;
  const Fresnel bare =
      physical ? Fresnel::conductor(positive(o.c(1)), positive(o.c(2))) : Fresnel::f82_tint(clamp01(o.c(1)), clamp01(o.c(2)));
  const Fresnel f = bare.with_film(o.f(8), std::max(o.f(9), 1e-5f));
  const Vec3 n = normal_or_shading(s, o.v(6)), tangent = o.v(7);
  const Anisotropy a = anisotropy(clamp01(o.f(3)), clamp01(o.f(4)), o.f(5), n, tangent);
  add_facets(s, Rgb(o.f(0)), o.imm(10), visible_normal(s, n), a.tangent, [&]<class L>() { return L::reflection(a.alpha_x, a.alpha_y, f); });
}

// Films that lack the AOV, as those of bakes, are not written to.
void aov(const Operands& o, ShadeState& s, const float (&value)[4]) {
  const size_t first = 4 * size_t(o.imm(1));
  for (size_t k = 0; first + 4 <= s.aovs.size() && k < 4; ++k) s.aovs[first + k] += value[k];
}
bool any_index(const int32_t* immediates, size_t) { return immediates[0] >= 0; }
void aov_color(const Operands& o, ShadeState& s) { aov(o, s, {o.v(0).x, o.v(0).y, o.v(0).z, 1.0f}); }
void aov_value(const Operands& o, ShadeState& s) { aov(o, s, {o.f(0), 0, 0, 0}); }

const Op kOps[] = {
    {"mix_weights", "ff", "ff", 0, OpKind::kPure, mix_weights},
    {"emission", "", "fvf", 0, OpKind::kClosure, emission, kAddsEmission},
    {"transparent", "", "fv", 0, OpKind::kClosure, transparent, kAddsTransparency},
    {"ray_portal", "", "fvvv", 1, OpKind::kClosure, ray_portal, kAddsLobe | kAddsTransparency | kSeesPoint},
    {"alpha", "", "ff", 0, OpKind::kClosure, alpha, kAddsTransparency},
    {"holdout", "", "f", 0, OpKind::kClosure, holdout, kAddsLobe},
    {"diffuse", "", "fvfv", 0, OpKind::kClosure, diffuse, kAddsLobe},
    {"subsurface", "", "fvfvfffv", 1, OpKind::kClosure, subsurface, kAddsLobe},
    {"translucent", "", "fvv", 0, OpKind::kClosure, translucent, kAddsLobe},
    {"sheen", "", "fvfv", 0, OpKind::kClosure, sheen, kAddsLobe},
    {"velvet", "", "fvfv", 0, OpKind::kClosure, velvet, kAddsLobe},
    {"toon", "", "fvffv", 1, OpKind::kClosure, toon, kAddsLobe},
    {"glossy", "", "fvfffvv", 1, OpKind::kClosure, glossy, kAddsLobe | kMayMirror},
    {"refraction", "", "fvffv", 1, OpKind::kClosure, refraction, kAddsLobe | kMayMirror},
    {"glass", "", "fvffvff", 1, OpKind::kClosure, glass, kAddsLobe | kMayMirror},
    {"metallic", "", "fvvfffvvff", 2, OpKind::kClosure, metallic, kAddsLobe | kMayMirror},
    {"aov_color", "", "v", 1, OpKind::kClosure, aov_color, kAddsAov, any_index},
    {"aov_value", "", "f", 1, OpKind::kClosure, aov_value, kAddsAov, any_index},
};

}  // namespace

std::span<const Op> closure_ops() { return kOps; }

}  // namespace gi
