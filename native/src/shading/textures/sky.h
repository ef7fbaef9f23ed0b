// Blender's Sky texture at a direction: a look into a table of the sky with the sun's disc over it, or the
// formulas of Preetham, and of Hosek and Wilkie.
#pragma once
#include "shading/sky/sky.h"

namespace gi::texture {

// Of a scattering sky, apart from its table. Floats alone, as all that programs keep in their tables.
struct SkyDisc {
  Vec3 bottom, top;            // radiance at the disc's edges, RGB
  float elevation, rotation;   // of the sun
  Vec3 sun;                    // the direction of its centre
  float cos_reach;             // no direction further from the centre than this meets the disc; above 1: no disc
  float diameter;              // angle
  float intensity;
  float horizon;               // elevation of the earth's edge: below it no sun
  float alone;  // 1, up to Blender 4.5: nothing of the sky before it, and what is above the horizon has all of its colours
};

inline float angle_between(Vec3 a, Vec3 b) { return 2.0f * std::atan2(length(a - b), length(a + b)); }  // precise where small

inline float sky_elevation(Vec3 d) { return kPi / 2 - std::acos(std::clamp(d.z, -1.0f, 1.0f)); }

// The unit vector of elevation sky_elevation(d) and of d's azimuth: what Blender takes vectors for that are not unit.
inline Vec3 by_angles(Vec3 d) {
  const float z = std::clamp(d.z, -1.0f, 1.0f), across = std::sqrt(sqr(d.x) + sqr(d.y)), r = safe_sqrt(1.0f - z * z);
  return across > 0.0f ? Vec3{d.x * (r / across), d.y * (r / across), z} : Vec3{0, r, z};
}

// Where the table holds direction d. The poles have no azimuth; any will do.
inline Vec2 sky_coordinates(Vec3 d, float rotation) {
  const float turns = (-std::atan2(d.y, d.x) - kPi / 2 + rotation) / (2.0f * kPi);
  return {turns - std::floor(turns), sky_row(sky_elevation(d))};
}

inline Rgb with_sun_disc(Rgb sky, Vec3 d, const SkyDisc& s) {
  if (dot(d, s.sun) < s.cos_reach * std::min(1.0f, length(d))) return sky;
  const float angle = angle_between(d, s.sun), half = 0.5f * s.diameter, elevation = sky_elevation(d);
  if (!(angle < half) || elevation <= s.horizon) return sky;
  const float darkening = 1.0f - 0.6f * (1.0f - safe_sqrt(1.0f - sqr(angle / half)));  // of the limb
  const bool squeezed = s.alone != 0.0f && s.elevation <= half;
  const float up = squeezed ? elevation / (s.elevation + half) : (elevation - s.elevation) / s.diameter + 0.5f;
  const Rgb disc = lerp(Rgb(s.bottom), Rgb(s.top), up) * (s.intensity * darkening);
  return s.alone != 0.0f ? disc : sky + disc;
}

// [Preetham et al. 1999, "A practical analytic model for daylight"]
struct PreethamChannel {
  float zenith;  // value at the zenith over its Perez function there
  float perez[5];
};
struct PreethamSky {
  Vec3 sun;
  PreethamChannel luminance, x, y;  // CIE xyY
};

// Where a direction is, as the formulas count it: θ from the zenith, γ from the sun. Below the horizon the sky is as at it.
struct SkyAngles {
  float cos_theta, cos_gamma, gamma;
  SkyAngles(Vec3 d, Vec3 sun)
      : cos_theta(std::max(d.z, 0.001f)), cos_gamma(std::clamp(dot(d, sun), -1.0f, 1.0f)), gamma(std::acos(cos_gamma)) {}
};

inline float perez(const PreethamChannel& c, const SkyAngles& a) {
  const float* p = c.perez;
  return c.zenith * (1.0f + p[0] * std::exp(p[1] / a.cos_theta)) * (1.0f + p[2] * std::exp(p[3] * a.gamma) + p[4] * sqr(a.cos_gamma));
}

inline Rgb visible_rec709(float x, float y, float z) {
  const Rgb c = xyz_to_rec709(x, y, z);
  return positive(c);
}

inline Rgb preetham(Vec3 d, const PreethamSky& s) {
  const SkyAngles angles(d, s.sun);
  const float x = perez(s.x, angles), y = perez(s.y, angles), luminance = perez(s.luminance, angles);
  const float scale = safe_divide(luminance, y);
  return visible_rec709(x * scale, luminance, (1.0f - x - y) * scale);
}

// A HosekWilkieSky and where its sun is.
struct SunnyHosekWilkieSky {
  Vec3 sun;
  HosekWilkieSky sky;
};

// [Hosek & Wilkie 2012, eq. 8]
inline float hosek_wilkie(const HosekWilkieSky::Channel& c, const SkyAngles& a) {
  const float* p = c.shape;
  const float anisotropy = p[8], across = 1.0f + sqr(anisotropy) - 2.0f * anisotropy * a.cos_gamma;
  const float mie = (1.0f + sqr(a.cos_gamma)) / (across * std::sqrt(across));
  const float horizon = 1.0f + p[0] * std::exp(p[1] / (a.cos_theta + 0.01f));
  const float glow = p[2] + p[3] * std::exp(p[4] * a.gamma) + p[5] * sqr(a.cos_gamma) + p[6] * mie + p[7] * std::sqrt(a.cos_theta);
  return c.radiance * horizon * glow;
}

inline Rgb hosek_wilkie(Vec3 d, const SunnyHosekWilkieSky& s) {
  constexpr float kBlenderScale = 2.0f * kPi / 683.0f;  // Blender's choice of exposure
  const SkyAngles angles(d, s.sun);
  const HosekWilkieSky::Channel* c = s.sky.xyz;
  return kBlenderScale * visible_rec709(hosek_wilkie(c[0], angles), hosek_wilkie(c[1], angles), hosek_wilkie(c[2], angles));
}

}  // namespace gi::texture
