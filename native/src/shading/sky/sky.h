// Sky models behind Blender's Sky texture: tables of the sky's radiance by direction, and the sun's disc seen through air.
// The models are those that Blender uses, so that both engines light a scene alike.
#pragma once
#include <vector>

#include "core/vec.h"

namespace gi {

struct Atmosphere {
  float altitude = 100;  // of the camera, metres
  float air = 1, aerosol = 1, ozone = 1;  // times the usual densities
};

// Scene-linear Rec. 709 radiance, row 0 at the nadir. The sun is at the middle column. Rows follow a square root of the
// elevation, so that the horizon has most of them; sky_row() gives the place of an elevation.
struct SkyTable {
  int width = 512, height = 256;
  std::vector<Rgb> pixels = std::vector<Rgb>(size_t(width) * size_t(height));
  Rgb& at(int x, int y) { return pixels[size_t(y) * size_t(width) + size_t(x)]; }
};
// Radiance at the lower and the upper edge of the disc; in between it is interpolated.
struct SunDisc {
  Rgb bottom, top;
};

// In [0, 1] from nadir to zenith.
inline float sky_row(float elevation) { return 0.5f + 0.5f * std::copysign(std::sqrt(std::abs(elevation) * (2.0f * kInvPi)), elevation); }

// [Nishita et al. 1993, "Display of the earth taking into account atmospheric scattering"], light scattered once.
// Below the horizon the sky fades out.
SkyTable single_scattering_sky(float sun_elevation, const Atmosphere& atmosphere);
SunDisc single_scattering_sun(float sun_elevation, float angular_diameter, const Atmosphere& atmosphere);

// [García Liñán 2023, "A spectral sky model with four wavelengths", fgarlin.com/posts/2024-12-06-spectral_sky]: light scattered
// once, and a fit of all that is scattered more often. Below the horizon: the air before the ground.
SkyTable multiple_scattering_sky(float sun_elevation, const Atmosphere& atmosphere);
SunDisc multiple_scattering_sun(float sun_elevation, float angular_diameter, const Atmosphere& atmosphere);

// [Hosek & Wilkie 2012], CIE XYZ. Turbidity in [1, 10]; a sun below the horizon counts as at it.
struct HosekWilkieSky {
  struct Channel {
    float radiance;
    float shape[9];
  } xyz[3];
};
HosekWilkieSky hosek_wilkie_sky(float turbidity, float albedo, float sun_elevation);

// CIE XYZ to linear Rec. 709 (IEC 61966-2-1).
inline Rgb xyz_to_rec709(float x, float y, float z) {
  return {3.2404542f * x - 1.5371385f * y - 0.4985314f * z, -0.9692660f * x + 1.8760108f * y + 0.0415560f * z,
          0.0556434f * x - 0.2040259f * y + 1.0572252f * z};
}

}  // namespace gi
