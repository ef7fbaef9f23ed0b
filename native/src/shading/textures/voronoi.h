// Blender's Voronoi texture in 1 to 4 dimensions: one feature point in every cell of the unit grid.
// [Worley 1996, "A cellular texture basis function"]; distance to edges and smoothing after Quilez' articles (iquilezles.org).
#pragma once
#include "shading/textures/hash.h"

namespace gi::texture {

enum class VoronoiFeature { kF1, kF2, kSmoothF1, kDistanceToEdge, kNSphereRadius };
enum class VoronoiMetric { kEuclidean, kManhattan, kChebychev, kMinkowski };

struct VoronoiSettings {
  VoronoiFeature feature = VoronoiFeature::kF1;
  VoronoiMetric metric = VoronoiMetric::kEuclidean;
  bool normalize = false;
  bool float_hash = false;  // as until Blender 4.5: cells are hashed as floats, not as integers
  float detail = 0, roughness = 0.5f, lacunarity = 2, smoothness = 0.5f, exponent = 0.5f, randomness = 1;
};

template <int N>
struct VoronoiSample {
  float distance = 0;  // or the radius
  Rgb color;
  Point<N> position;
};

namespace detail {

// The unit cell that holds a point, and the point relative to it.
template <int N>
struct Cell {
  int32_t index[N];
  Point<N> local, floor;
  explicit Cell(Point<N> p) {
    for (int d = 0; d < N; ++d) {
      floor[d] = std::floor(p[d]), local[d] = p[d] - floor[d];
      // Beyond the range of integers every cell is the same one.
      index[d] = std::abs(floor[d]) < 2e9f ? int32_t(floor[d]) : 0;
    }
  }
};

// A neighbouring cell's feature point: relative to the middle cell, at `offset` cells from it.
template <int N>
struct Feature {
  int offset[N];
  Point<N> point;
};

template <int N>
Point<N> cell_key(const Cell<N>& cell, const int (&offset)[N]) {
  Point<N> key;
  for (int d = 0; d < N; ++d) key[d] = cell.floor[d] + float(offset[d]);
  return key;
}
template <int N>
Point<N> jitter(const Cell<N>& cell, const int (&offset)[N], bool float_hash) {
  if constexpr (N == 1) {
    return {{hash_value(cell_key(cell, offset))}};
  } else {
    if (float_hash) return hash_point(cell_key(cell, offset));
    int32_t index[N];
    for (int d = 0; d < N; ++d) index[d] = int32_t(uint32_t(cell.index[d]) + uint32_t(offset[d]));
    return hash_cell(index);
  }
}
template <int N>
Rgb cell_color(const Cell<N>& cell, const int (&offset)[N], bool float_hash) {
  if (N == 1 || float_hash) return hash_rgb(cell_key(cell, offset));
  int32_t index[N < 3 ? 3 : N] = {};  // two dimensions hash as three
  for (int d = 0; d < N; ++d) index[d] = int32_t(uint32_t(cell.index[d]) + uint32_t(offset[d]));
  const auto h = hash_cell(index);
  return {h[0], h[1], h[2]};
}

// f(feature) for the cells at most `Reach` away from `middle`, in the order that ties are broken by.
template <int Reach, int N, class F>
void for_each_feature(const Cell<N>& cell, const int (&middle)[N], const VoronoiSettings& s, F f) {
  constexpr int kSide = 2 * Reach + 1;
  int count = 1;
  for (int d = 0; d < N; ++d) count *= kSide;
  for (int i = 0; i < count; ++i) {
    Feature<N> feature;
    for (int d = 0, rest = i; d < N; ++d, rest /= kSide) feature.offset[d] = rest % kSide - Reach + middle[d];
    const Point<N> j = jitter(cell, feature.offset, s.float_hash);
    for (int d = 0; d < N; ++d) feature.point[d] = float(feature.offset[d]) + j[d] * s.randomness;
    f(feature);
  }
}
template <int Reach, int N, class F>
void for_each_feature(const Cell<N>& cell, const VoronoiSettings& s, F f) {
  const int middle[N] = {};
  for_each_feature<Reach>(cell, middle, s, f);
}

template <int N>
float distance(Point<N> a, Point<N> b, const VoronoiSettings& s) {
  const Point<N> d = map(a - b, [](float x) { return std::abs(x); });
  if (N == 1) return d[0];
  float sum = 0, largest = 0;
  switch (s.metric) {
    case VoronoiMetric::kEuclidean: return std::sqrt(dot(d, d));
    case VoronoiMetric::kManhattan:
      for (int i = 0; i < N; ++i) sum += d[i];
      return sum;
    case VoronoiMetric::kChebychev:
      for (int i = 0; i < N; ++i) largest = std::max(largest, d[i]);
      return largest;
    case VoronoiMetric::kMinkowski:
      for (int i = 0; i < N; ++i) sum += std::pow(d[i], s.exponent);
      return std::pow(sum, 1.0f / s.exponent);
  }
  return 0;
}
// Grows with `distance` and is cheaper: enough to find the nearest.
template <int N>
float distance_order(Point<N> a, Point<N> b, const VoronoiSettings& s) {
  const Point<N> d = a - b;
  if (s.metric == VoronoiMetric::kEuclidean || N == 1) return dot(d, d);
  if (s.metric != VoronoiMetric::kMinkowski) return distance(a, b, s);
  float sum = 0;
  for (int i = 0; i < N; ++i) sum += std::pow(std::abs(d[i]), s.exponent);
  return sum;
}

template <int N>
VoronoiSample<N> nearest(Point<N> p, const VoronoiSettings& s) {
  const Cell<N> cell(p);
  Feature<N> best{};
  float best_order = kInf;
  for_each_feature<1>(cell, s, [&](const Feature<N>& f) {
    const float order = distance_order(f.point, cell.local, s);
    if (order < best_order) best_order = order, best = f;
  });
  return {distance(best.point, cell.local, s), cell_color(cell, best.offset, s.float_hash), best.point + cell.floor};
}

template <int N>
VoronoiSample<N> second_nearest(Point<N> p, const VoronoiSettings& s) {
  const Cell<N> cell(p);
  Feature<N> first{}, second{};
  float d1 = kInf, d2 = kInf;
  for_each_feature<1>(cell, s, [&](const Feature<N>& f) {
    const float d = distance_order(f.point, cell.local, s);
    if (d < d1) {
      d2 = d1, second = first;
      d1 = d, first = f;
    } else if (d < d2) {
      d2 = d, second = f;
    }
  });
  return {distance(second.point, cell.local, s), cell_color(cell, second.offset, s.float_hash), second.point + cell.floor};
}

// A minimum that blends where distances are within `smoothness` of each other; two cells far, or it would show seams.
template <int N>
VoronoiSample<N> smooth_nearest(Point<N> p, const VoronoiSettings& s) {
  const Cell<N> cell(p);
  VoronoiSample<N> sum;
  bool first = true;
  for_each_feature<2>(cell, s, [&](const Feature<N>& f) {
    const float d = distance(f.point, cell.local, s);
    const float t = first ? 1.0f : clamp01(0.5f + 0.5f * (sum.distance - d) / s.smoothness), h = t * t * (3.0f - 2.0f * t);
    first = false;
    const float dip = s.smoothness * h * (1.0f - h), soft_dip = dip / (1.0f + 3.0f * s.smoothness);
    sum.distance = lerp(sum.distance, d, h) - dip;
    sum.color = lerp(sum.color, cell_color(cell, f.offset, s.float_hash), h) - Rgb(soft_dip);
    sum.position = map(lerp(sum.position, f.point, h), [soft_dip](float x) { return x - soft_dip; });
  });
  sum.position = sum.position + cell.floor;
  return sum;
}

template <int N>
float distance_to_edge(Point<N> p, const VoronoiSettings& s) {
  const Cell<N> cell(p);
  if constexpr (N == 1) {
    const auto point = [&](int i) { return float(i) + hash01(cell.floor[0] + float(i)) * s.randomness; };
    const float middle = point(0);
    return std::min(std::abs((middle + point(-1)) * 0.5f - cell.local[0]), std::abs((middle + point(1)) * 0.5f - cell.local[0]));
  } else {
    Point<N> closest;
    float best = kInf;
    for_each_feature<1>(cell, s, [&](const Feature<N>& f) {
      const Point<N> v = f.point - cell.local;
      const float d = dot(v, v);
      if (d < best) best = d, closest = v;
    });
    // The edge to each other feature point is the plane half way to it.
    float edge = kInf;
    for_each_feature<1>(cell, s, [&](const Feature<N>& f) {
      const Point<N> v = f.point - cell.local, across = v - closest;
      const float l2 = dot(across, across);
      if (l2 > 0.0001f) edge = std::min(edge, dot((v + closest) * 0.5f, across) / std::sqrt(l2));
    });
    return edge;
  }
}

// Half of how far the nearest feature point is from its own nearest neighbour.
template <int N>
float sphere_radius(Point<N> p, const VoronoiSettings& s) {
  const Cell<N> cell(p);
  Feature<N> closest{};
  float best = kInf;
  for_each_feature<1>(cell, s, [&](const Feature<N>& f) {
    const float d = dot(f.point - cell.local, f.point - cell.local);
    if (d < best) best = d, closest = f;
  });
  best = kInf;
  for_each_feature<1>(cell, closest.offset, s, [&](const Feature<N>& f) {
    bool same = true;
    for (int d = 0; d < N; ++d) same = same && f.offset[d] == closest.offset[d];
    if (!same) best = std::min(best, dot(f.point - closest.point, f.point - closest.point));
  });
  return std::sqrt(best) * 0.5f;
}

template <int N>
VoronoiSample<N> octave(Point<N> p, const VoronoiSettings& s) {
  if (s.feature == VoronoiFeature::kF2) return second_nearest(p, s);
  if (s.feature == VoronoiFeature::kSmoothF1 && s.smoothness != 0.0f) return smooth_nearest(p, s);
  return nearest(p, s);
}

// The farthest that a feature point can be from any place in its cell.
template <int N>
float largest_distance(const VoronoiSettings& s) {
  if (s.feature == VoronoiFeature::kDistanceToEdge) return 0.5f + 0.5f * s.randomness;
  const Point<N> corner = map(Point<N>{}, [&s](float) { return 0.5f + 0.5f * s.randomness; });
  return distance(Point<N>{}, corner, s) * (s.feature == VoronoiFeature::kF2 ? 2.0f : 1.0f);
}

// Octaves of distance, colour and position, the last one in part where `detail` is not whole.
template <int N>
VoronoiSample<N> fractal(Point<N> p, const VoronoiSettings& s) {
  VoronoiSample<N> sum;
  float amplitude = 1, total = 0, scale = 1;
  if (s.detail == 0.0f || s.roughness == 0.0f) {
    sum = octave(p, s), total = 1;
  } else {
    for (int i = 0; i <= int(std::ceil(s.detail)); ++i) {
      const float share = float(i) <= s.detail ? 1.0f : s.detail - std::floor(s.detail);
      const VoronoiSample<N> o = octave(p * scale, s);
      total += amplitude * share;
      sum.distance += o.distance * amplitude * share;
      sum.color += o.color * (amplitude * share);
      sum.position = lerp(sum.position, lerp(sum.position, o.position * (1.0f / scale), amplitude), share);
      scale *= s.lacunarity, amplitude *= s.roughness;
    }
  }
  if (s.normalize) {
    sum.distance /= total * largest_distance<N>(s);
    sum.color = sum.color * (1.0f / total);
  }
  return sum;
}

template <int N>
float fractal_distance_to_edge(Point<N> p, const VoronoiSettings& s) {
  const float largest = largest_distance<N>(s);
  float amplitude = 1, total = largest, scale = 1, result = 8;
  if (s.detail == 0.0f || s.roughness == 0.0f) {
    result = distance_to_edge(p, s);
  } else {
    for (int i = 0; i <= int(std::ceil(s.detail)); ++i) {
      const float d = distance_to_edge(p * scale, s) / scale, next = lerp(result, std::min(result, d), amplitude);
      const float next_total = lerp(total, largest / scale, amplitude);
      const bool whole = float(i) <= s.detail;
      const float share = whole ? 1.0f : s.detail - std::floor(s.detail);
      total = lerp(total, next_total, share);
      result = whole ? next : lerp(result, std::min(result, next), share);
      scale *= s.lacunarity, amplitude *= s.roughness;
    }
  }
  return s.normalize ? result / total : result;
}

}  // namespace detail

// Blender's Voronoi texture at scaled coordinates; the position is in those coordinates too.
template <int N>
VoronoiSample<N> voronoi_texture(Point<N> p, const VoronoiSettings& s) {
  VoronoiSample<N> result;
  switch (s.feature) {
    case VoronoiFeature::kDistanceToEdge: result.distance = detail::fractal_distance_to_edge(p, s); break;
    case VoronoiFeature::kNSphereRadius: result.distance = detail::sphere_radius(p, s); break;
    default: result = detail::fractal(p, s);
  }
  return result;
}

}  // namespace gi::texture
