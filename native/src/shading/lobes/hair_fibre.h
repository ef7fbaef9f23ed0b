// What scattering by fibres is made of: angles about the fibre's axis, scattering along it and around it.
// A fibre scatters to all sides: which side of the surface's normal a direction is on means nothing to it.
// [Marschner et al. 2003, "Light scattering from human hair fibers"; d'Eon et al. 2011, "An energy-conserving hair reflectance model"]
#pragma once
#include "shading/lobes/lobe.h"

namespace gi {

inline float cos_of_sin(float s) { return safe_sqrt(1.0f - s * s); }
inline float asin_safe(float s) { return std::asin(std::clamp(s, -1.0f, 1.0f)); }

// To [−π, π].
inline float wrapped_angle(float a) { return a - 2.0f * kPi * std::floor((a + kPi) / (2.0f * kPi)); }

// ln I0(x), the modified Bessel function of order 0. [Abramowitz & Stegun 1964, 9.6.12 and 9.7.1]
inline float log_bessel_i0(float x) {
  if (x > 12.0f) return x - 0.5f * std::log(2.0f * kPi * x) + std::log(1.0f + (1.0f + 9.0f / (16.0f * x)) / (8.0f * x));
  const float q = 0.25f * x * x;
  float term = 1.0f, sum = 1.0f;
  for (int k = 1; k < 20; ++k) term *= q / float(k * k), sum += term;
  return std::log(sum);
}

// Scattering along the fibre, of variance v, from sin and cos of the angle of wo to those of wi: its integral over the sphere times the
// azimuth's is 1. [d'Eon et al. 2011, eq. 7, in logarithms]
inline float along_fibre(float sin_i, float cos_i, float sin_o, float cos_o, float v) {
  const float k = 1.0f / v;
  const float log_sinh2 = k > 10.0f ? k : std::log(2.0f * std::sinh(k));
  return std::exp(log_bessel_i0(cos_i * cos_o * k) - sin_i * sin_o * k - log_sinh2) * k;
}
// sin θi by it. [d'Eon et al. 2013, "Importance sampling for physically-based hair fiber models"]
inline float sample_along_fibre(float sin_o, float cos_o, float v, Vec2 u) {
  const float c = 1.0f + v * std::log(std::max(u.x + (1.0f - u.x) * std::exp(-2.0f / v), 1e-30f));
  return std::clamp(-c * sin_o + cos_of_sin(c) * std::cos(2.0f * kPi * u.y) * cos_o, -1.0f, 1.0f);
}

// The logistic distribution of scale s, cut to [−π, π]: scattering around the fibre. [Chiang et al. 2016, eq. 5]
struct CutLogistic {
  float s, tail;  // tail: of the whole one, below −π
  explicit CutLogistic(float scale) : s(scale), tail(1.0f / (1.0f + std::exp(std::min(kPi / scale, 80.0f)))) {}
  float density(float x) const {
    const float e = std::exp(-std::abs(x) / s);
    return e / (s * sqr(1.0f + e) * (1.0f - 2.0f * tail));
  }
  float sample(float u) const {
    const float c = tail + u * (1.0f - 2.0f * tail);
    return std::clamp(-s * std::log(std::max(1.0f / c - 1.0f, 1e-30f)), -kPi, kPi);
  }
};

// The angle by which a ray that is reflected p − 1 times within a circle leaves. [Marschner et al. 2003, eq. 3]
inline float deflection(int p, float gamma_o, float gamma_t) { return 2.0f * float(p) * gamma_t - 2.0f * gamma_o + float(p) * kPi; }

}  // namespace gi
