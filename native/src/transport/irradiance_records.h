// The irradiance records of all bounces of a picture: an overture fills them from coarse to fine, in waves whose order no thread can
// change; passes only read; between passes records get more rays. Leaves out what a record's rays bring home: the integrator's.
#pragma once
#include <functional>

#include "core/kept.h"
#include "core/sampler.h"
#include "core/tally.h"
#include "film/film.h"
#include "transport/irradiance_level.h"
#include "transport/path_state.h"
#include "transport/render_context.h"

namespace gi {

struct IrradianceRecordsSettings {
  float error;  // allowed of records of the first bounce
  int samples;  // rays of a record, each time that it is gathered
  int levels;   // diffuse bounces that have records
  float refinement;  // share of the passes' time in which records get more rays
  float smoothing;   // standard deviations of their noise by which records may be evened out
  IrradianceSpacing spacing;
  BounceLimits limits;
};

class IrradianceRecords {
 public:
  static constexpr int kMostLevels = 8;
  // What one ray of a record sees: from where, and as what path, past its diffuse bounce.
  using Follow = std::function<GatheredRay(const CameraRay& from, const PathState& path, Sampler& sampler)>;

  explicit IrradianceRecords(const IrradianceRecordsSettings& settings) : s_(settings) {}

  // Fills the records before the first pass, refines them before others.
  void before_pass(const RenderContext& context, const Film& film, int pass, const Follow& follow);
  void after_pass(const RenderContext& context, int pass);

  // What diffuse lobes scatter of light from other surfaces; nothing where records do not know it for all of them.
  std::optional<Rgb> read(const ShadingPoint& point, const Bsdf& bsdf, PixelSample& result) const;

  // Diffuse bounces that a path may still make, and how many of all it has made: its level.
  int most_bounces() const { return std::min(s_.limits.diffuse, s_.limits.total); }
  int level_of(const PathState& state) const {
    return most_bounces() - std::min(s_.limits.diffuse - state.diffuse_depth, s_.limits.total - state.depth);
  }

  size_t size() const;
  void take_over(const Kept& kept);  // before the first pass
  // The same, of a render of the same scene and settings, which may have been stopped anywhere and is not used any more.
  void continue_from(IrradianceRecords& earlier);
  bool takes_over() const { return !taken_over_.empty() || !levels_.empty(); }  // asked before the first pass
  Kept keep() const;

 private:
  // A render's part of it.
  struct Work {
    const RenderContext& context;
    const Film& film;
    const Follow& follow;
  };
  static constexpr float kWorth = 3.0f;  // first rays that a guided one is worth, about: no record's own noise may decide it
  std::optional<Rgb> look_up(const ShadingPoint& point, const Bsdf& bsdf, int level, PixelSample& result) const;
  void play_overture(const Work& work);
  void fill_level(const Work& work, int level);
  void fill_gaps(const Work& work, int pass, double most_rays);
  void fill_seen(const Work& work, int level, int step, int round);
  void seek(const Work& work, const Camera& eye, int x, int y, int level, int round, std::vector<IrradiancePlace>& places) const;
  void fill(const Work& work, std::vector<IrradiancePlace> places, int level);
  double passes_to_expect(const RenderContext& context, int pass) const;
  double rays_to_refine(int pass, double passes) const;
  void refine(const Work& work, int pass);
  void sharpen(const Work& work, int level, size_t first);
  GatheredIrradiance gather(const Work& work, const IrradiancePlace& place, int level, uint32_t serial) const;
  GatheredIrradiance gather_guided_by_others(const Work& work, int level, size_t record, uint32_t serial) const;
  GatheredRay follow(const Work& work, const IrradiancePlace& place, int level, Vec3 direction, Sampler& sampler) const;
  bool is_late(const RenderContext& context) const { return context.time_limit > 0.0 && context.seconds() > level_ends_; }

  double miss_rate() const {
    const double misses = double(misses_.total()), all = double(hits_.total()) + misses;
    return all > 0.0 ? misses / all : 0.0;
  }
  int level_count() const { return std::min(s_.levels, most_bounces()); }
  // Deeper records are seen through shallower ones: they may be coarser.
  float error_at(int level) const { return level == 0 ? s_.error : std::min(2.0f * s_.error, 0.6f); }
  int samples_at(int level) const { return level == 0 ? s_.samples : std::max(s_.samples / 3, 32); }
  // Of those, the ones that know of nothing yet, and those that they guide, also when the record is refined.
  int first_samples_at(int level) const { return std::max(samples_at(level) * 3 / 8, 24); }
  int guided_samples_at(int level) const { return std::max(samples_at(level) - first_samples_at(level), 16); }
  float worth_at(int level) const { return kWorth * float(guided_samples_at(level)) / float(first_samples_at(level)); }

  IrradianceRecordsSettings s_;
  std::vector<IrradianceLevel> levels_;
  bool is_open_ = false;  // the overture has been played
  mutable Tally hits_, misses_;                 // of the first bounce, while the picture is made
  uint32_t gathered_ = 0;                       // records, those included that were not needed in the end
  std::vector<std::vector<float>> taken_over_;  // rows, by level
  size_t refined_ = 0;                          // records, all levels' in turn
  double refining_rays_ = 0, pass_rays_ = 0;
  uint64_t rays_before_ = 0;  // the pass under way
  int passes_ = 0;
  float slack_ = 1.0f;
  double overture_seconds_ = 0;
  double level_ends_ = 0;  // seconds after which no more records are begun, where there is a time limit
};

}  // namespace gi
