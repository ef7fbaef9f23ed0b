// The irradiance records of one bounce as they come about: where each was gathered, how far it holds, how it gets better as more rays are
// gathered there, and as rows of a table that outlasts the render. Leaves out how places are found and rays followed.
#pragma once
#include <string>

#include "core/point_tree.h"
#include "transport/irradiance_gather.h"
#include "transport/irradiance_smoothing.h"

namespace gi {

// Where a path came upon a diffuse surface: where a record may be wanted.
struct IrradiancePlace {
  Vec3 position, ng, normal;
  float footprint = 0, spread = 0;  // of the pixel, as it is seen from here on
  float most = kInf;                // a radius beyond which a record of another picture is too coarse here
};

// How far records hold at least and at most.
struct IrradianceSpacing {
  float min_pixels, max_pixels;
  float min_length, max_length;  // metres; 0: none
};

class IrradianceLevel {
 public:
  static constexpr size_t kColumns = IrradianceRecord::kNumbers + 8;

  IrradianceLevel(Bounds bounds, float error, IrradianceSpacing spacing, float smoothing)
      : cache_(bounds, error), spacing_(spacing), strength_(smoothing) {}

  const IrradianceCache& cache() const { return cache_; }
  size_t size() const { return cache_.records().size(); }
  const IrradiancePlace& place(size_t record) const { return growth_[record].place; }
  double gathers() const;  // of all records
  bool is_fixed(size_t record) const { return growth_[record].fixed; }

  void insert(const IrradiancePlace& place, const GatheredIrradiance& gathered);
  // More rays for one record, worth so many times its first ones. No lookup knows before the next `smooth`.
  void improve(size_t record, const GatheredIrradiance& guided, float worth);
  // Where more rays of a record should go, by what first rays of those near by have met; of the records of the last `learn`.
  void learn(ThreadPool& pool);
  IrradianceGuide guide(size_t record) const;
  void freeze() { cache_.freeze(); }
  // From now on lookups find the light that was gathered, evened out, of all records from `first` on. `pass`: the first to see it.
  void smooth(ThreadPool& pool, const std::atomic<bool>& cancelled, int pass, size_t first = 0);
  bool is_worth_smoothing() const { return improved_ > kImproved * gathers(); }

  // Rows of kColumns numbers: records as `passes` passes have seen them on average.
  std::vector<float> rows(int passes) const;
  // Throws InputError naming the row that is none. `fixed`: nothing is to improve them.
  void take_over(const std::vector<float>& rows, bool fixed);
  static void check(const std::vector<float>& rows, const std::string& name);
  // Goes on in another render, whose passes are counted from 0.
  void begin_anew();

 private:
  static constexpr double kImproved = 1.0 / 16.0;  // of all gathers

  // What was gathered is the mean of all gathers; what passes saw of it, the mean over passes.
  struct Growth {
    IrradiancePlace place;
    float gathers = 1;
    bool fixed = false;
    int changed = 0;            // pass that was the first to see it as it is
    IrradianceRecord seen = {};  // sum over the passes before that
  };
  IrradianceRecord settled(const IrradiancePlace& place, const GatheredIrradiance& gathered) const;

  IrradianceCache cache_;
  IrradianceSpacing spacing_;
  float strength_;
  std::vector<Growth> growth_;
  std::vector<IrradianceSmoothing::Gathered> gathered_;
  IrradianceSmoothing smoothing_;
  std::vector<Sighting> sightings_;    // of all records' first rays
  std::vector<size_t> sighted_{0};     // where those of each begin
  PointTree tree_;
  double improved_ = 0;  // gathers since the last smoothing
};

}  // namespace gi
