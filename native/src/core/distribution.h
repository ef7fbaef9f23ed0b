// Piecewise constant distributions over [0,1) and [0,1)², sampled by inverting their cumulative sums.
// Negative and non-finite values count as zero; where nothing is left the distribution is uniform.
#pragma once
#include <vector>

#include "core/vec.h"

namespace gi {

// The cumulative sums of `n` values (fewer than 2³²), which the caller keeps: cdf[0] = 0 … cdf[n] = 1. `guide`: for each of n even steps of
// u, where the search begins. [Chen & Asau 1974, "On generating random variates from an empirical distribution"]
inline double make_cdf(const float* values, size_t n, float* cdf, uint32_t* guide) {
  const auto value = [&](size_t i) { return values[i] > 0.0f && std::isfinite(values[i]) ? double(values[i]) : 0.0; };
  double sum = 0, running = 0;
  for (size_t i = 0; i < n; ++i) sum += value(i);
  cdf[0] = 0.0f;
  for (size_t i = 0; i < n; ++i) {
    running += value(i);
    cdf[i + 1] = sum > 0 ? float(running / sum) : float(i + 1) / float(n);
  }
  cdf[n] = 1.0f;
  uint32_t bin = 0;
  for (size_t k = 0; k < n; ++k) {
    guide[k] = bin;  // of the step before: rounding may put u a step too high, never more
    while (size_t(bin) + 1 < n && cdf[bin + 1] <= float(k) / float(n)) ++bin;
  }
  return sum;
}
// The last bin that begins at or before u and is not empty; `u` becomes the place within it, again uniform.
inline size_t find_bin(const float* cdf, const uint32_t* guide, size_t n, float& u) {
  size_t i = guide[std::min(size_t(u * float(n)), n - 1)];
  while (i + 1 < n && cdf[i + 1] <= u) ++i;
  const float p = cdf[i + 1] - cdf[i];
  u = p > 0.0f ? std::min((u - cdf[i]) / p, kOneMinusEpsilon) : 0.5f;
  return i;
}

class Distribution1D {
 public:
  Distribution1D() = default;
  explicit Distribution1D(const std::vector<float>& values) : cdf_(values.size() + 1), guide_(values.size()) {
    total_ = make_cdf(values.data(), values.size(), cdf_.data(), guide_.data());
  }

  size_t size() const { return guide_.size(); }
  double total() const { return total_; }  // sum of the values
  float probability(size_t i) const { return cdf_[i + 1] - cdf_[i]; }
  size_t sample(float& u) const { return find_bin(cdf_.data(), guide_.data(), size(), u); }

 private:
  std::vector<float> cdf_;
  std::vector<uint32_t> guide_;
  double total_ = 0;
};

// Rows are y, one after the other in memory. Densities are with respect to the unit square.
class Distribution2D {
 public:
  Distribution2D() = default;
  Distribution2D(const std::vector<float>& values, int width, int height)
      : width_(size_t(width)), height_(size_t(height)), cdf_((width_ + 1) * height_), guide_(width_ * height_) {
    std::vector<float> sums;
    for (size_t y = 0; y < height_; ++y)
      sums.push_back(float(make_cdf(values.data() + y * width_, width_, row(y), guide_.data() + y * width_) / width));
    marginal_ = Distribution1D(sums);
  }

  bool empty() const { return guide_.empty(); }
  int width() const { return int(width_); }
  int height() const { return int(height_); }
  Vec2 sample(Vec2 u) const {
    const size_t y = marginal_.sample(u.y), x = find_bin(row(y), guide_.data() + y * width_, width_, u.x);
    return {std::min((float(x) + u.x) / float(width_), kOneMinusEpsilon), std::min((float(y) + u.y) / float(height_), kOneMinusEpsilon)};
  }
  float pdf(Vec2 p) const {
    const size_t x = size_t(std::clamp(int(p.x * float(width_)), 0, width() - 1));
    const size_t y = size_t(std::clamp(int(p.y * float(height_)), 0, height() - 1));
    return marginal_.probability(y) * (row(y)[x + 1] - row(y)[x]) * float(width_) * float(height_);
  }

 private:
  float* row(size_t y) { return cdf_.data() + y * (width_ + 1); }
  const float* row(size_t y) const { return cdf_.data() + y * (width_ + 1); }

  size_t width_ = 0, height_ = 0;
  std::vector<float> cdf_;
  std::vector<uint32_t> guide_;
  Distribution1D marginal_;
};

}  // namespace gi
