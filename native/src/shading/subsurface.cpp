// The medium of a subsurface closure. Fits and limits are those that Blender's materials are made for.
#include "shading/subsurface.h"

namespace gi {
namespace {

constexpr float kSmallest = 1e-16f, kMostAlbedo = 0.999999f;
constexpr float kLeastAlbedo = 0.2f;  // below, walks end too soon to be guided by it: the rest is taken at the entry

// Σ c[k] gᵏ, from c[0] on.
template <size_t N>
float polynomial(float g, const float (&c)[N]) {
  float sum = 0.0f;
  for (size_t k = N; k-- > 0;) sum = sum * g + c[k];
  return sum;
}

// Reflectance of the dipole by reduced albedo.
float dipole_reflectance(float reduced, float a) {
  const float s = std::sqrt(3.0f * (1.0f - reduced));
  return 0.5f * reduced * (1.0f + std::exp(-a * s)) * std::exp(-s);
}

// Its inverse, by bisection as far as Blender goes.
float reduced_albedo(float reflectance, float a) {
  if (reflectance < 1e-4f) return 0.0f;
  if (reflectance >= 0.995f) return kMostAlbedo;
  float lo = 0.0f, hi = 1.0f, middle = 0.5f;
  for (int i = 0; i < 12; ++i) {
    middle = 0.5f * (lo + hi);
    (dipole_reflectance(middle, a) < reflectance ? lo : hi) = middle;
  }
  return middle;
}

}  // namespace

float single_albedo_legacy(float color, float g) {
  constexpr float kA[] = {1.8260523782f,   -1.28451056436f, -1.79904629312f, 9.19393289202f,
                          -22.8215585862f, 32.0234874259f,  -23.6264803333f, 7.21067002658f};
  constexpr float kB[] = {0.0f,           31.1491581433f,  -201.847017512f, 841.576016723f, -2018.09288505f,
                          2731.71560286f, -1935.41424244f, 559.009054474f};
  constexpr float kC[] = {1.09686102424f, -0.394704063468f, 1.05258115941f, -8.83963712726f,
                          28.8643230661f, -46.8802913581f,  38.5402837518f, -12.7181042538f};
  constexpr float kD[] = {0.496310210422f, 0.360146581622f, -2.15139309747f, 17.8896899217f,
                          -55.2984010333f, 82.065982243f,   -58.5106008578f, 15.8478295021f};
  constexpr float kE[] = {0.0f,           76.7316253952f,  -594.356773233f, 2448.8834203f, -5576.68528998f,
                          7116.60171912f, -4763.54467887f, 1303.5318055f};
  constexpr float kF[] = {2.40602999408f, -2.51814844609f, 9.18494908356f, -79.2191708682f,
                          259.082868209f, -403.613804597f, 302.85712436f,  -87.4370473567f};
  const float b = 4.98511194385f + 0.127355959438f * std::exp(polynomial(g, kB));
  const float e = 4.23190299701f + 0.00310603949088f * std::exp(polynomial(g, kE));
  const float blend = std::pow(color, 0.25f);
  const float dark = polynomial(g, kA) * std::pow(std::atan(b * color), polynomial(g, kC));
  const float bright = polynomial(g, kD) * std::pow(std::atan(e * color), polynomial(g, kF));
  return (1.0f - blend) * dark + blend * bright;
}

float skin_radius_scale(float albedo, float ior) {
  const float inverse = 1.0f / ior;
  const float diffuse_fresnel = inverse * (-1.440f * inverse + 0.710f) + 0.668f + 0.0636f * ior;
  const float a = (4.0f / 3.0f) * (1.0f + diffuse_fresnel) / (1.0f - diffuse_fresnel);
  return std::sqrt(3.0f * (1.0f - reduced_albedo(albedo, a)));
}

SubsurfaceMedium medium_of(const Subsurface& s) {
  SubsurfaceMedium m;
  m.anisotropy = s.anisotropy;
  const bool legacy = s.method != SubsurfaceMethod::kWalk && s.anisotropy >= 0.0f;
  for (int i = 0; i < 3; ++i) {
    float radius = s.radius[i];
    if (s.method == SubsurfaceMethod::kWalkLegacy) radius *= kLegacyRadius;
    if (s.method == SubsurfaceMethod::kSkin) radius *= skin_radius_scale(s.albedo[i], s.ior);
    m.sigma_t[i] = 1.0f / std::max(radius, kSmallest);
    if (legacy) m.sigma_t[i] /= 1.0f - s.anisotropy;
    const float albedo = legacy ? single_albedo_legacy(s.albedo[i], s.anisotropy) : single_albedo(s.albedo[i], s.anisotropy);
    m.albedo[i] = std::clamp(albedo, 0.0f, kMostAlbedo);
    // The weight has the albedo in it, which the walk makes.
    m.entry[i] = s.albedo[i] != 0.0f ? 1.0f / s.albedo[i] : 0.0f;
    if (m.albedo[i] < kLeastAlbedo) m.entry[i] *= m.albedo[i] / kLeastAlbedo, m.albedo[i] = kLeastAlbedo;
  }
  return m;
}

}  // namespace gi
