// The hash functions that Blender's textures are defined by; other ones would give other pictures.
// Jenkins' lookup3 for floats and noise lattices, signed PCG [Jarzynski & Olano 2020] for Voronoi cells.
#pragma once
#include <bit>

#include "shading/textures/point.h"

namespace gi::texture {

// N keys hashed for `Lanes` lattice corners at once; plain loops over the lanes, which compilers turn into SIMD.
template <int N, int Lanes>
struct Jenkins {
  uint32_t a[Lanes], b[Lanes], c[Lanes];

  void run(const uint32_t (&keys)[N][Lanes]) {
    constexpr uint32_t start = 0xdeadbeefu + (uint32_t(N) << 2) + 13u;
    for (int l = 0; l < Lanes; ++l) {
      uint32_t x = start + keys[0][l], y = start, z = start;
      if constexpr (N >= 2) y += keys[1][l];
      if constexpr (N >= 3) z += keys[2][l];
      if constexpr (N == 4) {
        mix(x, y, z);
        x += keys[3][l];
      }
      finish(x, y, z);
      c[l] = z;
    }
  }

  static void mix(uint32_t& a, uint32_t& b, uint32_t& c) {
    step(a, b, c, 4), step(b, c, a, 6), step(c, a, b, 8), step(a, b, c, 16), step(b, c, a, 19), step(c, a, b, 4);
  }
  static void finish(uint32_t& a, uint32_t& b, uint32_t& c) {
    fold(c, b, 14), fold(a, c, 11), fold(b, a, 25), fold(c, b, 16), fold(a, c, 4), fold(b, a, 14), fold(c, b, 24);
  }

 private:
  static void step(uint32_t& x, uint32_t& y, uint32_t& z, int r) { x -= z, x ^= std::rotl(z, r), z += y; }
  static void fold(uint32_t& x, uint32_t y, int r) { x ^= y, x -= std::rotl(y, r); }
};

template <int N>
uint32_t hash_bits(const uint32_t (&k)[N]) {
  uint32_t keys[N][1];
  for (int i = 0; i < N; ++i) keys[i][0] = k[i];
  Jenkins<N, 1> h;
  h.run(keys);
  return h.c[0];
}
// Hash of 1 to 4 floats, in [0, 1].
template <class... T>
float hash01(T... x) {
  const uint32_t k[sizeof...(T)] = {std::bit_cast<uint32_t>(float(x))...};
  return float(hash_bits(k)) * (1.0f / float(0xffffffffu));
}

// Three values from the hash of a point, each in [0, 1]. How keys are permuted is part of the definition.
inline Rgb hash_rgb(Point<1> p) { return {hash01(p[0]), hash01(p[0], 1.0f), hash01(p[0], 2.0f)}; }
inline Rgb hash_rgb(Point<2> p) { return {hash01(p[0], p[1]), hash01(p[0], p[1], 1.0f), hash01(p[0], p[1], 2.0f)}; }
inline Rgb hash_rgb(Point<3> p) { return {hash01(p[0], p[1], p[2]), hash01(p[0], p[1], p[2], 1.0f), hash01(p[0], p[1], p[2], 2.0f)}; }
inline Rgb hash_rgb(Point<4> p) { return {hash01(p[0], p[1], p[2], p[3]), hash01(p[2], p[0], p[3], p[1]), hash01(p[3], p[2], p[1], p[0])}; }
inline float hash_value(Point<1> p) { return hash01(p[0]); }
inline float hash_value(Point<2> p) { return hash01(p[0], p[1]); }
inline float hash_value(Point<3> p) { return hash01(p[0], p[1], p[2]); }
inline float hash_value(Point<4> p) { return hash01(p[0], p[1], p[2], p[3]); }

inline Point<2> hash_point(Point<2> p) { return {{hash01(p[0], p[1]), hash01(p[0], p[1], 1.0f)}}; }
inline Point<3> hash_point(Point<3> p) {
  const Rgb c = hash_rgb(p);
  return {{c.r(), c.g(), c.b()}};
}
inline Point<4> hash_point(Point<4> p) {
  return {{hash01(p[0], p[1], p[2], p[3]), hash01(p[3], p[0], p[1], p[2]), hash01(p[2], p[3], p[0], p[1]), hash01(p[1], p[2], p[3], p[0])}};
}

// PCG in 2 to 4 dimensions with arithmetic shifts, 31 bits out.
template <int N>
Point<N> hash_cell(const int32_t (&cell)[N]) {
  static_assert(N >= 2 && N <= 4);
  uint32_t v[4] = {};
  for (int i = 0; i < N; ++i) v[i] = uint32_t(cell[i]) * 1664525u + 1013904223u;
  const auto stir = [&v] {
    if constexpr (N == 2) v[0] += v[1] * 1664525u, v[1] += v[0] * 1664525u;
    if constexpr (N == 3) v[0] += v[1] * v[2], v[1] += v[2] * v[0], v[2] += v[0] * v[1];
    if constexpr (N == 4) v[0] += v[1] * v[3], v[1] += v[2] * v[0], v[2] += v[0] * v[1], v[3] += v[1] * v[2];
  };
  stir();
  for (int i = 0; i < N; ++i) v[i] ^= uint32_t(int32_t(v[i]) >> 16);
  stir();
  Point<N> out;
  for (int i = 0; i < N; ++i) out[i] = float(int32_t(v[i] & 0x7fffffffu)) * (1.0f / float(0x7fffffffu));
  return out;
}

}  // namespace gi::texture
