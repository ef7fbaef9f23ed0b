// What a microfacet reflects and lets through: the Fresnel models of Blender's BSDF nodes, with their cosine-weighted means.
// Leaves out polarisation.
#pragma once
#include "core/vec.h"
#include "shading/lobes/thin_film.h"

namespace gi {

// Reflectance of unpolarised light at a dielectric; `eta` is the far side's index over the near side's. 1 on total reflection.
inline float fresnel_dielectric(float cos_i, float eta) {
  const float c = std::abs(cos_i), g2 = eta * eta - 1.0f + c * c;
  if (g2 <= 0.0f) return 1.0f;
  const float g = std::sqrt(g2);  // η cos θt
  const float s = (c - g) / (c + g), p = (g - eta * eta * c) / (g + eta * eta * c);
  return 0.5f * (s * s + p * p);
}
inline float f0_from_ior(float ior) { return sqr((ior - 1.0f) / (ior + 1.0f)); }
inline float ior_from_f0(float f0) {
  const float s = std::sqrt(std::clamp(f0, 0.0f, 0.99f));
  return (1.0f + s) / (1.0f - s);
}
// ∫ 2 cos θ F dcos θ of a dielectric. [Kulla & Conty 2017, "Revisiting physically based shading at Imageworks", fits]
inline float fresnel_dielectric_mean(float eta) {
  if (eta < 1.0f) return 0.997118f + eta * (0.1014f - eta * (0.965241f + eta * 0.130607f));
  return (eta - 1.0f) / (4.08567f + 1.00071f * eta);
}
// [Born & Wolf 1999, §14.4.1] with the index n + ik.
inline float fresnel_conductor(float cos_i, float n, float k) {
  const float c2 = cos_i * cos_i, t = n * n - k * k - (1.0f - c2);
  const float r = std::sqrt(t * t + sqr(2.0f * n * k));
  const float u2 = std::max(0.5f * (r + t), 0.0f), v2 = std::max(0.5f * (r - t), 0.0f);
  const float u = std::sqrt(u2), v = std::sqrt(v2);
  const float s = safe_divide(sqr(cos_i - u) + v2, sqr(cos_i + u) + v2);
  const float a = (n * n - k * k) * cos_i, b = 2.0f * n * k * cos_i;
  const float p = safe_divide(sqr(a - u) + sqr(b - v), sqr(a + u) + sqr(b + v));
  return 0.5f * (s + p);
}

struct FresnelTerms {
  Rgb reflectance, transmittance;
};

struct Fresnel {
  enum class Model : uint8_t { kNone, kDielectric, kSchlick, kF82, kConductor };

  Model model = Model::kNone;
  float ior = 1.0f;  // far side over near side: already inverted on back faces
  Rgb f0{}, f90{};     // kSchlick: reflectance head-on and grazing; kF82: f0 and the edge term b; kConductor: n and k
  Rgb reflection_tint{1.0f}, transmission_tint{1.0f};
  ThinFilm film{};         // kSchlick along the real curve, kF82, kConductor
  float exponent = -1.0f;  // kSchlick: of (1 − cos); negative: follow the real curve of `ior` from f0 to f90
  float lowest = 0, steepness = 1;  // of the real curve: its value head-on, and one over what is left to 1

  static Fresnel none(float ior = 1.0f) { return {.ior = ior}; }
  static Fresnel dielectric(float ior) { return {.model = Model::kDielectric, .ior = ior}; }
  static Fresnel conductor(Rgb n, Rgb k) { return {.model = Model::kConductor, .f0 = n, .f90 = k}; }
  // Schlick's curve scaled at 82° by `tint`. [Kutz et al. 2021, "Novel aspects of the Adobe Standard Material", eq. 10]
  static Fresnel f82_tint(Rgb f0, Rgb tint) {
    const float f = 6.0f / 7.0f, f5 = f * f * f * f * f;
    return {.model = Model::kF82, .f0 = f0, .f90 = lerp(f0, Rgb(1.0f), f5) * (7.0f / (f5 * f)) * (Rgb(1.0f) - tint)};
  }
  // `transmission_tint` black for lobes that only reflect.
  static Fresnel schlick(float ior, Rgb f0, Rgb f90, Rgb reflection_tint, Rgb transmission_tint, float exponent = -1.0f) {
    const float head_on = f0_from_ior(ior);
    return {.model = Model::kSchlick,
            .ior = ior,
            .f0 = clamp01(f0),
            .f90 = f90,
            .reflection_tint = reflection_tint,
            .transmission_tint = transmission_tint,
            .exponent = exponent,
            .lowest = head_on < 1.0f ? head_on : -1.0f,  // nothing between the two: f90 at once
            .steepness = head_on < 1.0f ? 1.0f / (1.0f - head_on) : 1.0f};
  }

  Fresnel with_film(float thickness, float film_ior) const {
    Fresnel f = *this;
    f.film = {thickness, film_ior};
    return f;
  }

