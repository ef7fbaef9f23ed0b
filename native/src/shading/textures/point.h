// A point in 1 to 4 dimensions, for textures that are the same algorithm in each. No more than they need.
#pragma once
#include <cmath>

#include "core/vec.h"

namespace gi::texture {

using gi::lerp;  // beside the one for points

template <int N>
struct Point {
  float v[N] = {};
  float& operator[](int i) { return v[i]; }
  float operator[](int i) const { return v[i]; }
};

template <int N, class F>
Point<N> map(Point<N> a, F f) {
  for (int i = 0; i < N; ++i) a[i] = f(a[i]);
  return a;
}
template <int N>
Point<N> operator+(Point<N> a, Point<N> b) {
  for (int i = 0; i < N; ++i) a[i] += b[i];
  return a;
}
template <int N>
Point<N> operator-(Point<N> a, Point<N> b) {
  for (int i = 0; i < N; ++i) a[i] -= b[i];
  return a;
}
template <int N>
Point<N> operator*(Point<N> a, float s) {
  for (int i = 0; i < N; ++i) a[i] *= s;
  return a;
}
template <int N>
Point<N> lerp(Point<N> a, Point<N> b, float t) {
  return a * (1.0f - t) + b * t;
}
template <int N>
float dot(Point<N> a, Point<N> b) {
  float sum = 0;
  for (int i = 0; i < N; ++i) sum += a[i] * b[i];
  return sum;
}

// What a texture node takes as its coordinates: 1D textures read W, 4D ones both.
template <int N>
Point<N> coordinates(Vec3 p, float w) {
  if constexpr (N == 1) return {{w}};
  if constexpr (N == 2) return {{p.x, p.y}};
  if constexpr (N == 3) return {{p.x, p.y, p.z}};
  if constexpr (N == 4) return {{p.x, p.y, p.z, w}};
}

// Calls f with the number of dimensions as a compile-time constant.
template <class F>
void with_dimensions(int n, F f) {
  switch (n) {
    case 1: return f.template operator()<1>();
    case 2: return f.template operator()<2>();
    case 4: return f.template operator()<4>();
    default: return f.template operator()<3>();
  }
}

}  // namespace gi::texture
