// The noise of irradiance records evened out: each becomes the mean of as many of its neighbours as differ from it by no more than noise
// explains. As records get more rays there is less noise to hide behind, and the means narrow. [Lepski 1991] Leaves out gathering.
#pragma once
#include "core/parallel.h"
#include "transport/irradiance_cache.h"

namespace gi {

class IrradianceSmoothing {
 public:
  // What a record's rays brought home, and how sure that is.
  struct Gathered {
    IrradianceRecord light;
    float variance = 0;  // of the irradiance's luminance, (W/m²)²
  };

  IrradianceSmoothing() = default;
  // Finds the neighbours: on the same surface, and nearer than anything that either of them sees.
  IrradianceSmoothing(const IrradianceCache& cache, ThreadPool& pool, const std::atomic<bool>& cancelled);

  size_t size() const { return begin_.empty() ? 0 : begin_.size() - 1; }
  // `records`: all of the cache's, in its order. `strength`: how many times its standard deviation a mean may be off; 0: none.
  IrradianceRecord smooth(const std::vector<Gathered>& records, uint32_t record, float strength) const;

 private:
  std::vector<uint32_t> begin_, neighbours_;  // of each record, the nearest first, itself before all
};

}  // namespace gi
