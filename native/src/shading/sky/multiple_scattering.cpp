// A sky of four wavelengths (630, 560, 490 and 430 nm), all orders of scattering: the first by ray marching, the others by a fit
// for the earth's atmosphere. [García Liñán 2023]; aerosols after [Guimera et al. 2018], urban.
#include <array>

#include "shading/sky/sky.h"

namespace gi {
namespace {

struct Quad {
  float v[4] = {};
};
template <class F>
Quad each(F f) {
  Quad q;
  for (int i = 0; i < 4; ++i) q.v[i] = f(i);
  return q;
}
Quad operator+(Quad a, Quad b) {
  return each([&](int i) { return a.v[i] + b.v[i]; });
}
Quad operator*(Quad a, Quad b) {
  return each([&](int i) { return a.v[i] * b.v[i]; });
}
Quad operator*(Quad a, float s) {
  return each([&](int i) { return a.v[i] * s; });
}
Quad mix(Quad a, Quad b, float t) {
  return each([&](int i) { return a.v[i] * (1.0f - t) + b.v[i] * t; });
}
Quad exp_minus(Quad a) {
  return each([&](int i) { return std::exp(-a.v[i]); });
}

constexpr float kEarthRadius = 6371, kThickness = 100, kAtmosphereRadius = kEarthRadius + kThickness;  // km
constexpr float kAsymmetry = 0.8f, kGroundAlbedo = 0.3f;
constexpr int kSteps = 64;

constexpr Quad kSunIrradiance{{1.679f, 1.828f, 1.986f, 1.307f}};             // above the air, W/m²/nm (NREL)
constexpr Quad kAirScattering{{6.605e-3f, 1.067e-2f, 1.842e-2f, 3.156e-2f}};  // at sea level, 1/km [Bucholtz 1995]
constexpr Quad kOzoneAbsorption{{3.472e-25f, 3.914e-25f, 1.349e-25f, 1.103e-26f}};  // m² per molecule [Gorshelev et al. 2014]
constexpr float kOzoneDobson = 334.5f;                                               // mean over the year
constexpr Quad kAerosolAbsorption{{2.8722e-24f, 4.6168e-24f, 7.9706e-24f, 1.3578e-23f}};
constexpr Quad kAerosolScattering{{1.5908e-22f, 1.7711e-22f, 2.0942e-22f, 2.4033e-22f}};
constexpr float kAerosolDensity = 1.3681e20f, kAerosolBackground = 2e6f, kAerosolScaleHeight = 0.73f;  // 1/km³, km
constexpr float kToXyz[4][3] = {{53.386917f, 22.981337f, 0.0f},
                                {43.904844f, 71.347796f, 0.102507f},  // of a smooth spectrum
                                {1.613728f, 18.422961f, 31.742921f},
                                {20.762669f, 2.361421f, 110.480096f}};

Rgb to_rgb(Quad spectrum) {
  float xyz[3] = {};
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 3; ++k) xyz[k] += kToXyz[i][k] * spectrum.v[i];
  return xyz_to_rec709(xyz[0], xyz[1], xyz[2]);
}

// What the air does to light at a height, 1/km.
struct Medium {
  Quad air_scattering, aerosol_scattering, extinction;

