// The hash functions that Blender's textures are defined by; other ones would give other pictures.
// Jenkins' lookup3 for floats and noise lattices, signed PCG [Jarzynski & Olano 2020] for Voronoi cells.
#pragma once
#include <algorithm>
#include <array>
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

// A point from the hash of a point's bits, each coordinate in [0, 1], for `Lanes` of them at once.
template <int Lanes>
struct PointHash {
  static void run(const uint32_t (&p)[2][Lanes], float (&out)[2][Lanes]) {
    hash01<2>({p[0], p[1]}, out[0]);
    with_number<3>({p[0], p[1]}, 1.0f, out[1]);
  }
  static void run(const uint32_t (&p)[3][Lanes], float (&out)[3][Lanes]) {
    hash01<3>({p[0], p[1], p[2]}, out[0]);
    for (int i = 1; i < 3; ++i) with_number<4>({p[0], p[1], p[2]}, float(i), out[i]);
  }
  static void run(const uint32_t (&p)[4][Lanes], float (&out)[4][Lanes]) {
    for (int i = 0; i < 4; ++i) hash01<4>({p[(4 - i) % 4], p[(5 - i) % 4], p[(6 - i) % 4], p[(7 - i) % 4]}, out[i]);
  }

 private:
  template <int N>
  static void hash01(std::array<const uint32_t*, N> p, float (&out)[Lanes]) {
    uint32_t keys[N][Lanes];
    for (int d = 0; d < N; ++d) std::copy_n(p[d], Lanes, keys[d]);
    Jenkins<N, Lanes> h;
    h.run(keys);
    for (int l = 0; l < Lanes; ++l) out[l] = float(h.c[l]) * (1.0f / float(0xffffffffu));
  }
  template <int N>
  static void with_number(std::array<const uint32_t*, N - 1> p, float number, float (&out)[Lanes]) {
    uint32_t last[Lanes];
    std::fill_n(last, Lanes, std::bit_cast<uint32_t>(number));
    std::array<const uint32_t*, N> all;
    std::copy_n(p.begin(), N - 1, all.begin()), all[N - 1] = last;
    hash01<N>(all, out);
  }
};

// PCG in 2 to 4 dimensions with arithmetic shifts, 31 bits out, for `Lanes` cells at once.
template <int N, int Lanes>
void hash_cells(const int32_t (&cells)[N][Lanes], float (&out)[N][Lanes]) {
  static_assert(N >= 2 && N <= 4);
  for (int l = 0; l < Lanes; ++l) {
    uint32_t v[4] = {};
    for (int i = 0; i < N; ++i) v[i] = uint32_t(cells[i][l]) * 1664525u + 1013904223u;
    const auto stir = [&v] {
      if constexpr (N == 2) v[0] += v[1] * 1664525u, v[1] += v[0] * 1664525u;
      if constexpr (N == 3) v[0] += v[1] * v[2], v[1] += v[2] * v[0], v[2] += v[0] * v[1];
      if constexpr (N == 4) v[0] += v[1] * v[3], v[1] += v[2] * v[0], v[2] += v[0] * v[1], v[3] += v[1] * v[2];
    };
    stir();
    for (int i = 0; i < N; ++i) v[i] ^= uint32_t(int32_t(v[i]) >> 16);
    stir();
    for (int i = 0; i < N; ++i) out[i][l] = float(int32_t(v[i] & 0x7fffffffu)) * (1.0f / float(0x7fffffffu));
  }
}

template <int N>
Point<N> hash_cell(const int32_t (&cell)[N]) {
  int32_t cells[N][1];
  float out[N][1];
  for (int i = 0; i < N; ++i) cells[i][0] = cell[i];
  hash_cells(cells, out);
  Point<N> point;
  for (int i = 0; i < N; ++i) point[i] = out[i][0];
  return point;
}

}  // namespace gi::texture
