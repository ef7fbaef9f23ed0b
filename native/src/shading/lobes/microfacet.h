// Reflection and refraction by microfacets, Smith's shadowing, any Fresnel model; perfectly smooth ones are delta lobes.
// Energy lost by following one bounce only is put back as Blender does, by a scale (preserve_energy). No η² scaling of radiance.
#pragma once
#include "shading/lobes/fresnel.h"
#include "shading/lobes/ggx_tables.h"
#include "shading/lobes/lobe.h"
#include "shading/lobes/microfacet_distribution.h"

namespace gi {

// [Walter et al. 2007, "Microfacet models for refraction through rough surfaces"]
template <class Distribution>
struct Microfacet {
  Distribution facets;
  Fresnel fresnel;
  Rgb tint{1.0f};             // colour lost in the bounces between facets
  float energy_scale = 1.0f;  // 1 / single-scattering albedo
  uint8_t sides = kReflection;
  bool smooth = false;

  // alpha is roughness². Where the fresnel has an index, it is far side over near side.
  static Microfacet reflection(float alpha_x, float alpha_y, const Fresnel& fresnel) {
    return make(alpha_x, alpha_y, fresnel, kReflection);
  }
  static Microfacet refraction(float alpha, const Fresnel& fresnel) { return make(alpha, alpha, fresnel, kTransmission); }
  static Microfacet glass(float alpha, const Fresnel& fresnel) { return make(alpha, alpha, fresnel, kReflection | kTransmission); }

  // Puts back the energy of the bounces between facets, for a view at cos_o. `mean` is the mean reflectance that each further
  // bounce is tinted by. GGX only; reflection or glass. [Kulla & Conty 2017; Turquin 2019, "Practical multiple scattering"]
  void preserve_energy(float cos_o, Rgb mean);
  // The tint decides the colour of glass, as in Blender.
  void preserve_energy(float cos_o) { preserve_energy(cos_o, transmits() ? fresnel.transmission_tint : fresnel.mean()); }

  // Takes one side away, and its energy with it (Blender's caustics switches).
  void remove(uint8_t side) {
    sides &= ~side;
    if (side & kReflection) fresnel.reflection_tint = Rgb();
    if (side & kTransmission) fresnel.transmission_tint = Rgb();
  }
  // At least as rough as alpha; what energy it keeps is left as it was.
  void blur(float alpha) {
    facets = {std::max(facets.alpha_x, alpha), std::max(facets.alpha_y, alpha)};
    smooth = is_smooth(facets.alpha_x, facets.alpha_y, sides, fresnel);
  }
  uint8_t flags() const { return sides | (smooth ? kSpecular : kGlossy); }
  LobeEval eval(Vec3 wo, Vec3 wi) const;
  std::optional<LobeSample> sample(Vec3 wo, Vec2 u, float u_lobe) const;
  Rgb albedo(Vec3 wo) const;

 private:
  static Microfacet make(float alpha_x, float alpha_y, const Fresnel& fresnel, uint8_t sides) {
    const float ax = clamp01(alpha_x), ay = clamp01(alpha_y);
    return {.facets = {ax, ay}, .fresnel = fresnel, .sides = sides, .smooth = is_smooth(ax, ay, sides, fresnel)};
  }
  static bool is_smooth(float ax, float ay, uint8_t sides, const Fresnel& fresnel) {
    return ax * ay <= 2e-10f || ((sides & kTransmission) && straight(fresnel.ior));
  }
  bool reflects() const { return sides & kReflection; }
  bool transmits() const { return sides & kTransmission; }
  float roughness() const { return std::sqrt(std::sqrt(facets.alpha_x * facets.alpha_y)); }
  // Bending too little to tell apart from going straight on, however rough.
  static bool straight(float ior) { return std::abs(ior - 1.0f) < 1e-4f; }