  Medium(float height, const Atmosphere& a) {
    const float aerosol = kAerosolDensity * (std::exp(-height / kAerosolScaleHeight) + kAerosolBackground / kAerosolDensity) * a.aerosol;
    const float log_h = std::log(std::max(height, 1e-4f));
    const float ozone = 3.78547397e20f * std::exp(-sqr(log_h - 3.22261f) * 5.55555555f - log_h) * kOzoneDobson * a.ozone;
    air_scattering = kAirScattering * (std::exp(-0.07771971f * std::pow(height, 1.16364243f)) * a.air);
    aerosol_scattering = kAerosolScattering * aerosol;
    extinction = air_scattering + aerosol_scattering + kAerosolAbsorption * aerosol + kOzoneAbsorption * ozone;
  }
};

// A ray from the height `radius` over the earth's centre, `cos_zenith` from straight up. Distance to the sphere; below 0: none.
float distance_to_sphere(float radius, float cos_zenith, float sphere) {
  const double b = double(radius) * cos_zenith, c = (double(radius) - sphere) * (double(radius) + sphere), d = b * b - c;
  if (c <= 0.0) return float(std::sqrt(d) - b);
  return b > 0.0 || d < 0.0 ? -1.0f : float(-b - std::sqrt(d));
}
// Along that ray at distance t.
float radius_at(float radius, float cos_zenith, float t) {
  const double r = radius;  // a float's square would lose the metres
  return float(std::sqrt(std::max(0.0, r * r + double(t) * t + 2.0 * r * t * cos_zenith)));
}

// From a height to the sun. The ground does not block: the fit and the table count on a smooth continuation below the horizon.
Quad transmittance(float cos_sun, float radius, const Atmosphere& a) {
  const float step = distance_to_sphere(radius, cos_sun, kAtmosphereRadius) / kSteps;
  Quad depth;
  for (int i = 0; i < kSteps; ++i)
    depth = depth + Medium(std::max(radius_at(radius, cos_sun, (float(i) + 0.5f) * step) - kEarthRadius, 0.0f), a).extinction * step;
  return exp_minus(depth);
}

class TransmittanceTable {
 public:
  explicit TransmittanceTable(const Atmosphere& a) {
    for (int y = 0; y < kHeights; ++y)
      for (int x = 0; x < kAngles; ++x)
        at(x, y) =
            transmittance(2.0f * float(x) / float(kAngles - 1) - 1.0f, kEarthRadius + kThickness * float(y) / float(kHeights - 1), a);
  }
  // `height` in [0, 1] of the atmosphere.
  Quad lookup(float cos_sun, float height) const {
    const float x = clamp01(cos_sun * 0.5f + 0.5f) * float(kAngles - 1), y = clamp01(height) * float(kHeights - 1);
    const int x0 = int(x), y0 = int(y), x1 = std::min(x0 + 1, kAngles - 1), y1 = std::min(y0 + 1, kHeights - 1);
    const float fx = x - float(x0);
    return mix(mix(at(x0, y0), at(x1, y0), fx), mix(at(x0, y1), at(x1, y1), fx), y - float(y0));
  }

 private:
  static constexpr int kAngles = 256, kHeights = 64;
  Quad& at(int x, int y) { return table_[size_t(y * kAngles + x)]; }
  const Quad& at(int x, int y) const { return table_[size_t(y * kAngles + x)]; }
  std::vector<Quad> table_ = std::vector<Quad>(size_t(kAngles) * kHeights);
};

// One step of a view ray: what does not depend on its azimuth.
struct Step {
  Quad air, aerosol;          // scattering, times how much of it the camera sees
  Quad all;                   // their sum
  Quad from_ground;           // light from the ground per transmittance down to it
  float height;               // in [0, 1]
  float along, up, radius;    // of the point: horizontal, vertical, from the earth's centre