  FresnelTerms operator()(float cos_h) const;
  // Mean of the reflectance over the hemisphere: what multiple scattering between facets is coloured by.
  Rgb mean() const;
  static Rgb f82(float cos_i, Rgb f0, Rgb b) {
    const float s = clamp01(1.0f - cos_i), s5 = s * s * s * s * s;
    return clamp01(lerp(f0, Rgb(1.0f), s5) - b * (cos_i * s5 * s));
  }

 private:
  float schlick_weight(float cos_h) const;
  Rgb film_dielectric(float cos_h) const;
  Rgb film_f82(float cos_h) const;
  Rgb film_conductor(float cos_h) const;
  static Rgb f82_mean(Rgb f0, Rgb b) { return lerp(f0, Rgb(1.0f), 1.0f / 21.0f) - b * (1.0f / 126.0f); }
  Rgb conductor_at(float c) const {
    return {fresnel_conductor(c, f0.r(), f90.r()), fresnel_conductor(c, f0.g(), f90.g()), fresnel_conductor(c, f0.b(), f90.b())};
  }
};

// How far from f0 to f90.
inline float Fresnel::schlick_weight(float cos_h) const {
  if (exponent < 0.0f) return clamp01((fresnel_dielectric(cos_h, ior) - lowest) * steepness);
  const float cos_t = safe_sqrt(1.0f - (1.0f - cos_h * cos_h) / (ior * ior));
  return std::pow(1.0f - (ior < 1.0f ? cos_t : cos_h), exponent);  // the wider of the two angles
}

// The head-on colour f0 scales what is reflected, but less so the nearer it is to all: Blender's way, for artists.
inline Rgb Fresnel::film_dielectric(float cos_h) const {
  Rgb f = film_reflectance(cos_h, film, ior);
  const float real = f0_from_ior(ior);
  if (real <= 1e-5f) return f;
  for (int i = 0; i < 3; ++i) f[i] *= lerp(1.0f, f0[i] / real, clamp01((1.0f - f[i]) / (1.0f - real)));
  return f;
}
// With n and k of a metal that looks the same head-on and at 82°. [Gulbrandsen 2014, "Artist friendly metallic Fresnel"]
inline Rgb Fresnel::film_f82(float cos_h) const {
  const Rgb edge = f82(1.0f / 7.0f, f0, f90);
  Rgb f;
  for (int i = 0; i < 3; ++i) {
    const float r = std::min(f0[i], 0.999f), s = std::sqrt(r);
    const float n = lerp((1.0f + s) / (1.0f - s), (1.0f - r) / (1.0f + r), edge[i]);
    const float k = safe_sqrt((r * sqr(n + 1.0f) - sqr(n - 1.0f)) / (1.0f - r));
    f[i] = film_reflectance(cos_h, film, {n, k, edge[i]}, i);
  }
  return f;
}
inline Rgb Fresnel::film_conductor(float cos_h) const {
  Rgb f;
  for (int i = 0; i < 3; ++i) f[i] = film_reflectance(cos_h, film, {f0[i], f90[i]}, i);
  return f;
}

inline FresnelTerms Fresnel::operator()(float cos_h) const {
  switch (model) {
    case Model::kNone:  // only a purely refracting lobe has an index here: it cannot pass total reflection
      return {Rgb(1.0f), Rgb(ior != 1.0f && ior * ior - 1.0f + cos_h * cos_h <= 0.0f ? 0.0f : 1.0f)};
    case Model::kDielectric: {
      const float f = fresnel_dielectric(cos_h, ior);
      return {reflection_tint * f, transmission_tint * (1.0f - f)};
    }
    case Model::kSchlick: {
      if (ior * ior - 1.0f + cos_h * cos_h <= 0.0f) return {exponent < 0.0f ? reflection_tint * f90 : reflection_tint, Rgb()};
      const Rgb f = film && exponent < 0.0f ? film_dielectric(cos_h) : lerp(f0, f90, schlick_weight(cos_h));
      return {f * reflection_tint, (Rgb(1.0f) - f) * transmission_tint};
    }
    case Model::kF82: return {film ? film_f82(cos_h) : f82(cos_h, f0, f90), Rgb()};
    case Model::kConductor: return {film ? film_conductor(cos_h) : conductor_at(cos_h), Rgb()};
  }
  return {};
}

inline Rgb Fresnel::mean() const {
  switch (model) {
    case Model::kNone: return Rgb(1.0f);
    case Model::kDielectric: return reflection_tint * fresnel_dielectric_mean(ior);
    case Model::kSchlick: {
      const float s =
          exponent < 0.0f ? clamp01((fresnel_dielectric_mean(ior) - lowest) * steepness) : 2.0f / ((exponent + 3.0f) * exponent + 2.0f);
      return reflection_tint * lerp(f0, f90, s);
    }
    case Model::kF82: return f82_mean(f0, f90);
    case Model::kConductor: {  // through the F82 curve with the same values head-on and at cos θ = 1/7
      const Rgb head_on = conductor_at(1.0f), edge = conductor_at(1.0f / 7.0f);
      const float f = 6.0f / 7.0f, f5 = f * f * f * f * f;
      return clamp01(f82_mean(head_on, (lerp(head_on, Rgb(1.0f), f5) - edge) * (7.0f / (f5 * f))));
    }
  }
  return Rgb(1.0f);
}

}  // namespace gi
