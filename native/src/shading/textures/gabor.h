// Blender's Gabor texture: noise of randomly placed and oriented Gabor kernels, eight in each cell, as a phasor.
// [Lagae et al. 2009, "Procedural noise using sparse Gabor convolution"; Tricard et al. 2019, "Procedural phasor noise"]
#pragma once
#include "shading/textures/hash.h"

namespace gi::texture {

struct Gabor {
  float value = 0, phase = 0, intensity = 0;
};

namespace detail {

inline constexpr int kImpulses = 8;

// Real and imaginary part of one kernel: a Gaussian with a Hann window that ends it at distance 1. [Lagae09 eq. 6]
inline Vec2 gabor_kernel(float distance_squared, float along) {
  const float window = 0.5f + 0.5f * std::cos(kPi * distance_squared);
  const float envelope = std::exp(-kPi * distance_squared) * window, angle = 2.0f * kPi * along;
  return {envelope * std::cos(angle), envelope * std::sin(angle)};
}

// Random numbers of impulse i: which three keys follow the cell's is part of the definition.
inline Vec2 gabor_cell(Point<2> cell, Point<2> p, float frequency, float isotropy, float orientation) {
  Vec2 sum;
  for (int i = 0; i < kImpulses; ++i) {
    const float key = float(3 * i);
    const Point<2> center = {{hash01(cell[0], cell[1], key + 1), hash01(key + 1, cell[0], cell[1])}}, offset = p - center;
    const float d2 = dot(offset, offset);
    if (d2 >= 1.0f) continue;
    const float turn = orientation + (hash01(cell[0], cell[1], key) - 0.5f) * kPi * isotropy;
    const float sign = hash01(cell[0], cell[1], key + 2) < 0.5f ? -1.0f : 1.0f;
    sum = sum + sign * gabor_kernel(d2, frequency * (offset[0] * std::cos(turn) + offset[1] * std::sin(turn)));
  }
  return sum;
}

// The base direction, turned at random by as much as the noise is isotropic.
inline Point<3> gabor_direction(Vec3 base, float isotropy, Point<3> cell, float key) {
  if (isotropy == 0.0f) return {{base.x, base.y, base.z}};
  const float a = hash01(cell[0], cell[1], cell[2], key), b = hash01(cell[2], cell[0], key, cell[1]);
  const float inclination = std::acos(std::clamp(base.z, -1.0f, 1.0f)) + a * kPi * isotropy;
  const float flat = std::sqrt(base.x * base.x + base.y * base.y);
  const float azimuth =
      (base.y < 0.0f ? -1.0f : 1.0f) * std::acos(flat > 0.0f ? std::clamp(base.x / flat, -1.0f, 1.0f) : 1.0f) + b * kPi * isotropy;
  return {{std::sin(inclination) * std::cos(azimuth), std::sin(inclination) * std::sin(azimuth), std::cos(inclination)}};
}

inline Vec2 gabor_cell(Point<3> cell, Point<3> p, float frequency, float isotropy, Vec3 orientation) {
  Vec2 sum;
  for (int i = 0; i < kImpulses; ++i) {
    const float key = float(3 * i);
    const Rgb r = hash_rgb(Point<4>{{cell[0], cell[1], cell[2], key + 1}});
    const Point<3> offset = p - Point<3>{{r.r(), r.g(), r.b()}};
    const float d2 = dot(offset, offset);
    if (d2 >= 1.0f) continue;
    const Point<3> direction = gabor_direction(orientation, isotropy, cell, key);
    const float sign = hash01(cell[0], cell[1], cell[2], key + 2) < 0.5f ? -1.0f : 1.0f;
    sum = sum + sign * gabor_kernel(d2, frequency * dot(offset, direction));
  }
  return sum;
}

template <int N, class Orientation>
Vec2 gabor_phasor(Point<N> p, float frequency, float isotropy, Orientation orientation) {
  const Point<N> cell = map(p, [](float x) { return std::floor(x); }), local = p - cell;
  Vec2 sum;
  for (int i = 0; i < (N == 2 ? 9 : 27); ++i) {
    Point<N> step;
    for (int d = 0, rest = i; d < N; ++d, rest /= 3) step[d] = float(rest % 3 - 1);
    sum = sum + gabor_cell(cell + step, local - step, frequency, isotropy, orientation);
  }
  return sum;
}

}  // namespace detail

// At scaled coordinates; `dimensions` is 2 or 3.
inline Gabor gabor(Vec3 p, int dimensions, float frequency, float anisotropy, float orientation_2d, Vec3 orientation_3d) {
  const float isotropy = 1.0f - clamp01(anisotropy);
  frequency = std::max(0.001f, frequency);
  const bool flat = dimensions == 2;
  const Vec2 phasor = flat ? detail::gabor_phasor(coordinates<2>(p, 0), frequency, isotropy, orientation_2d)
                           : detail::gabor_phasor(coordinates<3>(p, 0), frequency, isotropy, normalize(orientation_3d));
  // Six standard deviations of the sum of impulses, half of which are at zero phase. [Lagae09 sec. 3.3]
  const float kernel_energy = flat ? 0.25f : 1.0f / (4.0f * std::sqrt(2.0f));
  const float norm = 1.0f / (6.0f * std::sqrt(float(detail::kImpulses) * 0.5f * kernel_energy));
  return {phasor.y * norm * 0.5f + 0.5f, (std::atan2(phasor.y, phasor.x) + kPi) / (2.0f * kPi),
          std::sqrt(phasor.x * phasor.x + phasor.y * phasor.y) * norm};
}

}  // namespace gi::texture
