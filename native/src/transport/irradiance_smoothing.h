// The noise of irradiance records evened out: each becomes the mean of as many of its neighbours as differ from it by no more than noise
// explains. As records get more rays there is less noise to hide behind, and the means narrow. [Lepski 1991] Leaves out gathering.
#pragma once
#include "core/parallel.h"
#include "transport/irradiance_cache.h"
#include "transport/irradiance_guide.h"

namespace gi {

class IrradianceSmoothing {
 public:
  // What a record's rays brought home, and how sure that is.
  struct Gathered {
    IrradianceRecord light;
    float variance = 0;  // of the irradiance's luminance, (W/m²)²
    Around around{};     // metres, to what lies each way; 0: not known
    float wall = kInf;   // metres, to what takes up some part of its view
  };

  IrradianceSmoothing() = default;
  // Finds the neighbours of all records from `first` on: on the same surface, and nearer than walls that either of them sees, or
  // where both see the same all around.
  IrradianceSmoothing(const IrradianceCache& cache, const std::vector<Gathered>& gathered, size_t first, ThreadPool& pool,
                      const std::atomic<bool>& cancelled);

  // Whether it knows the neighbours of all but the `first` of so many records.
  bool serves(size_t records, size_t first) const { return begin_.size() == records + 1 && first_ <= first; }
  // `records`: all of the cache's, in its order. `strength`: how many times its standard deviation a mean may be off; 0: none.
  IrradianceRecord smooth(const std::vector<Gathered>& records, uint32_t record, float strength) const;

 private:
  size_t first_ = 0;
  std::vector<uint32_t> begin_, neighbours_;  // of each record, the nearest first, itself before all
};

}  // namespace gi
