// Layers of the Principled BSDF from the top down, each weighted by what the ones above let through; see principled.h.
// The models are those of Blender's manual; the weights follow Cycles' closures, so that the engines agree.
#include "shading/principled.h"

namespace gi {
namespace {

constexpr float kCutoff = 1e-5f;

// Adds a GGX lobe; returns what it reflects and transmits of `weight`, towards the viewer.
Rgb add_ggx(ShadeState& s, Rgb weight, GgxLobe lobe, Vec3 n, Vec3 tangent, bool preserve_energy, bool add = true) {
  const Vec3 wo{0, 0, dot(n, s.point.wo)};  // albedos depend on the cosine only
  if (preserve_energy) lobe.preserve_energy(clamp01(wo.z));
  const Rgb albedo = lobe.albedo(wo);
  if (add) add_lobe(s, weight, lobe, n, tangent, &albedo);
  return weight * albedo;
}

Rgb add_sheen(ShadeState& s, const PrincipledTop& p, Vec3 normal, Vec3 coat_normal, Rgb weight, bool add) {
  const Vec3 n = normalize_or(lerp(normal, coat_normal, clamp01(p.coat_weight)), s.point.ns);
  const Sheen lobe(p.sheen_roughness, dot(n, s.point.wo));
  const Rgb layer = weight * p.sheen_tint * p.sheen_weight;
  if (add) add_lobe(s, layer, lobe, n);
  return under_layer(weight, layer * lobe.albedo({0, 0, 1}));
}

// Beer's law through a coat of unit thickness, the tint being that of perpendicular view.
Rgb coat_absorption(const PrincipledTop& p, float cos_o) {
  const float cos_t = safe_sqrt(1.0f - (1.0f - sqr(cos_o)) / sqr(p.coat_ior));
  Rgb t;
  for (int i = 0; i < 3; ++i) t[i] = lerp(1.0f, std::pow(p.coat_tint[i], 1.0f / std::max(cos_t, 1e-6f)), p.coat_weight);
  return t;
}

// Where reflective caustics are left out, layers that reflect take nothing from what lies below them either.
bool reflects(const ShadeState& s) { return !(s.bsdf->without() & kNoReflectiveCaustics); }

Rgb add_coat(ShadeState& s, const PrincipledTop& p, Vec3 coat_normal, Rgb weight, bool add) {
  const Vec3 n = visible_normal(s, coat_normal);
  const float alpha = sqr(p.coat_roughness);
  const GgxLobe lobe = GgxLobe::reflection(alpha, alpha, Fresnel::dielectric(p.coat_ior));
  if (reflects(s)) weight = under_layer(weight, add_ggx(s, weight * p.coat_weight, lobe, n, {}, true, add));
  return is_black(p.coat_tint - Rgb(1.0f)) ? weight : weight * coat_absorption(p, dot(n, s.point.wo));
}

void add_metal(ShadeState& s, const Principled& p, Vec3 n, Rgb weight) {
  const Anisotropy a = anisotropy(p.roughness, p.anisotropic, p.anisotropic_rotation, p.normal, p.tangent);
  const Fresnel f = Fresnel::f82_tint(clamped(p.base_color), clamped(p.specular_tint)).with_film(p.film_thickness, p.film_ior);
  add_ggx(s, weight, GgxLobe::reflection(a.alpha_x, a.alpha_y, f), n, a.tangent, p.preserve_energy);
}

void add_glass(ShadeState& s, const Principled& p, Vec3 n, Rgb weight) {
  const float eta = s.point.backfacing ? 1.0f / p.ior : p.ior;
  const Rgb f0 = p.specular_tint * f0_from_ior(p.ior), c = clamped(p.base_color);
  // The light passes the surface twice on its way through: each time half of the colour.
  const Rgb tint{std::sqrt(c.r), std::sqrt(c.g), std::sqrt(c.b)};
  const float film_ior = s.point.backfacing ? p.film_ior / p.ior : p.film_ior;
  const Fresnel f = Fresnel::schlick(eta, f0, Rgb(1.0f), Rgb(1.0f), tint).with_film(p.film_thickness, film_ior);
  add_ggx(s, weight, GgxLobe::glass(sqr(p.roughness), f), n, {}, p.preserve_energy);
}

struct ThinSheet {
  Rgb reflectance, transmittance;
};

// All bounces between the two sides of a thin sheet, as geometric series. [OpenPBR, thin-walled case]
ThinSheet thin_sheet(const Principled& p, float cos_o) {
  const Rgb f0 = p.specular_tint * f0_from_ior(p.ior), c = clamped(p.base_color);
  const auto side = [&](float ior, float film_ior, float cos_side) {
    return Fresnel::schlick(ior, f0, Rgb(1.0f), Rgb(1.0f), Rgb(1.0f)).with_film(p.film_thickness, film_ior)(cos_side);
  };
  const float cos_t2 = 1.0f - (1.0f - sqr(cos_o)) / sqr(p.ior), cos_t = safe_sqrt(cos_t2);
  const FresnelTerms top = side(p.ior, p.film_ior, cos_o);
  const FresnelTerms bottom = ThinFilm{p.film_thickness, p.film_ior} ? side(1.0f / p.ior, p.film_ior / p.ior, cos_t) : top;
  ThinSheet sheet;
  for (int i = 0; i < 3; ++i) {
    const float through = cos_t > 0.0f ? std::pow(c[i], 1.0f / cos_t) : 0.0f;
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

void add_thin_glass(ShadeState& s, const Principled& p, Vec3 n, Rgb weight) {
  const float cos_o = clamp01(dot(n, s.point.wo)), alpha = sqr(p.roughness);
  const ThinSheet sheet = thin_sheet(p, cos_o);
  GgxLobe mirror = GgxLobe::reflection(alpha, alpha, Fresnel::none());
  mirror.preserve_energy(cos_o, p.specular_tint);
  add_lobe(s, weight * sheet.reflectance, mirror, n);
  ThinTransmission through(thin_transmission_alpha(alpha, p.ior), cos_o);
  add_lobe(s, weight * sheet.transmittance, through, n);
}

// Returns the weight for what lies under the specular layer.
Rgb add_specular(ShadeState& s, const Principled& p, Vec3 n, Rgb weight) {
  float f0 = f0_from_ior(p.ior), eta = p.ior;
  if (p.specular_level != 0.5f) {
    f0 *= 2.0f * p.specular_level;
    eta = p.ior < 1.0f ? 1.0f / ior_from_f0(f0) : ior_from_f0(f0);
  }
  if (!reflects(s) || (eta == 1.0f && !ThinFilm{p.film_thickness, p.film_ior})) return weight;
  const Anisotropy a = anisotropy(p.roughness, p.anisotropic, p.anisotropic_rotation, p.normal, p.tangent);
  const Fresnel bare = Fresnel::schlick(eta, p.specular_tint * f0, Rgb(1.0f), Rgb(1.0f), Rgb());
  const Fresnel f = bare.with_film(p.film_thickness, p.film_ior);
  return under_layer(weight, add_ggx(s, weight, GgxLobe::reflection(a.alpha_x, a.alpha_y, f), n, a.tangent, p.preserve_energy));
}

void add_base(ShadeState& s, const Principled& p, Rgb weight) {
  const Rgb c = clamped(p.base_color), subsurface = c * weight * p.subsurface_weight;
  if (p.thin_wall) {
    const float forward = clamp01(0.5f * (1.0f + p.subsurface_anisotropy)), back = clamp01(0.5f * (1.0f - p.subsurface_anisotropy));
    add_diffuse(s, subsurface * back, c, p.diffuse_roughness, p.normal);
    if (p.diffuse_roughness < kCutoff)
      add_lobe(s, subsurface * forward, Translucent{}, p.normal);
    else
      add_lobe(s, subsurface * forward, OrenNayar(c, p.diffuse_roughness, true), p.normal);
  } else {
    add_diffuse(s, subsurface, c, 0.0f, p.normal);
  }
  add_diffuse(s, p.base_color * weight * (1.0f - p.subsurface_weight), p.base_color, p.diffuse_roughness, p.normal);
}

}  // namespace

Rgb add_top_layers(ShadeState& s, const PrincipledTop& p, Vec3 normal, Rgb weight, bool add) {
  const Vec3 coat_normal = normal_or_shading(s, p.coat_normal);
  if (p.sheen_weight > kCutoff) weight = add_sheen(s, p, normal, coat_normal, weight, add);
  if (p.coat_weight > kCutoff) weight = add_coat(s, p, coat_normal, weight, add);
  return weight;
}

void add_principled(ShadeState& s, const Principled& p, Rgb weight) {
  weight = add_top_layers(s, p.top, p.normal, weight, true);
  const Vec3 n = visible_normal(s, p.normal);
  if (p.metallic > kCutoff) {
    add_metal(s, p, n, weight * p.metallic);
    weight *= 1.0f - p.metallic;
    if (is_black(weight)) return;
  }
  if (p.transmission > kCutoff) {
    const Rgb share = weight * p.transmission;
    p.thin_wall ? add_thin_glass(s, p, n, share) : add_glass(s, p, n, share);
    weight *= 1.0f - p.transmission;
    if (is_black(weight)) return;
  }
  add_base(s, p, add_specular(s, p, n, weight));
}

}  // namespace gi
