// Nishita's sky in 21 wavelengths: Rayleigh and Mie scattering of air and aerosol, absorption of ozone. [Nishita93]
#include <array>

#include "shading/sky/sky.h"

namespace gi {
namespace {

constexpr int kWavelengths = 21;        // 380 to 780 nm
constexpr float kWavelengthStep = 20;   // nm
constexpr double kEarthRadius = 6360e3, kAtmosphereRadius = 6420e3;  // metres
constexpr float kAirScaleHeight = 8e3f, kAerosolScaleHeight = 1.2e3f;
constexpr float kAerosolScattering = 2e-5f;   // at sea level, 1/m, all wavelengths
constexpr float kAerosolExtinction = 1.11f * kAerosolScattering;
constexpr float kAsymmetry = 0.76f;           // of the aerosol's phase function
constexpr int kViewSteps = 32;

using Spectrum = std::array<float, kWavelengths>;

// Absorption of the ozone layer at its densest, 1/m: cross sections of Serdyuchenko et al. 2014 at 20 nm steps.
constexpr Spectrum kOzoneAbsorption = {3.25126850e-9f, 5.85395365e-9f, 1.97719116e-8f, 7.30956876e-8f, 2.00845615e-7f, 4.03839581e-7f,
                                       6.35513359e-7f, 9.67070412e-7f, 1.54797400e-6f, 2.09038647e-6f, 2.46128056e-6f, 2.73551299e-6f,
                                       2.15125863e-6f, 1.59051841e-6f, 1.12356198e-6f, 7.35275515e-7f, 4.64501304e-7f, 3.30960799e-7f,
                                       2.25126123e-7f, 1.48791293e-7f, 1.68286234e-7f};

// CIE 1931 standard observer at the same wavelengths.
constexpr float kObserver[kWavelengths][3] = {
    {0.001368f, 0.000039f, 0.00645f}, {0.01431f, 0.000396f, 0.06785f}, {0.13438f, 0.004f, 0.6456f}, {0.34828f, 0.023f, 1.74706f},
    {0.2908f, 0.06f, 1.6692f},        {0.09564f, 0.13902f, 0.81295f},  {0.0049f, 0.323f, 0.272f},   {0.06327f, 0.71f, 0.07825f},
    {0.2904f, 0.954f, 0.0203f},       {0.5945f, 0.995f, 0.0039f},      {0.9163f, 0.87f, 0.00165f},  {1.0622f, 0.631f, 0.0008f},
    {0.85445f, 0.381f, 0.00019f},     {0.4479f, 0.175f, 0.00002f},     {0.1649f, 0.061f, 0.0f},     {0.04677f, 0.017f, 0.0f},
    {0.011359f, 0.004102f, 0.0f},     {0.002899f, 0.001047f, 0.0f},    {0.00069f, 0.000249f, 0.0f}, {0.000166f, 0.00006f, 0.0f},
    {0.000042f, 0.000015f, 0.0f}};

double wavelength_nm(int i) { return 380.0 + double(kWavelengthStep) * i; }

// Rayleigh's law, anchored at 380 nm.
const Spectrum kAirScattering = [] {
  Spectrum s;
  for (int i = 0; i < kWavelengths; ++i) s[size_t(i)] = float(5.424820087636473e-5 * std::pow(380.0 / wavelength_nm(i), 4.0));
  return s;
}();

// Sunlight above the air, W/m²/nm: close to a black body of 5780 K, anchored at 500 nm.
const Spectrum kSunIrradiance = {1.457568f, 1.565963f, 1.651484f, 1.714962f, 1.757980f, 1.782564f, 1.790951f,
                                 1.785416f, 1.768156f, 1.741221f, 1.706471f, 1.665561f, 1.619934f, 1.570836f,
                                 1.519323f, 1.466285f, 1.412459f, 1.358450f, 1.304749f, 1.251750f, 1.199760f};

Rgb to_rgb(const Spectrum& s) {
  float xyz[3] = {};
  for (int i = 0; i < kWavelengths; ++i)
    for (int k = 0; k < 3; ++k) xyz[k] += kObserver[i][k] * s[size_t(i)] * kWavelengthStep;
  return xyz_to_rec709(xyz[0], xyz[1], xyz[2]);
}

// Air, aerosol and ozone: their densities relative to where they are densest, or those integrated along a ray in metres.
struct Amounts {
  float air = 0, aerosol = 0, ozone = 0;
};
Amounts operator+(Amounts a, Amounts b) { return {a.air + b.air, a.aerosol + b.aerosol, a.ozone + b.ozone}; }
Amounts operator*(Amounts a, float s) { return {a.air * s, a.aerosol * s, a.ozone * s}; }
Amounts operator*(Amounts a, const Atmosphere& s) { return {a.air * s.air, a.aerosol * s.aerosol, a.ozone * s.ozone}; }

Amounts densities(float height) {
  return {std::exp(-height / kAirScaleHeight), std::exp(-height / kAerosolScaleHeight),
          std::max(0.0f, 1.0f - std::abs(height - 25000.0f) / 15000.0f)};
}

struct Position {  // from the earth's centre
  double x, y, z;
  double radius() const { return std::sqrt(x * x + y * y + z * z); }
  float height() const { return float(radius() - kEarthRadius); }
  Position moved(Vec3 d, double t) const { return {x + d.x * t, y + d.y * t, z + d.z * t}; }
};

// Half of the quadratic's linear coefficient, and how far the sphere's edge is along the ray (NaN where it misses).
double distance_to_sphere(Position p, Vec3 d, double radius) {
  const double b = p.x * d.x + p.y * d.y + p.z * d.z, c = p.x * p.x + p.y * p.y + p.z * p.z - radius * radius;
  return -b + std::sqrt(b * b - c);
}
bool earth_blocks(Position p, Vec3 d) { return d.z < 0.0f && !std::isnan(distance_to_sphere(p, d, kEarthRadius)); }

// To the end of the air, by Gauss–Laguerre quadrature scaled so that its last node is still inside: densities fall off
// exponentially, which makes eight nodes enough.
Amounts depth_to_space(Position p, Vec3 d) {
  constexpr float kNodes[] = {0.006811185f, 0.03614807f, 0.09004347f, 0.1706680f, 0.2818362f, 0.4303406f, 0.6296271f, 0.9145253f};
  constexpr float kWeights[] = {0.01750894f, 0.04135477f, 0.06678839f, 0.09507699f, 0.1283416f, 0.1707430f, 0.2327233f, 0.3562490f};
  const double length = distance_to_sphere(p, d, kAtmosphereRadius);
  Amounts sum;
  for (int i = 0; i < 8; ++i) sum = sum + densities(p.moved(d, kNodes[i] * length).height()) * kWeights[i];
  return sum * float(length);
}

Vec3 geographic(float latitude, float longitude) {
  return {std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude), std::sin(latitude)};
}

Rgb scattered(Position camera, Vec3 d, Vec3 sun, const Atmosphere& atmosphere) {
  const float mu = dot(d, sun), g = kAsymmetry;
  const float air_phase = 3.0f / (16.0f * kPi) * (1.0f + mu * mu);
  const float aerosol_phase =
      3.0f * (1.0f - g * g) * (1.0f + mu * mu) / (8.0f * kPi * (2.0f + g * g) * std::pow(1.0f + g * g - 2.0f * g * mu, 1.5f));
  const double step = distance_to_sphere(camera, d, kAtmosphereRadius) / kViewSteps;
  Amounts seen;  // between camera and point
  Spectrum radiance{};
  for (int i = 0; i < kViewSteps; ++i) {
    const Position p = camera.moved(d, (i + 0.5) * step);
    const Amounts here = densities(p.height()) * atmosphere;
    seen = seen + here * float(step);
    if (earth_blocks(p, sun)) continue;
    const Amounts path = seen + depth_to_space(p, sun) * atmosphere;
    for (size_t k = 0; k < kWavelengths; ++k) {
      const float depth = path.air * kAirScattering[k] + path.aerosol * kAerosolExtinction + path.ozone * kOzoneAbsorption[k];
      const float scattering = air_phase * here.air * kAirScattering[k] + aerosol_phase * here.aerosol * kAerosolScattering;
      radiance[k] += std::exp(-depth) * scattering * kSunIrradiance[k] * float(step);
    }
  }
  return to_rgb(radiance);
}

Position camera_position(const Atmosphere& a) { return {0, 0, kEarthRadius + std::clamp(a.altitude, 1.0f, 59999.0f)}; }

}  // namespace

