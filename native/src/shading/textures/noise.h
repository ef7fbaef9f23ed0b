// Perlin noise in 1 to 4 dimensions and the fractal sums of Blender's Noise texture.
// [Perlin 2002, "Improving noise"; Musgrave in Ebert et al. 2003, "Texturing and Modeling", ch. 16]
#pragma once
#include "shading/textures/hash.h"

namespace gi::texture {

enum class Fractal { kMultifractal, kFbm, kHybridMultifractal, kRidgedMultifractal, kHeteroTerrain };

struct FractalSettings {
  Fractal type = Fractal::kFbm;
  bool normalize = true;  // fBM only: to [0, 1]
  float detail = 2, roughness = 0.5f, lacunarity = 2, offset = 0, gain = 1;
};

namespace detail {

inline float signed_if(float x, uint32_t negative) { return negative ? -x : x; }

// Dot product of the offset from a lattice corner with that corner's gradient.
inline float gradient(uint32_t h, Point<1> p) { return signed_if(float(1 + (h & 7u)), h & 8u) * p[0]; }
inline float gradient(uint32_t h, Point<2> p) {
  h &= 7u;
  const float u = h < 4 ? p[0] : p[1], v = 2.0f * (h < 4 ? p[1] : p[0]);
  return signed_if(u, h & 1u) + signed_if(v, h & 2u);
}
inline float gradient(uint32_t h, Point<3> p) {
  h &= 15u;
  const float u = h < 8 ? p[0] : p[1], v = h < 4 ? p[1] : (h == 12 || h == 14) ? p[0] : p[2];
  return signed_if(u, h & 1u) + signed_if(v, h & 2u);
}
inline float gradient(uint32_t h, Point<4> p) {
  h &= 31u;
  const float u = h < 24 ? p[0] : p[1], v = h < 16 ? p[1] : p[2], s = h < 8 ? p[2] : p[3];
  return signed_if(u, h & 1u) + signed_if(v, h & 2u) + signed_if(s, h & 4u);
}

}  // namespace detail

// Gradient noise, roughly in [-1, 1]. Repeats every 100000, beyond which floats are too coarse for it.
template <int N>
float perlin(Point<N> p) {
  constexpr int kCorners = 1 << N;
  constexpr float kScale[] = {0.25f, 0.6616f, 0.982f, 0.8344f};  // Open Shading Language's, to fill [-1, 1]
  uint32_t keys[N][kCorners];
  float offsets[N][kCorners], fade[N];
  for (int d = 0; d < N; ++d) {
    const float x = std::fmod(p[d], 100000.0f) + (std::abs(p[d]) >= 1000000.0f ? 0.5f : 0.0f);
    const float floor = std::floor(x), f = x - floor;
    const uint32_t cell = uint32_t(int32_t(floor));
    fade[d] = f * f * f * (f * (f * 6.0f - 15.0f) + 10.0f);
    for (int l = 0; l < kCorners; ++l) {
      const int up = (l >> d) & 1;
      keys[d][l] = cell + uint32_t(up), offsets[d][l] = f - float(up);
    }
  }
  Jenkins<N, kCorners> hash;
  hash.run(keys);
  float values[kCorners];
  for (int l = 0; l < kCorners; ++l) {
    Point<N> q;
    for (int d = 0; d < N; ++d) q[d] = offsets[d][l];
    values[l] = detail::gradient(hash.c[l], q);
  }
  for (int d = 0, n = kCorners / 2; d < N; ++d, n /= 2)
    for (int l = 0; l < n; ++l) values[l] = values[2 * l] * (1.0f - fade[d]) + values[2 * l + 1] * fade[d];
  return kScale[N - 1] * values[0];
}

template <int N>
float fbm(Point<N> p, const FractalSettings& s) {
  float scale = 1, amplitude = 1, total = 0, sum = 0;
  for (int i = 0; i <= int(s.detail); ++i) {
    sum += perlin(p * scale) * amplitude;
    total += amplitude;
    amplitude *= s.roughness, scale *= s.lacunarity;
  }
  const auto result = [&s](float x, float range) { return s.normalize ? 0.5f * x / range + 0.5f : x; };
  const float rest = s.detail - std::floor(s.detail);
  if (rest == 0.0f) return result(sum, total);
  const float next = sum + perlin(p * scale) * amplitude;
  return lerp(result(sum, total), result(next, total + amplitude), rest);
}

template <int N>
float multifractal(Point<N> p, const FractalSettings& s) {
  float value = 1, power = 1;
  for (int i = 0; i <= int(s.detail); ++i) {
    value *= power * perlin(p) + 1.0f;
    power *= s.roughness, p = p * s.lacunarity;
  }
  const float rest = s.detail - std::floor(s.detail);
  return rest == 0.0f ? value : value * (rest * power * perlin(p) + 1.0f);
}

template <int N>
float hetero_terrain(Point<N> p, const FractalSettings& s) {
  float value = s.offset + perlin(p), power = s.roughness;
  p = p * s.lacunarity;
  for (int i = 1; i <= int(s.detail); ++i) {
    value += (perlin(p) + s.offset) * power * value;
    power *= s.roughness, p = p * s.lacunarity;
  }
  const float rest = s.detail - std::floor(s.detail);
  return rest == 0.0f ? value : value + rest * (perlin(p) + s.offset) * power * value;
}

template <int N>
float hybrid_multifractal(Point<N> p, const FractalSettings& s) {
  float value = 0, power = 1, weight = 1;
  for (int i = 0; weight > 0.001f && i <= int(s.detail); ++i) {
    weight = std::min(weight, 1.0f);
    const float signal = (perlin(p) + s.offset) * power;
    value += weight * signal;
    weight *= s.gain * signal;
    power *= s.roughness, p = p * s.lacunarity;
  }
  const float rest = s.detail - std::floor(s.detail);
  if (rest != 0.0f && weight > 0.001f) value += rest * std::min(weight, 1.0f) * (perlin(p) + s.offset) * power;
  return value;
}

template <int N>
float ridged_multifractal(Point<N> p, const FractalSettings& s) {
  float power = s.roughness, signal = sqr(s.offset - std::abs(perlin(p))), value = signal;
  for (int i = 1; i <= int(s.detail); ++i) {
    p = p * s.lacunarity;
    const float weight = clamp01(signal * s.gain);
    signal = sqr(s.offset - std::abs(perlin(p))) * weight;
    value += signal * power;
    power *= s.roughness;
  }
  return value;
}

template <int N>
float fractal_noise(Point<N> p, const FractalSettings& s) {
  switch (s.type) {
    case Fractal::kMultifractal: return multifractal(p, s);
    case Fractal::kFbm: return fbm(p, s);
    case Fractal::kHybridMultifractal: return hybrid_multifractal(p, s);
    case Fractal::kRidgedMultifractal: return ridged_multifractal(p, s);
    case Fractal::kHeteroTerrain: return hetero_terrain(p, s);
  }
  return 0;
}

namespace detail {

// Far-away offsets stand in for seeds; their values are part of the texture's definition.
template <int N>
Point<N> seed_offset(float seed) {
  Point<N> p;
  for (int d = 0; d < N; ++d) p[d] = 100.0f + 100.0f * (N == 1 ? hash01(seed) : hash01(seed, float(d)));
  return p;
}
template <int N>
struct SeedOffsets {
  Point<N> of[N + 2];
  SeedOffsets() {
    for (int i = 0; i < N + 2; ++i) of[i] = seed_offset<N>(float(i));
  }
};
template <int N>
const SeedOffsets<N> kSeedOffsets;

}  // namespace detail

// Blender's Noise texture at scaled coordinates: one value, or three where the colour is wanted.
template <int N>
Rgb noise_texture(Point<N> p, const FractalSettings& s, float distortion, bool color_wanted) {
  const auto& offsets = detail::kSeedOffsets<N>.of;
  if (distortion != 0.0f) {
    Point<N> shift;
    for (int d = 0; d < N; ++d) shift[d] = perlin(p + offsets[d]) * distortion;
    p = p + shift;
  }
  const float value = fractal_noise(p, s);
  if (!color_wanted) return Rgb(value);
  return {value, fractal_noise(p + offsets[N], s), fractal_noise(p + offsets[N + 1], s)};
}

}  // namespace gi::texture
