// Light that falls anywhere on the film, from any thread: sums in fixed point, whose order cannot matter, folded into the picture at
// the end of each pass. Leaves out which pixels light belongs to (film.cpp).
#pragma once
#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "core/vec.h"

namespace gi {

class Splats {
 public:
  // `unit`: what one count is worth; sums of a pass beyond 2⁶² units are cut off.
  Splats(size_t pixels, double unit);

  void add(size_t pixel, Rgb value) {
    for (int k = 0; k < 3; ++k) {
      const double units = std::clamp(double(value[k]) * per_unit_, -kMost, kMost);
      pass_[3 * pixel + size_t(k)].fetch_add(int64_t(units < 0 ? units - 0.5 : units + 0.5), std::memory_order_relaxed);
    }
  }
  // Ends a pass: its sums become one sample of every pixel. A pass that is left unfinished is not to count: drop().
  void fold();
  void drop();

  // Of the passes so far. Any thread.
  Rgb mean(size_t pixel) const;
  double variance_of_mean(size_t pixel) const;  // of luminance
  std::mutex& mutex() const { return mutex_; }  // to hold while reading
  size_t memory_bytes() const { return sum_.size() / 5 * (3 * sizeof(int64_t) + 5 * sizeof(double)); }

 private:
  static constexpr double kMost = 0x1p58;
  double per_unit_, unit_;
  std::unique_ptr<std::atomic<int64_t>[]> pass_;
  std::vector<double> sum_;  // of each pixel: red, green, blue, luminance, its square
  uint32_t passes_ = 0;
  mutable std::mutex mutex_;
};

}  // namespace gi
