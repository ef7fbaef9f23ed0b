// How small particles in water scatter, of many sizes, by how their index of refraction differs from the water's and how much they send
// back. [Fournier & Forand 1994, "Analytic phase function for ocean water"; Fournier & Jonasz 1999, "Computer-based underwater imaging
// analysis"]
#pragma once
#include "core/vec.h"

namespace gi {

// All of it follows from the part that is scattered by less than an angle θ: with s = sin²(θ/2) and δ = k s,
//   P(θ) = 1 + (1 − s) E(δ) − E(k) cos θ sin² θ / 8,   E(δ) = (δ^−v − 1) / (1 − δ),
// whose last term keeps what is scattered backwards finite. v is from −1 to 0; 1 − P behaves as s^−v, with a peak ahead that is endless.
// In double precision: E is a difference of near numbers around δ = 1, and s spans many orders of magnitude.
class FournierForand {
 public:
  // `backscatter`: the part that goes backwards, below a half; `ior` relative to what is around the particles. Limits are Cycles'.
  FournierForand(float backscatter, float ior) {
    const double part = std::min(std::abs(backscatter), 0.5f - 1e-3f), n = std::max(ior, 1.0f + 1e-3f);
    const double k = 4.0 / (3.0 * (n - 1.0) * (n - 1.0));
    // That P(90°) is 1 − part.
    const double at_90 = 0.5 * k - 1.0;
    const double v = std::abs(at_90) < 1e-6 ? -2.0 * part : -std::log1p(2.0 * part * at_90) / std::log1p(at_90);
    k_ = float(k), v_ = float(v), back_ = float(e(k_).value);
  }

  float density(float cosine) const { return float(density_at(sine2_half(cosine))); }  // per steradian
  double part_within(float cosine) const { return part_at(sine2_half(cosine)); }       // of the angle of that cosine

  // The cosine of the angle within which a part `u` is scattered: Newton's method in the logarithm of s, kept between bounds.
  float sample(float u) const {
    double lo = std::log(kLeast), hi = 0.0;
    if (u <= part_at(kLeast)) return float(1.0 - 2.0 * kLeast);
    double x = std::clamp(std::log(double(u)) / -std::min(double(v_), -1e-3) - std::log(double(k_)), lo, hi);
    for (int i = 0; i < 60 && hi - lo > 1e-7; ++i) {
      const double s = std::exp(x), off = part_at(s) - double(u);
      (off > 0.0 ? hi : lo) = x;
      const double step = off / (4.0 * kPi * density_at(s) * s), next = x - step;
      if (std::abs(step) < 1e-7 * std::abs(x)) break;
      x = next > lo && next < hi ? next : 0.5 * (lo + hi);
    }
    return float(1.0 - 2.0 * std::exp(x));
  }

 private:
  static constexpr double kLeast = 3e-8;  // of s: as near to straight on as a cosine in single precision can say
  static double sine2_half(float cosine) { return std::clamp(0.5 * (1.0 - double(cosine)), kLeast, 1.0); }

  double part_at(double s) const {
    const double c = 1.0 - 2.0 * s;
    return 1.0 + (1.0 - s) * e(k_ * s).value - 0.125 * back_ * c * (1.0 - c * c);
  }
  // P' / 4π
  double density_at(double s) const {
    const double c = 1.0 - 2.0 * s;
    const Slope f = e(k_ * s);
    const double sum = (1.0 - s) * k_ * f.slope - f.value - 0.25 * back_ * (3.0 * c * c - 1.0);
    return std::max(0.25 / kPi * sum, 0.0);
  }

  struct Slope {
    double value, slope;
  };
  // E and its derivative by δ. Near δ = 1 by their series.
  Slope e(double delta) const {
    const double x = delta - 1.0;
    if (std::abs(x) < 1e-4) {
      const double b = v_ * (v_ + 1.0) / 2.0, c = b * (v_ + 2.0) / 3.0;
      return {v_ - b * x + c * x * x, -b + 2.0 * c * x};
    }
    const double more = std::expm1(-v_ * std::log(delta));
    return {-more / x, (v_ * (more + 1.0) / delta * x + more) / (x * x)};
  }

  float k_, v_, back_;  // the last: E(k)
};

}  // namespace gi
