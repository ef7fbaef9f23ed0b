// Folding splats.
#include "film/splats.h"

namespace gi {

Splats::Splats(size_t pixels, double unit)
    : per_unit_(1.0 / unit), unit_(unit), pass_(std::make_unique<std::atomic<int64_t>[]>(3 * pixels)), sum_(5 * pixels, 0.0) {}

void Splats::fold() {
  const std::lock_guard lock(mutex_);
  ++passes_;
  for (size_t p = 0; p < sum_.size() / 5; ++p) {
    float c[3];
    for (size_t k = 0; k < 3; ++k) {
      c[k] = float(double(pass_[3 * p + k].exchange(0, std::memory_order_relaxed)) * unit_);
      sum_[5 * p + k] += double(c[k]);
    }
    const double y = double(luminance({c[0], c[1], c[2]}));
    sum_[5 * p + 3] += y, sum_[5 * p + 4] += y * y;
  }
}

void Splats::drop() {
  for (size_t i = 0; i < sum_.size() / 5 * 3; ++i) pass_[i].store(0, std::memory_order_relaxed);
}

Rgb Splats::mean(size_t pixel) const {
  if (passes_ == 0) return Rgb();
  const double* s = &sum_[5 * pixel];
  return {float(s[0] / passes_), float(s[1] / passes_), float(s[2] / passes_)};
}

double Splats::variance_of_mean(size_t pixel) const {
  if (passes_ < 2) return 0;
  const double n = passes_, mean = sum_[5 * pixel + 3] / n;
  return std::max(0.0, sum_[5 * pixel + 4] / n - mean * mean) / (n - 1);
}

}  // namespace gi
