// How light that enters a flat surface is spread about where it comes out: two exponentials that fit what random walks give, normalized.
// [Christensen & Burley 2015, "Approximate reflectance profiles for efficient subsurface scattering"]
#pragma once
#include "core/vec.h"

namespace gi {

// Of one channel. `d` is the profile's length, metres. What comes out further away than kReach d (less than half a percent) is counted as
// nearer, as in Cycles, or rays would have to look for it everywhere.
struct DiffusionProfile {
  static constexpr float kReach = 16.0f;
  float d;

  // The part that comes out within r, of all that ever does. [eq. 11]
  static float part_within(float r_over_d) { return 1.0f - 0.25f * std::exp(-r_over_d) - 0.75f * std::exp(-r_over_d / 3.0f); }

  // Density of the distance r at which light comes out, per metre: 2π r R(r) / A. [eq. 3]
  float density(float r) const {
    if (!(d > 0.0f) || r >= kReach * d) return 0.0f;
    const float far = std::exp(-r / (3.0f * d));
    return (far * far * far + far) / (4.0f * d * part_within(kReach));
  }

  // A distance of that density. With y = exp(-r / 3d), part_within = 1 − u is y³ + 3 y = 4 u, which the hyperbolic sine of three times an
  // angle solves.
  float sample(float u) const {
    const float left = 1.0f - u * part_within(kReach);
    const float y = 2.0f * std::sinh(std::asinh(2.0f * left) / 3.0f);
    return std::clamp(-3.0f * std::log(y), 0.0f, kReach) * d;
  }
};

}  // namespace gi
