// Blender's Wave texture at scaled coordinates, in [0, 1].
#pragma once
#include "shading/textures/noise.h"

namespace gi::texture {

enum class Wave { kBands, kRings };
enum class WaveDirection { kX, kY, kZ, kDiagonalOrSpherical };  // of bands: diagonal, of rings: spherical
enum class WaveProfile { kSine, kSaw, kTriangle };

struct WaveSettings {
  Wave type = Wave::kBands;
  WaveDirection direction = WaveDirection::kX;
  WaveProfile profile = WaveProfile::kSine;
  float distortion = 0, detail = 2, detail_scale = 1, detail_roughness = 0.5f, phase = 0;
};

inline float wave(Vec3 p, const WaveSettings& s) {
  // Keeps faces at whole coordinates off the saw's jumps.
  p = (p + Vec3{0.000001f, 0.000001f, 0.000001f}) * 0.999999f;

  const int axis = int(s.direction);
  const bool all = axis < 0 || axis > 2;
  float n;
  if (s.type == Wave::kBands) {
    n = all ? (p.x + p.y + p.z) * 10.0f : p[axis] * 20.0f;
  } else {
    Vec3 q = p;
    if (!all) q[axis] = 0;
    n = length(q) * 20.0f;
  }
  n += s.phase;
  if (s.distortion != 0.0f) {
    FractalSettings fractal;
    fractal.detail = s.detail, fractal.roughness = s.detail_roughness;
    n += s.distortion * (fbm(coordinates<3>(p * s.detail_scale, 0), fractal) * 2.0f - 1.0f);
  }
  const float turns = n / (2.0f * kPi);
  switch (s.profile) {
    case WaveProfile::kSine: return 0.5f + 0.5f * std::sin(n - kPi / 2);
    case WaveProfile::kSaw: return turns - std::floor(turns);
    case WaveProfile::kTriangle: return std::abs(turns - std::floor(turns + 0.5f)) * 2.0f;
  }
  return 0;
}

}  // namespace gi::texture