  float cos_sun(Vec3 sun, float cos_azimuth) const { return (along * cos_azimuth * sun.x + up * sun.z) / radius; }
};

std::array<Step, kSteps> march(float camera, float elevation, const Atmosphere& a, const TransmittanceTable& table) {
  const float cos_zenith = std::sin(elevation), ground = distance_to_sphere(camera, cos_zenith, kEarthRadius);
  const float length = ground < 0.0f ? distance_to_sphere(camera, cos_zenith, kAtmosphereRadius) : ground, dt = length / kSteps;
  std::array<Step, kSteps> steps;
  Quad seen{{1, 1, 1, 1}};
  const Quad to_top = table.lookup(1.0f, 0.0f);
  for (int i = 0; i < kSteps; ++i) {
    Step& s = steps[size_t(i)];
    const float t = (float(i) + 0.5f) * dt;
    s.along = t * std::cos(elevation), s.up = camera + t * cos_zenith, s.radius = radius_at(camera, cos_zenith, t);
    const float height = std::max(s.radius - kEarthRadius, 0.0f);
    s.height = height / kThickness;
    const Medium m(height, a);
    // Scattering integrated over the step with its own extinction. [Hillaire 2016, "Physically based sky", sec. 5.6.3]
    const Quad through = exp_minus(m.extinction * dt);
    const Quad weight = each([&](int k) { return seen.v[k] * (1.0f - through.v[k]) / std::max(m.extinction.v[k], 1e-7f); });
    s.air = m.air_scattering * weight, s.aerosol = m.aerosol_scattering * weight, s.all = s.air + s.aerosol;
    const float solid_angle = 2.0f * kPi * (1.0f - safe_sqrt(1.0f - sqr(kEarthRadius / s.radius)));
    const Quad above = table.lookup(1.0f, s.height);
    s.from_ground = each([&](int k) { return 0.25f * kInvPi * solid_angle * kGroundAlbedo * kInvPi * to_top.v[k] / above.v[k]; });
    seen = seen * through;
  }
  return steps;
}

Rgb radiance(const std::array<Step, kSteps>& steps, Vec3 sun, float cos_azimuth, float mu, const TransmittanceTable& table) {
  const float g = kAsymmetry, den = 1.0f + g * g - 2.0f * g * mu;
  const float air_phase = 3.0f / (16.0f * kPi) * (1.0f + mu * mu), aerosol_phase = 0.25f * kInvPi * (1.0f - g * g) / (den * std::sqrt(den));
  constexpr Quad kFit{{0.217f, 0.347f, 0.594f, 1.0f}};
  Quad sum;
  for (const Step& s : steps) {
    const float c = s.cos_sun(sun, cos_azimuth);
    const Quad once = (s.air * air_phase + s.aerosol * aerosol_phase) * table.lookup(c, s.height);
    const Quad many = kFit * (0.02f / (1.0f + 5.0f * std::exp(-17.92f * c))) + s.from_ground * table.lookup(c, 0.0f) * c;
    sum = sum + once + s.all * many;
  }
  return to_rgb(sum * kSunIrradiance);
}

float camera_radius(const Atmosphere& a) { return kEarthRadius + std::clamp(a.altitude, 1.0f, 99999.0f) * 1e-3f; }

}  // namespace

SkyTable multiple_scattering_sky(float sun_elevation, const Atmosphere& atmosphere) {
  SkyTable result;
  const TransmittanceTable table(atmosphere);
  const Vec3 sun{-std::cos(sun_elevation), 0, std::sin(sun_elevation)};
  for (int y = 0; y < result.height; ++y) {
    const float l = 2.0f * (float(y) + 0.5f) / float(result.height) - 1.0f, elevation = std::copysign(l * l, l) * (kPi / 2);
    const auto steps = march(camera_radius(atmosphere), elevation, atmosphere, table);
    for (int x = 0; x < result.width / 2; ++x) {
      const float cos_azimuth = std::cos(2.0f * kPi * (float(x) + 0.5f) / float(result.width));
      const float mu = std::cos(elevation) * cos_azimuth * sun.x + std::sin(elevation) * sun.z;
      result.at(x, y) = result.at(result.width - 1 - x, y) = radiance(steps, sun, cos_azimuth, mu, table);
    }
  }
  return result;
}

SunDisc multiple_scattering_sun(float sun_elevation, float angular_diameter, const Atmosphere& atmosphere) {
  const float half = 0.5f * angular_diameter, solid_angle = 2.0f * kPi * (1.0f - std::cos(half));
  const auto radiance_at = [&](float elevation) {
    return to_rgb(kSunIrradiance * transmittance(std::sin(elevation), camera_radius(atmosphere), atmosphere) * (1.0f / solid_angle));
  };
  return {radiance_at(sun_elevation - half), radiance_at(sun_elevation + half)};
}

}  // namespace gi
