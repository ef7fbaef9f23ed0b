// Which of many light vertices an eye vertex is joined to: a few, drawn by what they would bring it if nothing stood between and both
// surfaces scattered evenly. Every vertex keeps a chance, so it is unbiased; after [Popov 2015, "Probabilistic connections for
// bidirectional path tracing"], with the guess made anew for each vertex instead of kept in a cache.
#pragma once
#include <vector>

#include "transport/subpath.h"

namespace gi {

class LightChoice {
 public:
  void clear() {
    for (auto& column : columns_) column.clear();
    vertices_.clear();
  }

  void add(const LightVertex& v, uint32_t index) {
    if (!v.bsdf.is_delta()) add(v.point.position, v.point.ng, max_component(abs(v.power)), v.bsdf.flags() & kTransmission, index);
  }
  void add(Vec3 p, Vec3 n, float power, bool both_sides, uint32_t index) {
    const float values[kColumns] = {p.x, p.y, p.z, n.x, n.y, n.z, power, both_sides ? 1.0f : 0.0f};
    for (size_t k = 0; k < kColumns; ++k) columns_[k].push_back(values[k]);
    vertices_.push_back(index);
  }

  // Calls join(index, how often it is drawn on average, what is left of u) for `count` vertices, which may be the same.
  template <class Join>
  void draw(Vec3 position, Vec3 normal, bool both_sides, int count, float u, const Join& join) const {
    const size_t n = vertices_.size();
    if (n == 0) return;
    static thread_local std::vector<float> guesses;
    guesses.resize(n);
    const float sum = guess(position, normal, both_sides, guesses.data());
    if (!(sum > 0.0f) || !std::isfinite(sum)) return;
    // Even steps through the running sum.
    const float step = sum / float(count);
    float next = u * step, running = 0;
    for (size_t i = 0; i < n; ++i) {
      const float before = running;
      running += guesses[i];
      for (; next < running; next += step) join(vertices_[i], guesses[i] / step, (next - before) / guesses[i]);
    }
  }

 private:
  enum { kX, kY, kZ, kNx, kNy, kNz, kPower, kBothSides, kColumns };

  // Power · cos · cos / d², with more than is due at grazing angles, where glossy lobes may have theirs. Returns the sum. Without
  // branches: several at a time.
  float guess(Vec3 z, Vec3 nz, bool both_sides_z, float* __restrict guesses) const {
    constexpr float kGrazing = 0.1f;
    const size_t n = vertices_.size();
    const float *px = columns_[kX].data(), *py = columns_[kY].data(), *pz = columns_[kZ].data();
    const float *nx = columns_[kNx].data(), *ny = columns_[kNy].data(), *nz_ = columns_[kNz].data();
    const float *power = columns_[kPower].data(), *both_sides = columns_[kBothSides].data();
    const float back_z = both_sides_z ? 1.0f : 0.0f;
    for (size_t i = 0; i < n; ++i) {
      const float x = px[i] - z.x, y = py[i] - z.y, w = pz[i] - z.z;
      const float d2 = x * x + y * y + w * w + 1e-12f, over_d = 1.0f / std::sqrt(d2);
      const float cos_z = (x * nz.x + y * nz.y + w * nz.z) * over_d, cos_y = -(x * nx[i] + y * ny[i] + w * nz_[i]) * over_d;
      const float g = power[i] * (std::abs(cos_z) + kGrazing) * (std::abs(cos_y) + kGrazing) * (over_d * over_d);
      const float back_y = both_sides[i], side_z = cos_z > 0.0f ? 1.0f : back_z, side_y = cos_y > 0.0f ? 1.0f : back_y;
      guesses[i] = g * side_z * side_y;
    }
    float sums[4] = {};
    for (size_t i = 0; i < n; ++i) sums[i & 3] += guesses[i];
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
  }

  std::vector<float> columns_[kColumns];
  std::vector<uint32_t> vertices_;
};

}  // namespace gi