SkyTable single_scattering_sky(float sun_elevation, const Atmosphere& atmosphere) {
  SkyTable table;
  const int half_width = table.width / 2, half_height = table.height / 2;
  const Position camera = camera_position(atmosphere);
  const Vec3 sun = geographic(sun_elevation, 0);
  for (int y = half_height; y < table.height; ++y) {
    const float latitude = kPi / 2 * sqr(float(y) / float(half_height) - 1.0f);
    for (int x = 0; x < half_width; ++x) {
      const float longitude = 2.0f * kPi / float(table.width) * float(x) - kPi;
      table.at(x, y) = table.at(table.width - 1 - x, y) = scattered(camera, geographic(latitude, longitude), sun, atmosphere);
    }
  }
  // The ground is not part of the model: the horizon fades out within some 24 degrees below.
  for (int y = 0; y < half_height; ++y) {
    const float down = std::sin(kPi / 2 * sqr(float(y) / float(half_height) - 1.0f));
    const float fade = std::pow(std::max(1.0f - 2.5f * down, 0.0f), 3.0f);
    for (int x = 0; x < table.width; ++x) table.at(x, y) = table.at(x, half_height) * fade;
  }
  return table;
}

SunDisc single_scattering_sun(float sun_elevation, float angular_diameter, const Atmosphere& atmosphere) {
  const float half = 0.5f * angular_diameter;
  if (sun_elevation + half <= 0.0f) return {};
  const float solid_angle = 2.0f * kPi * (1.0f - std::cos(half));
  // Ozone is left out of the disc's colour, as Blender does.
  const auto radiance = [&](float elevation) {
    const Amounts depth = depth_to_space(camera_position(atmosphere), geographic(std::max(elevation, 0.0f), 0)) * atmosphere;
    Spectrum s;
    for (size_t k = 0; k < kWavelengths; ++k)
      s[k] = kSunIrradiance[k] * std::exp(-depth.air * kAirScattering[k] - depth.aerosol * kAerosolExtinction) / solid_angle;
    return to_rgb(s);
  };
  return {radiance(sun_elevation - half), radiance(sun_elevation + half)};
}

}  // namespace gi
