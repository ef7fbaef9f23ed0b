// The Principled BSDF of Blender 5.2 as layers, one op each, from the top down: sheen, coat, metal, glass, specular, base. Each adds
// its lobes and gives the weight that it leaves for what lies below. Models are those of Blender's manual, weights follow Cycles'
// closures. Where the wall is thin, light below the surface is diffuse on both sides.
#include "shading/closures.h"
#include "shading/ops.h"

namespace gi {
namespace {

constexpr float kCutoff = 1e-5f;

// An op's operands one after the other: outputs, inputs, immediates.
struct Reader {
  const Operands& o;
  int i = 1;  // after the output
  float f() { return o.f(i++); }
  float unit() { return clamp01(o.f(i++)); }
  float at_least(float low) { return std::max(o.f(i++), low); }
  Vec3 v() { return o.v(i++); }
  Rgb c() { return o.c(i++); }
  Rgb color() { return positive(o.c(i++)); }
  ThinFilm film() {
    const float thickness = f();
    return {thickness, at_least(1e-5f)};
  }
  bool preserves_energy() { return o.imm(i) == kMultiscatterGgx; }
};

// Adds a GGX lobe; returns what it reflects and transmits of `weight`, towards the viewer.
Rgb add_ggx(ShadeState& s, Rgb weight, GgxLobe& lobe, Vec3 n, Vec3 tangent, bool preserve_energy) {
  const Vec3 wo{0, 0, dot(n, s.point.wo)};  // albedos depend on the cosine only
  if (preserve_energy) lobe.preserve_energy(clamp01(wo.z));
  const Rgb albedo = lobe.albedo(wo);
  add_lobe(s, weight, lobe, n, tangent, &albedo);
  return weight * albedo;
}

// Where reflective caustics are left out, layers that reflect take nothing from what lies below them either.
bool reflects(const ShadeState& s) { return !(s.bsdf->without() & kNoReflectiveCaustics); }

Rgb sheen_layer(Reader r, ShadeState& s) {
  const Rgb weight = r.c();
  const Vec3 normal = normal_or_shading(s, r.v()), coat_normal = normal_or_shading(s, r.v());
  const float coat = r.unit(), amount = r.at_least(0.0f), roughness = r.unit();
  if (amount <= kCutoff) return weight;
  const Vec3 n = normalize_or(lerp(normal, coat_normal, coat), s.point.ns);
  const Sheen lobe(roughness, dot(n, s.point.wo));
  const Rgb layer = weight * r.color() * amount;
  add_lobe(s, layer, lobe, n);
  return under_layer(weight, layer * lobe.albedo({0, 0, 1}));
}

// Beer's law through a coat of unit thickness, the tint being that of perpendicular view.
Rgb coat_absorption(Rgb tint, float amount, float ior, float cos_o) {
  const float cos_t = safe_sqrt(1.0f - (1.0f - sqr(cos_o)) / sqr(ior));
  Rgb t;
  for (int i = 0; i < 3; ++i) t[i] = lerp(1.0f, std::pow(tint[i], 1.0f / std::max(cos_t, 1e-6f)), amount);
  return t;
}

Rgb coat_layer(Reader r, ShadeState& s) {
  Rgb weight = r.c();
  const Vec3 n = visible_normal(s, normal_or_shading(s, r.v()));
  const float amount = r.at_least(0.0f), alpha = sqr(r.unit()), ior = r.at_least(1.0f);
  if (amount <= kCutoff) return weight;
  GgxLobe lobe = GgxLobe::reflection(alpha, alpha, Fresnel::dielectric(ior));
  if (reflects(s)) weight = under_layer(weight, add_ggx(s, weight * amount, lobe, n, {}, true));
  const Rgb tint = r.color();
  return is_black(tint - Rgb(1.0f)) ? weight : weight * coat_absorption(tint, amount, ior, dot(n, s.point.wo));
}

Rgb metal_layer(Reader r, ShadeState& s) {
  const Rgb weight = r.c();
  const Vec3 normal = normal_or_shading(s, r.v());
  const float amount = r.unit();
  if (amount <= kCutoff) return weight;
  const Rgb color = clamp01(r.c()), tint = clamp01(r.c());
  const float roughness = r.unit(), anisotropic = r.unit(), rotation = r.f();
  const Anisotropy a = anisotropy(roughness, anisotropic, rotation, normal, r.v());
  const ThinFilm film = r.film();
  GgxLobe lobe = GgxLobe::reflection(a.alpha_x, a.alpha_y, Fresnel::f82_tint(color, tint));
  lobe.fresnel.film = film;
  add_ggx(s, weight * amount, lobe, visible_normal(s, normal), a.tangent, r.preserves_energy());
  return weight * (1.0f - amount);
}

struct Glass {
  Rgb color, tint;
  float roughness, ior;
  bool thin;
  ThinFilm film;
  explicit Glass(Reader& r)
      : color(clamp01(r.c())), tint(r.color()), roughness(r.unit()), ior(r.at_least(1e-5f)), thin(r.f() != 0.0f), film(r.film()) {}
};

void add_glass(ShadeState& s, const Glass& g, Vec3 n, Rgb weight, bool preserve_energy) {
  const float eta = s.point.backfacing ? 1.0f / g.ior : g.ior;
  // The light passes the surface twice on its way through: each time half of the colour.
  const Rgb tint{std::sqrt(g.color.r()), std::sqrt(g.color.g()), std::sqrt(g.color.b())};
  const float film_ior = s.point.backfacing ? g.film.ior / g.ior : g.film.ior;
  const Fresnel f = Fresnel::schlick(eta, g.tint * f0_from_ior(g.ior), Rgb(1.0f), Rgb(1.0f), tint).with_film(g.film.thickness, film_ior);
  GgxLobe lobe = GgxLobe::glass(sqr(g.roughness), f);
  add_ggx(s, weight, lobe, n, {}, preserve_energy);
}

struct ThinSheet {
  Rgb reflectance, transmittance;
};

// All bounces between the two sides of a thin sheet, as geometric series. [OpenPBR, thin-walled case]
ThinSheet thin_sheet(const Glass& g, float cos_o) {
  const auto side = [&](float ior, float film_ior, float cos_side) {
    const Fresnel bare = Fresnel::schlick(ior, g.tint * f0_from_ior(g.ior), Rgb(1.0f), Rgb(1.0f), Rgb(1.0f));
    return bare.with_film(g.film.thickness, film_ior)(cos_side);
  };
  const float cos_t2 = 1.0f - (1.0f - sqr(cos_o)) / sqr(g.ior), cos_t = safe_sqrt(cos_t2);
  const FresnelTerms top = side(g.ior, g.film.ior, cos_o);
  const FresnelTerms bottom = g.film ? side(1.0f / g.ior, g.film.ior / g.ior, cos_t) : top;
  ThinSheet sheet;
  for (int i = 0; i < 3; ++i) {
    const float through = cos_t > 0.0f ? std::pow(g.color[i], 1.0f / cos_t) : 0.0f;
    const float r2 = bottom.reflectance[i] * through;
    sheet.transmittance[i] = safe_divide(through * top.transmittance[i] * bottom.transmittance[i], 1.0f - sqr(r2));
    sheet.reflectance[i] = top.reflectance[i] + sheet.transmittance[i] * r2;
  }
  return sheet;
}

// A rough sheet blurs what it lets through by two refractions. [Kulla & Conty 2017, p. 40]
float thin_transmission_alpha(float alpha, float ior) {
  return clamp01(alpha * safe_sqrt(3.4f * (ior - 1.0f) * sqr(ior - 0.5f) / (sqr(ior) * ior)));
}

void add_thin_glass(ShadeState& s, const Glass& g, Vec3 n, Rgb weight) {
  const float cos_o = clamp01(dot(n, s.point.wo)), alpha = sqr(g.roughness);
  const ThinSheet sheet = thin_sheet(g, cos_o);
  GgxLobe mirror = GgxLobe::reflection(alpha, alpha, Fresnel::none());
  mirror.preserve_energy(cos_o, g.tint);
  add_lobe(s, weight * sheet.reflectance, mirror, n);
  add_lobe(s, weight * sheet.transmittance, ThinTransmission(thin_transmission_alpha(alpha, g.ior), cos_o), n);
}

Rgb glass_layer(Reader r, ShadeState& s) {
  const Rgb weight = r.c();
  const Vec3 n = visible_normal(s, normal_or_shading(s, r.v()));
  const float amount = r.unit();
  if (amount <= kCutoff) return weight;
  const Glass g(r);
  g.thin ? add_thin_glass(s, g, n, weight * amount) : add_glass(s, g, n, weight * amount, r.preserves_energy());
  return weight * (1.0f - amount);
}

// The index of refraction that has `level` twice times the reflectance of `ior`.
float specular_index(float ior, float level) {
  if (level == 0.5f) return ior;
  const float eta = ior_from_f0(f0_from_ior(ior) * 2.0f * level);
  return ior < 1.0f ? 1.0f / eta : eta;
}

Rgb specular_layer(Reader r, ShadeState& s) {
  const Rgb weight = r.c();
  if (!reflects(s)) return weight;
  const Vec3 normal = normal_or_shading(s, r.v());
  const float roughness = r.unit(), ior = r.at_least(1e-5f), level = r.at_least(0.0f);
  const float f0 = f0_from_ior(ior) * (level != 0.5f ? 2.0f * level : 1.0f), eta = specular_index(ior, level);
  const Rgb tint = r.color();
  const float anisotropic = r.unit(), rotation = r.f();
  const Anisotropy a = anisotropy(roughness, anisotropic, rotation, normal, r.v());
  const ThinFilm film = r.film();
  if (eta == 1.0f && !film) return weight;
  GgxLobe lobe = GgxLobe::reflection(a.alpha_x, a.alpha_y, Fresnel::schlick(eta, tint * f0, Rgb(1.0f), Rgb(1.0f), Rgb()));
  lobe.fresnel.film = film;
  return under_layer(weight, add_ggx(s, weight, lobe, visible_normal(s, normal), a.tangent, r.preserves_energy()));
}

void base_layer(Reader r, ShadeState& s) {
  const Rgb weight = r.c();
  const Vec3 n = normal_or_shading(s, r.v());
  const Rgb color = r.color();
  const float roughness = r.unit(), amount = r.unit(), anisotropy = r.f();
  const bool thin = r.f() != 0.0f;
  if (amount > 0.0f) {
    const Rgb c = clamp01(color), subsurface = c * weight * amount;
    if (thin) {
      const float forward = clamp01(0.5f * (1.0f + anisotropy)), back = clamp01(0.5f * (1.0f - anisotropy));
      add_diffuse(s, subsurface * back, c, roughness, n);
      if (roughness < kCutoff)
        add_lobe(s, subsurface * forward, Translucent{}, n);
      else
        add_lobe(s, subsurface * forward, OrenNayar(c, roughness, true), n);
    } else {
      Subsurface below;
      below.weight = subsurface, below.albedo = c, below.anisotropy = anisotropy, below.normal = visible_normal(s, n);
      below.radius = r.color();
      below.radius *= r.at_least(0.0f);
      below.alpha = sqr(r.unit());
      const float ior = r.at_least(1e-5f), level = r.at_least(0.0f), skin_ior = r.f();
      below.method = SubsurfaceMethod(r.o.imm(r.i));
      const bool skin = below.method == SubsurfaceMethod::kSkin;
      below.ior = skin ? skin_ior : specular_index(ior, level);
      if (skin) below.alpha = 1.0f;
      add_subsurface(s, below, n);
    }
  }
  add_diffuse(s, color * weight * (1.0f - amount), color, roughness, n);
}

template <Rgb (*Layer)(Reader, ShadeState&)>
void layer(const Operands& o, ShadeState& s) {
  o.set(0, s.bsdf && !is_black(o.c(1)) ? Layer(Reader{o}, s) : o.c(1));
}

// Inputs begin with the weight from above and the normal.
const Op kOps[] = {
    // coat normal; coat, sheen, roughness, tint
    {"sheen_layer", "v", "vvvfffv", 0, OpKind::kClosure, layer<sheen_layer>, kAddsLobe | kSeesPoint},
    // coat, roughness, ior, tint
    {"coat_layer", "v", "vvfffv", 0, OpKind::kClosure, layer<coat_layer>, kAddsLobe | kSeesPoint},
    // metallic, color, tint, roughness, anisotropic, rotation, tangent, film thickness, film ior; distribution
    {"metal_layer", "v", "vvfvvfffvff", 1, OpKind::kClosure, layer<metal_layer>, kAddsLobe | kSeesPoint | kMayMirror},
    // transmission, color, tint, roughness, ior, thin, film thickness, film ior; distribution
    {"glass_layer", "v", "vvfvvfffff", 1, OpKind::kClosure, layer<glass_layer>, kAddsLobe | kSeesPoint | kMayMirror},
    // roughness, ior, level, tint, anisotropic, rotation, tangent, film thickness, film ior; distribution
    {"specular_layer", "v", "vvfffvffvff", 1, OpKind::kClosure, layer<specular_layer>, kAddsLobe | kSeesPoint},
    // color, roughness, subsurface, its anisotropy, thin, radius, scale, surface roughness, ior, level, ior of skin; method
    {"base_layer", "", "vvvffffvfffff", 1, OpKind::kClosure,
     [](const Operands& o, ShadeState& s) {
       if (s.bsdf && !is_black(o.c(0))) base_layer(Reader{o, 0}, s);
     },
     kAddsLobe},
};

}  // namespace

std::span<const Op> principled_ops() { return kOps; }

}  // namespace gi
