// Blender's Sky texture at a direction: a look into a table of the sky with the sun's disc over it, or Preetham's formula.
#pragma once
#include "shading/sky/sky.h"

namespace gi::texture {

// Of a scattering sky, apart from its table.
struct SkyDisc {
  Rgb bottom, top;             // radiance at the disc's edges
  float elevation, rotation;   // of the sun
  float diameter;              // angle; not positive: no disc
  float intensity;
  float horizon;               // elevation of the earth's edge: below it no sun
};

inline float angle_between(Vec3 a, Vec3 b) { return 2.0f * std::atan2(length(a - b), length(a + b)); }  // precise where small

inline float sky_elevation(Vec3 d) { return kPi / 2 - std::acos(std::clamp(d.z, -1.0f, 1.0f)); }

// Where the table holds direction d. The poles have no azimuth; any will do.
inline Vec2 sky_coordinates(Vec3 d, float rotation) {
  const float turns = (-std::atan2(d.y, d.x) - kPi / 2 + rotation) / (2.0f * kPi);
  return {turns - std::floor(turns), sky_row(sky_elevation(d))};
}

inline Rgb sun_disc(Vec3 d, const SkyDisc& s) {
  const Vec3 sun{-std::cos(s.elevation) * std::sin(s.rotation), std::cos(s.elevation) * std::cos(s.rotation), std::sin(s.elevation)};
  const float angle = angle_between(d, sun), half = 0.5f * s.diameter, elevation = sky_elevation(d);
  if (!(angle < half) || elevation <= s.horizon) return Rgb();
  const float darkening = 1.0f - 0.6f * (1.0f - safe_sqrt(1.0f - sqr(angle / half)));  // of the limb
  return lerp(s.bottom, s.top, (elevation - s.elevation) / s.diameter + 0.5f) * (s.intensity * darkening);
}

// [Preetham et al. 1999, "A practical analytic model for daylight"]
struct PreethamChannel {
  float zenith;     // value at the zenith over its Perez function there
  float perez[5];
};
struct PreethamSky {
  float theta, phi;             // of the sun: from the zenith, and clockwise from +y
  PreethamChannel luminance, x, y;  // CIE xyY
};

inline float perez(const PreethamChannel& c, float theta, float gamma) {
  const float* p = c.perez;
  return c.zenith * (1.0f + p[0] * std::exp(p[1] / std::cos(theta))) * (1.0f + p[2] * std::exp(p[3] * gamma) + p[4] * sqr(std::cos(gamma)));
}

inline Rgb preetham(Vec3 d, const PreethamSky& s) {
  const float theta = std::acos(std::clamp(d.z, -1.0f, 1.0f)), phi = std::atan2(d.x, d.y);
  const float cos_gamma = std::sin(theta) * std::sin(s.theta) * std::cos(s.phi - phi) + std::cos(theta) * std::cos(s.theta);
  const float gamma = std::acos(std::clamp(cos_gamma, -1.0f, 1.0f));
  const float above = std::min(theta, kPi / 2 - 0.001f);  // below the horizon as at it
  const float x = perez(s.x, above, gamma), y = perez(s.y, above, gamma), luminance = perez(s.luminance, above, gamma);
  const float scale = safe_divide(luminance, y);
  const Rgb c = xyz_to_rec709(x * scale, luminance, (1.0f - x - y) * scale);
  return {std::max(c.r, 0.0f), std::max(c.g, 0.0f), std::max(c.b, 0.0f)};
}

}  // namespace gi::texture
