// Distributions of microfacet normals: density D, Smith's shadowing G2, and drawing the normals visible from wo.
// Directions are local, z the mean normal, wo.z > 0. Leaves out Fresnel and everything a BSDF adds (microfacet.h).
#pragma once
#include "core/vec.h"
#include "core/warp.h"

namespace gi {

struct Ggx {
  float alpha_x = 0, alpha_y = 0;

  float density(Vec3 h) const {
    const float s = alpha_x * alpha_y;
    const float t = alpha_x == alpha_y ? h.x * h.x + h.y * h.y : h.x * h.x * (alpha_y / alpha_x) + h.y * h.y * (alpha_x / alpha_y);
    return s * kInvPi / sqr(t + h.z * h.z * s);
  }
  // G2 / (4 wo.z), height-correlated. [Heitz 2014, "Understanding the masking-shadowing function", eq. 72 and 99]
  float shadowing(Vec3 wo, Vec3 wi) const {
    const float zi = std::abs(wi.z);
    return 0.5f * zi / (stretched(wo) * zi + stretched(wi) * wo.z);
  }

  // Visible normals by a spherical cap. [Dupuy & Benyoub 2023, "Sampling visible GGX normals with spherical caps"]
  Vec3 sample_visible(Vec3 wo, Vec2 u) const { return sample_cap(wo, u, 1.0f); }
  // pdf of the reflected direction: D G1 / (4 wo.z). `d` is the density of the normal that sample_visible returned.
  float pdf_reflected(Vec3 wo, float d) const { return 0.5f * d / (wo.z + stretched(wo)); }

  // The same without most normals that would reflect below the surface. [Eto & Tokuyoshi 2023, "Bounded VNDF sampling for Smith–GGX
  // reflections"]
  Vec3 sample_visible_bounded(Vec3 wo, Vec2 u) const { return sample_cap(wo, u, bound(wo)); }
  float pdf_reflected_bounded(Vec3 wo, float d) const { return 0.5f * d / (bound(wo) * wo.z + stretched(wo)); }

 private:
  float stretched(Vec3 v) const { return std::sqrt(sqr(alpha_x * v.x) + sqr(alpha_y * v.y) + v.z * v.z); }
  float bound(Vec3 wo) const {
    const float a2 = sqr(std::min({alpha_x, alpha_y, 1.0f})), s2 = sqr(1.0f + std::sqrt(wo.x * wo.x + wo.y * wo.y));
    return (1.0f - a2) * s2 / (s2 + a2 * wo.z * wo.z);
  }
  Vec3 sample_cap(Vec3 wo, Vec2 u, float k) const {
    const Vec3 v = normalize(Vec3{alpha_x * wo.x, alpha_y * wo.y, wo.z});
    const SinCos phi = sincos_turns(u.x);
    const float z = (1.0f - u.y) * (1.0f + k * v.z) - k * v.z, s = safe_sqrt(1.0f - z * z);
    const Vec3 h{s * phi.cos + v.x, s * phi.sin + v.y, z + v.z};
    return normalize_or({alpha_x * h.x, alpha_y * h.y, std::max(h.z, 0.0f)}, {0, 0, 1});
  }
};

// Inverse error function. [Giles 2012, "Approximating the erfinv function", single precision]
inline float erf_inverse(float x) {
  float w = -std::log(std::max((1.0f - x) * (1.0f + x), 1e-38f)), p;
  if (w < 5.0f) {
    w -= 2.5f;
    p = 2.81022636e-08f, p = 3.43273939e-07f + p * w, p = -3.5233877e-06f + p * w, p = -4.39150654e-06f + p * w;
    p = 0.00021858087f + p * w, p = -0.00125372503f + p * w, p = -0.00417768164f + p * w;
    p = 0.246640727f + p * w, p = 1.50140941f + p * w;
  } else {
    w = std::sqrt(w) - 3.0f;
    p = -0.000200214257f, p = 0.000100950558f + p * w, p = 0.00134934322f + p * w, p = -0.00367342844f + p * w;
    p = 0.00573950773f + p * w, p = -0.0076224613f + p * w, p = 0.00943887047f + p * w;
    p = 1.00167406f + p * w, p = 2.83297682f + p * w;
  }
  return p * x;
}

struct Beckmann {
  float alpha_x = 0, alpha_y = 0;

