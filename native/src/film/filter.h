// Pixel filters by importance sampling: a sample belongs to one pixel, its place is drawn from the filter. [Ernst et al. 2006]
// Kinds and widths as Blender's Film panel has them.
#pragma once
#include <array>

#include "core/vec.h"

namespace gi {

enum class FilterKind { kBox, kGaussian, kBlackmanHarris };

class PixelFilter {
 public:
  PixelFilter(FilterKind kind, float width) {
    const float support = kind == FilterKind::kGaussian ? 3.0f * width : kind == FilterKind::kBlackmanHarris ? 2.0f * width : width;
    // Invert the cumulative distribution of the profile over [-support/2, support/2] on a fine grid.
    constexpr int kSteps = 4096;
    std::array<double, kSteps + 1> cdf{};
    for (int i = 0; i < kSteps; ++i) cdf[i + 1] = cdf[i] + profile(kind, (i + 0.5) / kSteps);
    half_ = 0.5f * support;
    for (int i = 0; i <= kTable; ++i)
      density_[i] = float(profile(kind, double(i) / kTable) * kSteps / (cdf[kSteps] * std::max(double(support), 1e-6)));
    int k = 0;
    for (int i = 0; i <= kTable; ++i) {
      const double want = cdf[kSteps] * i / kTable;
      while (k < kSteps - 1 && cdf[k + 1] < want) ++k;
      const double x = (k + std::clamp((want - cdf[k]) / (cdf[k + 1] - cdf[k]), 0.0, 1.0)) / kSteps;
      table_[i] = float((x - 0.5) * support);
    }
  }
  // Offset from the pixel's centre, in pixels.
  Vec2 sample(Vec2 u) const { return {offset(u.x), offset(u.y)}; }

  struct Share {
    int pixel;
    float weight;  // of all pixels' shares together; what remains of the choice is divided out
  };
  // For light that falls on the film at `x`, in pixels from its edge: one of the pixels that it belongs to, in proportion to the filter.
  Share choose(float x, float u) const {
    const int first = int(std::ceil(x - 0.5f - half_)), last = std::max(first, int(std::floor(x - 0.5f + half_)));
    float sum = 0;
    for (int k = first; k <= last; ++k) sum += density(x - 0.5f - float(k));
    if (!(sum > 0.0f)) return {int(std::floor(x)), 0.0f};
    float left = u * sum;
    for (int k = first; k < last; ++k) {
      left -= density(x - 0.5f - float(k));
      if (left < 0.0f) return {k, sum};
    }
    return {last, sum};
  }

 private:
  static constexpr int kTable = 1024;
  static double profile(FilterKind kind, double x) {  // x in (0, 1) over the support
    if (kind == FilterKind::kBox) return 1.0;
    if (kind == FilterKind::kGaussian) return std::exp(-2.0 * std::pow(6.0 * (x - 0.5), 2.0));
    const double v = 2.0 * 3.14159265358979 * x;  // [Harris 1978]
    return std::max(0.0, 0.35875 - 0.48829 * std::cos(v) + 0.14128 * std::cos(2 * v) - 0.01168 * std::cos(3 * v));
  }
  float offset(float u) const {
    const float x = u * kTable;
    const int i = std::min(int(x), kTable - 1);
    return lerp(table_[i], table_[i + 1], x - float(i));
  }
  float density(float offset) const {  // per pixel
    const float x = (offset + half_) / (2.0f * half_) * kTable;
    if (!(x >= 0.0f && x <= float(kTable))) return 0.0f;
    const int i = std::min(int(x), kTable - 1);
    return lerp(density_[i], density_[i + 1], x - float(i));
  }

  float half_ = 0.5f;  // of the support
  std::array<float, kTable + 1> table_, density_;
};

}  // namespace gi
