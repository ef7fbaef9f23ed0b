// Light that enters a surface and leaves it elsewhere: what a material says of it, and the medium that a random walk goes through, or the
// lengths of the profile by which it is spread. How it gets there is transport/subsurface.h.
#pragma once
#include "core/vec.h"

namespace gi {

enum class SubsurfaceMethod : uint8_t { kWalk, kWalkLegacy, kSkin, kProfile };  // what immediates mean by them

struct Subsurface {
  Rgb weight;          // of the light that comes out, the albedo included
  Rgb albedo, radius;  // metres, mean free path
  float anisotropy = 0;
  float ior = 1.4f, alpha = 1;  // of the surface that light enters through
  Vec3 normal;
  SubsurfaceMethod method = SubsurfaceMethod::kWalk;
  float select = 0;    // probability
};

struct SubsurfaceMedium {
  Rgb sigma_t, albedo;  // per metre; single-scattering albedo
  Rgb entry{1.0f};      // factor on what enters
  float anisotropy = 0;
};

// From the colour of a deep medium to the albedo of one scattering. [Kulla & Conty 2017, "Revisiting physically based shading"]
inline float single_albedo(float color, float g) {
  const float s = 4.20863f * color - std::sqrt(9.59217f + 41.6808f * color + 17.7126f * sqr(color)) + 4.09712f;
  const float s2 = sqr(s);
  return safe_divide(1.0f - s2, 1.0f - g * s2);
}

// The fit of older files, which knows anisotropy. [Chiang et al. 2016, "Practical and controllable subsurface scattering"], extended.
float single_albedo_legacy(float color, float g);

// Mean free path of a skin from the radius of its diffuse profile. [Jensen et al. 2001, "A practical model for subsurface light transport"]
float skin_radius_scale(float albedo, float ior);

// Of older files, whose radii were of other profiles, that it looks as it did.
inline constexpr float kLegacyRadius = 0.25f * kInvPi;

SubsurfaceMedium medium_of(const Subsurface& s);

// Of each channel's DiffusionProfile, metres. As in Cycles the albedo has no say in them.
inline Rgb profile_lengths(const Subsurface& s) {
  Rgb d;
  for (int i = 0; i < 3; ++i) d[i] = s.weight[i] > 0.0f ? s.radius[i] * kLegacyRadius : 0.0f;
  return d;
}

}  // namespace gi
