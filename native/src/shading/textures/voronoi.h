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

// A cell's feature point: relative to the middle cell, at `offset` cells from it.
template <int N>
struct Feature {
  int offset[N];
  Point<N> point;
};

template <int N>
Rgb cell_color(const Cell<N>& cell, const int (&offset)[N], bool float_hash) {
  if (N == 1 || float_hash) {
    Point<N> key;
    for (int d = 0; d < N; ++d) key[d] = cell.floor[d] + float(offset[d]);
    return hash_rgb(key);
  }
  int32_t index[N < 3 ? 3 : N] = {};  // two dimensions hash as three
  for (int d = 0; d < N; ++d) index[d] = int32_t(uint32_t(cell.index[d]) + uint32_t(offset[d]));
  const auto h = hash_cell(index);
  return {h[0], h[1], h[2]};
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

constexpr int power(int base, int exponent) { return exponent == 0 ? 1 : base * power(base, exponent - 1); }

// Offsets of the cells at most `Reach` away, in the order that ties are broken by.
template <int Reach, int N>
struct Neighbours {
  static constexpr int kSide = 2 * Reach + 1, kCount = power(kSide, N), kLanes = (kCount + 3) / 4 * 4;
  int32_t offset[N][kLanes] = {};
  constexpr Neighbours() {
    for (int i = 0; i < kCount; ++i)
      for (int d = 0, rest = i; d < N; ++d, rest /= kSide) offset[d][i] = rest % kSide - Reach;
  }
};
template <int Reach, int N>
inline constexpr Neighbours<Reach, N> kNeighbours;

// The feature points of the cells at most `Reach` away from `middle`; plain loops over all of them at once.
template <int Reach, int N>
class Features {
 public:
  static constexpr int kCount = Neighbours<Reach, N>::kCount, kLanes = Neighbours<Reach, N>::kLanes;

  Features(const Cell<N>& cell, const VoronoiSettings& s, const int (&middle)[N] = {}) {
    for (int d = 0; d < N; ++d)
      for (int i = 0; i < kLanes; ++i) offset_[d][i] = kNeighbours<Reach, N>.offset[d][i] + middle[d];
    if constexpr (N == 1)
      for (int i = 0; i < kLanes; ++i) jitter_[0][i] = hash01(cell.floor[0] + float(offset_[0][i]));
    else if (s.float_hash)
      hash_as_floats(cell);
    else
      hash_as_integers(cell);
    for (int d = 0; d < N; ++d)
      for (int i = 0; i < kLanes; ++i) point_[d][i] = float(offset_[d][i]) + jitter_[d][i] * s.randomness;
  }
  Point<N> point(int i) const {
    Point<N> p;
    for (int d = 0; d < N; ++d) p[d] = point_[d][i];
    return p;
  }
  Feature<N> operator[](int i) const {
    Feature<N> feature{{}, point(i)};
    for (int d = 0; d < N; ++d) feature.offset[d] = offset_[d][i];
    return feature;
  }
  Rgb color(const Cell<N>& cell, int i, bool float_hash) const {
    if constexpr (N >= 3)
      if (!float_hash) return {jitter_[0][i], jitter_[1][i], jitter_[2][i]};  // the same hash
    return cell_color(cell, (*this)[i].offset, float_hash);
  }
  // `out` grows with the distance from `p` and is cheaper: enough to find the nearest.
  void order(Point<N> p, const VoronoiSettings& s, float (&out)[kLanes]) const {
    if (s.metric == VoronoiMetric::kEuclidean || N == 1)
      squared_distances(p, out);
    else
      for (int i = 0; i < kCount; ++i) out[i] = distance_order(point(i), p, s);
  }
  void squared_distances(Point<N> p, float (&out)[kLanes]) const {
    for (int i = 0; i < kLanes; ++i) {
      float sum = 0;
      for (int d = 0; d < N; ++d) sum += (point_[d][i] - p[d]) * (point_[d][i] - p[d]);
      out[i] = sum;
    }
  }

 private:
  void hash_as_floats(const Cell<N>& cell) {
    uint32_t keys[N][kLanes];
    for (int d = 0; d < N; ++d)
      for (int i = 0; i < kLanes; ++i) keys[d][i] = std::bit_cast<uint32_t>(cell.floor[d] + float(offset_[d][i]));
    PointHash<kLanes>::run(keys, jitter_);
  }
  void hash_as_integers(const Cell<N>& cell) {
    int32_t index[N][kLanes];
    for (int d = 0; d < N; ++d)
      for (int i = 0; i < kLanes; ++i) index[d][i] = int32_t(uint32_t(cell.index[d]) + uint32_t(offset_[d][i]));
    hash_cells(index, jitter_);
  }

  int32_t offset_[N][kLanes];
  float jitter_[N][kLanes], point_[N][kLanes];
};

// The first of the least.
template <int Count, int Lanes>
int least(const float (&x)[Lanes]) {
  int best = 0;
  for (int i = 1; i < Count; ++i)
    if (x[i] < x[best]) best = i;
  return best;
}

template <int N, int Reach>
VoronoiSample<N> sample_at(const Cell<N>& cell, const Features<Reach, N>& features, int i, const VoronoiSettings& s) {
  return {distance(features.point(i), cell.local, s), features.color(cell, i, s.float_hash), features.point(i) + cell.floor};
}

template <int N>
VoronoiSample<N> nearest(Point<N> p, const VoronoiSettings& s) {
  const Cell<N> cell(p);
  const Features<1, N> features(cell, s);
  float order[features.kLanes];
  features.order(cell.local, s, order);
  return sample_at(cell, features, least<features.kCount>(order), s);
}

template <int N>
VoronoiSample<N> second_nearest(Point<N> p, const VoronoiSettings& s) {
  const Cell<N> cell(p);
  const Features<1, N> features(cell, s);
  float order[features.kLanes];
  features.order(cell.local, s, order);
  int first = 0, second = -1;
  for (int i = 1; i < features.kCount; ++i) {
    if (order[i] < order[first])
      second = first, first = i;
    else if (second < 0 || order[i] < order[second])
      second = i;
  }
  return sample_at(cell, features, second, s);
}

// A minimum that blends where distances are within `smoothness` of each other; two cells far, or it would show seams.
template <int N>
VoronoiSample<N> smooth_nearest(Point<N> p, const VoronoiSettings& s) {
  const Cell<N> cell(p);
  const Features<2, N> features(cell, s);
  VoronoiSample<N> sum;
  for (int i = 0; i < features.kCount; ++i) {
    const float d = distance(features.point(i), cell.local, s);
    const float t = i == 0 ? 1.0f : clamp01(0.5f + 0.5f * (sum.distance - d) / s.smoothness);
    if (t == 0.0f) continue;  // too far to change anything, as most are
    const float h = t * t * (3.0f - 2.0f * t), dip = s.smoothness * h * (1.0f - h), soft_dip = dip / (1.0f + 3.0f * s.smoothness);
    sum.distance = lerp(sum.distance, d, h) - dip;
    sum.color = lerp(sum.color, features.color(cell, i, s.float_hash), h) - Rgb(soft_dip);
    sum.position = map(lerp(sum.position, features.point(i), h), [soft_dip](float x) { return x - soft_dip; });
  }
  sum.position = sum.position + cell.floor;
  return sum;
}

template <int N>
float distance_to_edge(Point<N> p, const VoronoiSettings& s) {
  const Cell<N> cell(p);
  const Features<1, N> features(cell, s);
  if constexpr (N == 1) {
    const auto edge = [&](int i) { return std::abs((features.point(1)[0] + features.point(i)[0]) * 0.5f - cell.local[0]); };
    return std::min(edge(0), edge(2));
  } else {
    float order[features.kLanes];
    features.squared_distances(cell.local, order);
    const Point<N> closest = features.point(least<features.kCount>(order)) - cell.local;
    // The edge to each other feature point is the plane half way to it.
    float edge = kInf;
    for (int i = 0; i < features.kCount; ++i) {
      const Point<N> v = features.point(i) - cell.local, across = v - closest;
      const float l2 = dot(across, across);
      if (l2 > 0.0001f) edge = std::min(edge, dot((v + closest) * 0.5f, across) / std::sqrt(l2));
    }
    return edge;
  }
}

// Half of how far the nearest feature point is from its own nearest neighbour.
template <int N>
float sphere_radius(Point<N> p, const VoronoiSettings& s) {
  const Cell<N> cell(p);
  const Features<1, N> features(cell, s);
  float order[features.kLanes];
  features.squared_distances(cell.local, order);
  const Feature<N> closest = features[least<features.kCount>(order)];
  const Features<1, N> around(cell, s, closest.offset);
  around.squared_distances(closest.point, order);
  order[around.kCount / 2] = kInf;  // itself
  return std::sqrt(order[least<around.kCount>(order)]) * 0.5f;
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
