// Piecewise constant distributions over [0,1) and [0,1)², sampled by inverting their cumulative sums.
// Negative and non-finite values count as zero; where nothing is left the distribution is uniform.
#pragma once
#include <vector>

#include "core/vec.h"

namespace gi {

class Distribution1D {
 public:
  Distribution1D() = default;
  explicit Distribution1D(const std::vector<float>& values) : cdf_(values.size() + 1, 0.0f) {
    double sum = 0;
    for (float v : values) sum += v > 0.0f && std::isfinite(v) ? double(v) : 0.0;
    double running = 0;
    for (size_t i = 0; i < values.size(); ++i) {
      const double v = values[i] > 0.0f && std::isfinite(values[i]) ? double(values[i]) : 0.0;
      running += v;
      cdf_[i + 1] = sum > 0 ? float(running / sum) : float(i + 1) / float(values.size());
    }
    if (!values.empty()) cdf_.back() = 1.0f;
    total_ = sum;
  }

  size_t size() const { return cdf_.empty() ? 0 : cdf_.size() - 1; }
  double total() const { return total_; }  // sum of the values
  float probability(size_t i) const { return cdf_[i + 1] - cdf_[i]; }
  // Picks a bin; `u` becomes the place within it, again uniform.
  size_t sample(float& u) const {
    // The last bin whose start is ≤ u and that is not empty: upper_bound skips bins of no width.
    const auto it = std::upper_bound(cdf_.begin(), cdf_.end(), u);
    size_t i = size_t(std::max<std::ptrdiff_t>(it - cdf_.begin() - 1, 0));
    i = std::min(i, size() - 1);
    const float p = probability(i);
    u = p > 0.0f ? std::min((u - cdf_[i]) / p, kOneMinusEpsilon) : 0.5f;
    return i;
  }

 private:
  std::vector<float> cdf_;
  double total_ = 0;
};

// Rows are y. Densities are with respect to the unit square.
class Distribution2D {
 public:
  Distribution2D() = default;
  Distribution2D(const std::vector<float>& values, int width, int height) : width_(width), height_(height) {
    std::vector<float> sums, row(static_cast<size_t>(width));
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) row[size_t(x)] = values[size_t(y) * size_t(width) + size_t(x)];
      rows_.emplace_back(row);
      sums.push_back(float(rows_.back().total() / width));
    }
    marginal_ = Distribution1D(sums);
  }

  bool empty() const { return rows_.empty(); }
  int width() const { return width_; }
  int height() const { return height_; }
  Vec2 sample(Vec2 u) const {
    const size_t y = marginal_.sample(u.y), x = rows_[y].sample(u.x);
    return {std::min((float(x) + u.x) / float(width_), kOneMinusEpsilon), std::min((float(y) + u.y) / float(height_), kOneMinusEpsilon)};
  }
  float pdf(Vec2 p) const {
    const size_t x = size_t(std::clamp(int(p.x * float(width_)), 0, width_ - 1));
    const size_t y = size_t(std::clamp(int(p.y * float(height_)), 0, height_ - 1));
    return marginal_.probability(y) * rows_[y].probability(x) * float(width_) * float(height_);
  }

 private:
  int width_ = 0, height_ = 0;
  std::vector<Distribution1D> rows_;
  Distribution1D marginal_;
};

}  // namespace gi