  float density(Vec3 h) const {
    const float c2 = h.z * h.z;
    return std::exp(-(sqr(h.x / alpha_x) + sqr(h.y / alpha_y)) / c2) * kInvPi / (alpha_x * alpha_y * c2 * c2);
  }
  // Smith's Λ. Exact, not the usual rational fit: the density of visible normals must be the one that is sampled. [Heitz 2014, eq. 67]
  float lambda(Vec3 v) const {
    const float tan2 = (sqr(alpha_x * v.x) + sqr(alpha_y * v.y)) / (v.z * v.z);
    if (tan2 < 1.0f / 16.0f) return 0.0f;  // below 1e-9 there
    const float a = 1.0f / std::sqrt(tan2);
    return std::max(0.5f * (std::exp(-a * a) * 0.56418958f / a - std::erfc(a)), 0.0f);
  }
  float shadowing(Vec3 wo, Vec3 wi) const { return 0.25f / (wo.z * (1.0f + lambda(wo) + lambda(wi))); }

  Vec3 sample_visible(Vec3 wo, Vec2 u) const {
    const Vec3 v = normalize(Vec3{alpha_x * wo.x, alpha_y * wo.y, wo.z});
    const float sin_v = std::sqrt(v.x * v.x + v.y * v.y);
    if (sin_v < 1e-3f * v.z) {
      const float r = std::sqrt(-std::log(1.0f - u.x)), phi = 2.0f * kPi * u.y;
      return normalize(Vec3{alpha_x * r * std::cos(phi), alpha_y * r * std::sin(phi), 1.0f});
    }
    const float slope = sample_slope(sin_v / v.z, u.x), across = erf_inverse(std::clamp(2.0f * u.y - 1.0f, -0.9999999f, 0.9999999f));
    const float c = v.x / sin_v, s = v.y / sin_v;
    return normalize(Vec3{-alpha_x * (c * slope - s * across), -alpha_y * (s * slope + c * across), 1.0f});
  }
  float pdf_reflected(Vec3 wo, float d) const { return d / (4.0f * wo.z * (1.0f + lambda(wo))); }
  Vec3 sample_visible_bounded(Vec3 wo, Vec2 u) const { return sample_visible(wo, u); }
  float pdf_reflected_bounded(Vec3 wo, float d) const { return pdf_reflected(wo, d); }

 private:
  // The visible slope along wo, by inverting 1 + b + tan θ/√π exp(−erf⁻¹(b)²) over b = erf(slope). [Jakob 2014, "An improved
  // visible normal sampling routine for the Beckmann distribution"]
  static float sample_slope(float tan_theta, float u) {
    const float k = tan_theta * 0.56418958f, cot = 1.0f / tan_theta;
    const float top = std::erf(cot), total = 1.0f + top + k * std::exp(-cot * cot);
    float lo = -1.0f, hi = top, x = 0;
    // Start where exp(−erf⁻¹(b)²) ≈ 1 − b² would put it.
    float b = (0.5f - safe_sqrt(k * (k + 1.0f - u * (1.0f + top + k * (1.0f - top * top))) + 0.25f)) / k;
    if (!(b > lo && b < hi)) b = lerp(lo, hi, u);
    for (int i = 0; i < 24; ++i) {
      x = erf_inverse(b);
      const float f = 1.0f + b + k * std::exp(-x * x) - u * total;
      if (std::abs(f) < 1e-6f * total || hi - lo < 1e-7f) break;
      (f > 0.0f ? hi : lo) = b;
      const float next = b - f / (1.0f - x * tan_theta);
      b = next > lo && next < hi ? next : 0.5f * (lo + hi);
    }
    return x;
  }
};

}  // namespace gi
