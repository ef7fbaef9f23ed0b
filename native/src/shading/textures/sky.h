// Blender's Sky texture at a direction: a look into a table of the sky with the sun's disc over it, or the
// formulas of Preetham, and of Hosek and Wilkie.
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

// Angles of a direction as the formulas count them; below the horizon the sky is as at it.
struct SkyAngles {
  float theta, gamma;  // from the zenith, and from the sun
};

inline SkyAngles sky_angles(Vec3 d, float sun_theta, float sun_phi) {
  const float theta = std::acos(std::clamp(d.z, -1.0f, 1.0f)), phi = std::atan2(d.x, d.y);
  const float cos_gamma = std::sin(theta) * std::sin(sun_theta) * std::cos(sun_phi - phi) + std::cos(theta) * std::cos(sun_theta);
  return {std::min(theta, kPi / 2 - 0.001f), std::acos(std::clamp(cos_gamma, -1.0f, 1.0f))};
}

inline Rgb visible_rec709(float x, float y, float z) {
  const Rgb c = xyz_to_rec709(x, y, z);
  return {std::max(c.r, 0.0f), std::max(c.g, 0.0f), std::max(c.b, 0.0f)};
}

inline Rgb preetham(Vec3 d, const PreethamSky& s) {
  const auto [theta, gamma] = sky_angles(d, s.theta, s.phi);
  const float x = perez(s.x, theta, gamma), y = perez(s.y, theta, gamma), luminance = perez(s.luminance, theta, gamma);
  const float scale = safe_divide(luminance, y);
  return visible_rec709(x * scale, luminance, (1.0f - x - y) * scale);
}

// A HosekWilkieSky and where its sun is.
struct SunnyHosekWilkieSky {
  float theta, phi;  // as PreethamSky's
  HosekWilkieSky sky;
};

// [Hosek & Wilkie 2012, eq. 8]
inline float hosek_wilkie(const HosekWilkieSky::Channel& c, float theta, float gamma) {
  const float* p = c.shape;
  const float cos_theta = std::cos(theta), cos_gamma = std::cos(gamma), anisotropy = p[8];
  const float mie = (1.0f + sqr(cos_gamma)) / std::pow(1.0f + sqr(anisotropy) - 2.0f * anisotropy * cos_gamma, 1.5f);
  const float horizon = 1.0f + p[0] * std::exp(p[1] / (cos_theta + 0.01f));
  const float glow = p[2] + p[3] * std::exp(p[4] * gamma) + p[5] * sqr(cos_gamma) + p[6] * mie + p[7] * std::sqrt(cos_theta);
  return c.radiance * horizon * glow;
}

inline Rgb hosek_wilkie(Vec3 d, const SunnyHosekWilkieSky& s) {
  constexpr float kBlenderScale = 2.0f * kPi / 683.0f;  // Blender's choice of exposure
  const auto [theta, gamma] = sky_angles(d, s.theta, s.phi);
  const HosekWilkieSky::Channel* c = s.sky.xyz;
  return kBlenderScale *
         visible_rec709(hosek_wilkie(c[0], theta, gamma), hosek_wilkie(c[1], theta, gamma), hosek_wilkie(c[2], theta, gamma));
}

}  // namespace gi::texture