  FresnelTerms terms(float cos_h) const {
    FresnelTerms f = fresnel(cos_h);
    if (!reflects()) f.reflectance = Rgb();
    if (!transmits()) f.transmittance = Rgb();
    return f;
  }
  static float pdf_reflect(const FresnelTerms& f) {
    const float r = average(f.reflectance), t = average(f.transmittance);
    return r > 0.0f ? r / (r + t) : 0.0f;
  }
  LobeEval eval_reflection(Vec3 wo, Vec3 wi, Vec3 h, const FresnelTerms& f) const;
  LobeEval eval_transmission(Vec3 wo, Vec3 wi, Vec3 h, const FresnelTerms& f) const;
};

using GgxLobe = Microfacet<Ggx>;
using BeckmannLobe = Microfacet<Beckmann>;

template <class D>
void Microfacet<D>::preserve_energy(float cos_o, Rgb mean) {
  const auto [e, e_mean] = transmits() ? ggx_glass_energy(roughness(), cos_o, fresnel.ior) : ggx_energy(roughness(), cos_o);
  const float missing = (1.0f - e) / e;
  energy_scale = 1.0f + missing;
  const Rgb bounced = mean * e_mean / (Rgb(1.0f) - mean * (1.0f - e_mean));
  tint = (Rgb(1.0f) + bounced * missing) / Rgb(energy_scale);
}

template <class D>
LobeEval Microfacet<D>::eval_reflection(Vec3 wo, Vec3 wi, Vec3 h, const FresnelTerms& f) const {
  const float d = facets.density(h), p = transmits() ? pdf_reflect(f) : is_black(f.reflectance) ? 0.0f : 1.0f;
  const float pdf = p * (transmits() ? facets.pdf_reflected(wo, d) : facets.pdf_reflected_bounded(wo, d));
  return {f.reflectance * tint * (energy_scale * d * facets.shadowing(wo, wi)), pdf};
}

template <class D>
LobeEval Microfacet<D>::eval_transmission(Vec3 wo, Vec3 wi, Vec3 h, const FresnelTerms& f) const {
  const float cos_ho = dot(h, wo), cos_hi = dot(h, wi), eta = fresnel.ior;
  const float d = facets.density(h), jacobian = 4.0f * sqr(eta / (eta * cos_hi + cos_ho)) * std::abs(cos_ho * cos_hi);
  return {f.transmittance * tint * (energy_scale * d * jacobian * facets.shadowing(wo, wi)),
          (1.0f - pdf_reflect(f)) * jacobian * facets.pdf_reflected(wo, d)};
}

template <class D>
LobeEval Microfacet<D>::eval(Vec3 wo, Vec3 wi) const {
  if (smooth || wo.z <= 0.0f || wi.z == 0.0f) return {};
  if (wi.z > 0.0f) {
    if (!reflects()) return {};
    const Vec3 h = normalize(wo + wi);
    return eval_reflection(wo, wi, h, terms(dot(h, wo)));
  }
  if (!transmits()) return {};
  Vec3 h = normalize(wo + wi * fresnel.ior);
  if (h.z < 0.0f) h = -h;
  if (dot(h, wo) <= 0.0f || dot(h, wi) >= 0.0f) return {};  // no facet bends wo into wi
  const FresnelTerms f = terms(dot(h, wo));
  return is_black(f.transmittance) ? LobeEval{} : eval_transmission(wo, wi, h, f);
}

template <class D>
std::optional<LobeSample> Microfacet<D>::sample(Vec3 wo, Vec2 u, float u_lobe) const {
  if (wo.z <= 0.0f) return {};
  const Vec3 h = smooth ? Vec3{0, 0, 1} : transmits() ? facets.sample_visible(wo, u) : facets.sample_visible_bounded(wo, u);
  const float cos_ho = dot(h, wo);
  const FresnelTerms f = terms(cos_ho);
  if (cos_ho <= 0.0f || (is_black(f.reflectance) && is_black(f.transmittance))) return {};
  const float p = pdf_reflect(f), alpha = std::sqrt(facets.alpha_x * facets.alpha_y);

  if (u_lobe < p) {
    const Vec3 wi = reflect(wo, h);
    if (wi.z <= 0.0f) return {};
    if (smooth) return LobeSample{wi, f.reflectance * tint * energy_scale, p, kReflection | kSpecular, 0.0f};
    const LobeEval e = eval_reflection(wo, wi, h, f);
    return LobeSample{wi, e.value, e.pdf_dir, kReflection | kGlossy, alpha};
  }
  const float inv_eta = 1.0f / fresnel.ior, cos_t = safe_sqrt(1.0f - (1.0f - cos_ho * cos_ho) * inv_eta * inv_eta);
  const Vec3 wi = normalize((inv_eta * cos_ho - cos_t) * h - inv_eta * wo);
  if (wi.z >= 0.0f) return {};
  if (smooth) return LobeSample{wi, f.transmittance * tint * energy_scale, 1.0f - p, kTransmission | kSpecular, 0.0f};
  const LobeEval e = eval_transmission(wo, wi, h, f);
  return LobeSample{wi, e.value, e.pdf_dir, kTransmission | kGlossy, alpha};
}

// As Blender estimates it (its layers of the Principled BSDF are weighted by this): no loss but Fresnel's, and that of the smooth
// surface where there is a film.
template <class D>
Rgb Microfacet<D>::albedo(Vec3 wo) const {
  const float cos_o = std::max(wo.z, 0.0f);
  const bool film(fresnel.film);
  if (fresnel.model == Fresnel::Model::kSchlick && !film) {
    const float s = fresnel.exponent < 0.0f ? ggx_dielectric_weight(roughness(), cos_o, fresnel.ior)
                                            : ggx_schlick_weight(roughness(), cos_o, fresnel.exponent);
    const Rgb f = lerp(fresnel.f0, fresnel.f90, s);
    return tint *
           ((reflects() ? f * fresnel.reflection_tint : Rgb()) + (transmits() ? (Rgb(1.0f) - f) * fresnel.transmission_tint : Rgb()));
  }
  if (fresnel.model == Fresnel::Model::kF82 && !film)
    return tint * lerp(fresnel.f0, Rgb(1.0f), ggx_schlick_weight(roughness(), cos_o, 5.0f));
  if (fresnel.model == Fresnel::Model::kDielectric && fresnel.ior > 1.0f && reflects()) {
    const float f = lerp(f0_from_ior(fresnel.ior), 1.0f, ggx_dielectric_weight(roughness(), cos_o, fresnel.ior));
    return tint * (transmits() ? fresnel.reflection_tint * f + fresnel.transmission_tint * (1.0f - f) : fresnel.reflection_tint * f);
  }
  const FresnelTerms f = terms(cos_o);
  return tint * (f.reflectance + f.transmittance);
}

}  // namespace gi
