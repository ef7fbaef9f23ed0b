// IrradianceRecords: overture, waves, guided rays, refinement.
#include "transport/irradiance_records.h"

#include "core/check.h"
#include "transport/camera_path.h"

namespace gi {
namespace {

constexpr int kCoarsest = 32, kFinest = 1;        // pixels between camera rays of the overture
constexpr int kSeedStep = 4;                      // the same for deeper levels
constexpr size_t kLeastWave = 64;                 // records
constexpr size_t kWaveShare = 8;                  // a wave is at most this part of what is there
constexpr double kOvertureShare = 0.5;  // of the time limit, at most
constexpr double kDeeperShare = 0.25;   // of what remains of that, for each level but the first
constexpr float kSlack = 1.3f;          // times the error that is let pass where records were taken over, or each frame would add some
constexpr float kCoarser = 2.0f;        // times the maximum spacing that a record of another frame may hold for
constexpr size_t kRefined = 256;         // records at a time
constexpr double kFewMisses = 0.01;     // of lookups: not worth filling
constexpr double kRaysOfSample = 1.5;   // that one ray of a record comes to
constexpr double kGapsShare = 0.1;      // of the time left, at most
constexpr int kAhead = 4;                // times the passes made for which refining may have been paid
constexpr uint32_t kSeekSalt = 0x1c5eedu, kGatherSalt = 0x1c6a74u;  // streams of their own

std::string name_of_level(size_t level) { return "bounce " + std::to_string(level + 1); }

}  // namespace

// What diffuse lobes scatter of light from other surfaces; nothing where the cache does not know it for all of them.
std::optional<Rgb> IrradianceRecords::read(const ShadingPoint& point, const Bsdf& bsdf, PixelSample& result) const {
  const int level = level_of(point.path);
  if (level >= level_count()) return {};
  const auto found = look_up(point, bsdf, level, result);
  if (point.path.depth == 0) (found ? hits_ : misses_).add();
  return found;
}

std::optional<Rgb> IrradianceRecords::look_up(const ShadingPoint& point, const Bsdf& bsdf, int level, PixelSample& result) const {
  const Vec3 bumped = bsdf.diffuse_normal();
  Rgb radiance;
  for (const uint8_t side : {kReflection, kTransmission}) {
    const Rgb albedo = bsdf.diffuse_albedo(point.wo, side);
    if (is_black(albedo)) continue;
    const float sign = side == kReflection ? 1.0f : -1.0f;
    const auto found = levels_[size_t(level)].cache().find(point.position, point.ns * sign, bumped * sign);
    if (!found) return {};
    radiance += albedo * found->irradiance * kInvPi;
    if (point.path.depth == 0 && found->nearest < point.footprint) result.cache_record = 1.0f;
  }
  return radiance;
}

// ---------------------------------------------------------------- what is kept

Kept IrradianceRecords::keep() const {
  Kept kept;
  for (size_t level = 0; level < levels_.size(); ++level)
    kept[name_of_level(level)] = {IrradianceLevel::kColumns, levels_[level].rows(passes_)};
  return kept;
}

void IrradianceRecords::take_over(const Kept& kept) {
  taken_over_.assign(kMostLevels, {});
  for (const auto& [name, table] : kept) {
    size_t level = 0;
    while (level < kMostLevels && name != name_of_level(level)) ++level;
    require(level < kMostLevels && table.columns == IrradianceLevel::kColumns, "'" + name + "' is no table of irradiance records");
    IrradianceLevel::check(table.numbers, name);
    taken_over_[level] = table.numbers;
  }
}

void IrradianceRecords::continue_from(IrradianceRecords& earlier) {
  levels_ = std::move(earlier.levels_);
  taken_over_ = std::move(earlier.taken_over_);
  gathered_ = earlier.gathered_, refined_ = earlier.refined_;
  earlier.levels_.clear(), earlier.taken_over_.clear();
  for (IrradianceLevel& level : levels_) level.begin_anew();
}

size_t IrradianceRecords::size() const {
  size_t count = 0;
  for (const IrradianceLevel& level : levels_) count += level.size();
  return count;
}

void IrradianceRecords::before_pass(const RenderContext& context, const Film& film, int pass, const Follow& follow) {
  const Work work{context, film, follow};
  if (!is_open_)
    play_overture(work);
  else
    refine(work, pass);
  rays_before_ = context.scene.rays_traced();
}

void IrradianceRecords::after_pass(const RenderContext& context, int pass) {
  pass_rays_ += double(context.scene.rays_traced() - rays_before_);
  passes_ = pass + 1;
  const double rate = 1.0 - miss_rate();
  context.log.set("cache hit rate", rate);
  char text[64];
  std::snprintf(text, sizeof text, "%zu records, %.1f %% hits", size(), 100.0 * rate);
  context.log.note(text);
}

// ---------------------------------------------------------------- overture

void IrradianceRecords::play_overture(const Work& work) {
  const RenderContext& context = work.context;
  is_open_ = true;
  if (levels_.empty()) {
    for (int level = 0; level < std::max(level_count(), 1); ++level) {
      levels_.emplace_back(context.scene.bounds(), error_at(level), s_.spacing, s_.smoothing);
      if (!taken_over_.empty()) levels_.back().take_over(taken_over_[size_t(level)], context.steady);
    }
    for (const IrradianceLevel& level : levels_) gathered_ += uint32_t(level.gathers());  // rays of their own for those to come
    if (size() > 0) slack_ = kSlack;
  }
  taken_over_.clear();
  const size_t before = size();
  const uint32_t gathered_before = gathered_;
  // Deepest first: records of a level are made with the help of those below.
  for (int level = level_count() - 1; level >= 0 && !context.cancelled; --level) {
    const double seconds = context.seconds(), left = std::max(kOvertureShare * context.time_limit - seconds, 0.0);
    level_ends_ = seconds + (level > 0 ? kDeeperShare : 1.0) * left;
    const size_t taken = levels_[size_t(level)].size();  // evened out before they were kept
    fill_level(work, level);
    sharpen(work, level, taken);
    levels_[size_t(level)].freeze();
    levels_[size_t(level)].smooth(context.pool, context.cancelled, 0, taken);
  }
  const size_t records = size();
  size_t bytes = 0;
  for (const IrradianceLevel& level : levels_) bytes += level.cache().memory_bytes();
  context.log.stage("");
  context.log.say(std::to_string(records) + " records in the irradiance cache, " + std::to_string(levels_[0].size()) +
                  " of the first bounce, " + (before ? std::to_string(before) + " taken over, " : "") + std::to_string(bytes >> 20) +
                  " MiB");
  overture_seconds_ = context.seconds();
  context.log.set("cache overture seconds", overture_seconds_);
  context.log.set("cache records", double(records));
  context.log.set("cache records of the first bounce", double(levels_[0].size()));
  context.log.set("cache records taken over", double(before));
  context.log.set("cache records worked out", double(gathered_ - gathered_before));
  context.log.set("cache bytes", double(bytes));
}

// From coarse to fine over the picture; pixels of one step in an order without order, so that a wave's are far apart.
void IrradianceRecords::fill_level(const Work& work, int level) {
  for (int step = kCoarsest; step >= (level == 0 ? kFinest : kSeedStep) && !work.context.cancelled; step /= 2)
    fill_seen(work, level, step, 0);
}

// Places that passes came upon and no record holds at: thin things that the overture's one ray for a pixel went past. In so far as it is
// worth it: for `most_rays`, of those that refining will cost.
void IrradianceRecords::fill_gaps(const Work& work, int pass, double most_rays) {
  const RenderContext& context = work.context;
  const FilmSpec& spec = work.film.spec();
  const double pixels = double(spec.region_width()) * double(spec.region_height());
  const bool often = (pass & (pass - 1)) != 0;  // each finds most of what there is
  if (often || context.steady || miss_rate() < kFewMisses) return;
  if (miss_rate() * pixels * double(s_.samples) * kRaysOfSample > most_rays) return;
  const double seconds = context.seconds();
  level_ends_ = seconds + kGapsShare * std::max(context.time_limit - seconds, 0.0);
  for (int level = level_count() - 1; level >= 0 && !context.cancelled; --level) {
    const size_t before = levels_[size_t(level)].size();
    fill_seen(work, level, level == 0 ? kFinest : kSeedStep, pass);
    if (levels_[size_t(level)].size() == before) continue;
    sharpen(work, level, before);
    levels_[size_t(level)].freeze();
    levels_[size_t(level)].smooth(context.pool, context.cancelled, pass);
  }
}

// A round of camera rays, one for each `step` pixels of a row or column.
void IrradianceRecords::fill_seen(const Work& work, int level, int step, int round) {
  struct Pixel {
    int x, y, eye;
  };
  const RenderContext& context = work.context;
  const FilmSpec& spec = work.film.spec();
  std::vector<Pixel> pixels;
  for (int eye = -1; eye < int(context.path.size()); ++eye)
    for (int y = step / 2; y < spec.region_height(); y += step)
      for (int x = step / 2; x < spec.region_width(); x += step) pixels.push_back({spec.x0 + x, spec.y0 + y, eye});
  const auto key = [](const Pixel& p) { return hash_combine(uint32_t(p.x), uint32_t(p.y)); };
  std::sort(pixels.begin(), pixels.end(), [&](const Pixel& a, const Pixel& b) {
    const uint32_t ka = key(a), kb = key(b);
    return ka != kb ? ka < kb : std::tuple(a.y, a.x, a.eye) < std::tuple(b.y, b.x, b.eye);
  });
  constexpr int kBatch = 64;
  std::vector<std::vector<IrradiancePlace>> found((pixels.size() + kBatch - 1) / kBatch);
  context.pool.for_each(int(found.size()), context.cancelled, [&](int batch) {
    const size_t end = std::min(pixels.size(), size_t(batch + 1) * kBatch);
    for (size_t i = size_t(batch) * kBatch; i < end && !is_late(context); ++i) {
      const Pixel& p = pixels[i];
      seek(work, p.eye < 0 ? context.camera : context.path[size_t(p.eye)], p.x, p.y, level, round, found[size_t(batch)]);
    }
  });
  std::vector<IrradiancePlace> places;
  for (const auto& batch : found) places.insert(places.end(), batch.begin(), batch.end());
  fill(work, std::move(places), level);
}

// Diffuse surfaces of a level along one path through a pixel that the cache does not cover.
void IrradianceRecords::seek(const Work& work, const Camera& eye, int x, int y, int level, int round,
                             std::vector<IrradiancePlace>& places) const {
  const RenderContext& context = work.context;
  const FilmSpec& spec = work.film.spec();
  Sampler sampler(hash_combine(context.seed, kSeekSalt + uint32_t(level)), uint32_t(y) * uint32_t(spec.width) + uint32_t(x),
                  uint32_t(round));
  const Vec2 pixel{1.0f / float(spec.width), 1.0f / float(spec.height)};
  const Vec2 lens = sampler.next_2d(), within = round > 0 ? sampler.next_2d() : Vec2{0.5f, 0.5f};
  const CameraRay camera = eye.sample({(float(x) + within.x) * pixel.x, (float(y) + within.y) * pixel.y}, pixel, lens);
  Bsdf bsdf;
  CameraPath path(camera);
  PixelSample nowhere;
  for (uint32_t bounce = 0;; ++bounce) {
    sampler.jump_to(bounce + 1);
    const auto hit = context.scene.intersect(path.ray, visibility_of(path.state.kind));
    if (!hit) return;
    const ShadingPoint point = path.arrive(context, work.film, camera, *hit, bsdf, nowhere);
    const int here = level_of(path.state);
    if (here > level) return;
    if (here == level && point.strand == kNoId) {
      for (const uint8_t side : {kReflection, kTransmission}) {
        if (is_black(bsdf.diffuse_albedo(point.wo, side))) continue;
        const float sign = side == kReflection ? 1.0f : -1.0f;
        const float most = kCoarser * s_.spacing.max_pixels * 2.0f * point.footprint / error_at(level);
        const IrradiancePlace place{point.position, point.ng * sign, point.ns * sign, point.footprint, camera.spread, most};
        if (!levels_[size_t(level)].cache().covers(place.position, place.normal, most, slack_)) places.push_back(place);
      }
    }
    const float u_lobe = sampler.next_1d();
    const auto next = bsdf.sample(point.wo, sampler.next_2d(), u_lobe);
    if (!next || !(next->pdf_dir > 0.0f)) return;
    path.throughput *= next->value / next->pdf_dir;
    if (!advance(path.state, next->flags, s_.limits) || max_component(path.throughput) < 0.01f) return;
    if (next->flags & kTransparent) {
      path.pass(point, bsdf, *next, hit->t);
      continue;
    }
    path.travelled += hit->t, path.seen_from_camera = false;
    path.ray = ray_from(point, next->wi);
  }
}

// Wave by wave: look up together, work out together, insert one after the other.
void IrradianceRecords::fill(const Work& work, std::vector<IrradiancePlace> places, int level) {
  const RenderContext& context = work.context;
  IrradianceLevel& records = levels_[size_t(level)];
  const IrradianceCache& cache = records.cache();
  constexpr int kBatch = 1024;
  while (!context.cancelled) {
    std::vector<uint8_t> covered(places.size(), 0);
    context.pool.for_each(int((places.size() + kBatch - 1) / kBatch), context.cancelled, [&](int batch) {
      const size_t end = std::min(places.size(), size_t(batch + 1) * kBatch);
      for (size_t i = size_t(batch) * kBatch; i < end; ++i) covered[i] = cache.covers(places[i].position, places[i].normal, places[i].most);
    });
    std::vector<IrradiancePlace> left;
    for (size_t i = 0; i < places.size(); ++i)
      if (!covered[i]) left.push_back(places[i]);
    places = std::move(left);
    if (places.empty() || is_late(context)) return;

    context.log.stage("irradiance cache, bounce " + std::to_string(level + 1) + ", " + std::to_string(cache.records().size()) + " records");
    const size_t count = std::min(places.size(), std::max(kLeastWave, cache.records().size() / kWaveShare));
    std::vector<std::optional<GatheredIrradiance>> made(count);
    context.pool.for_each(int(count), context.cancelled, [&](int i) {
      if (!is_late(context)) made[size_t(i)] = gather(work, places[size_t(i)], level, gathered_ + uint32_t(i));
    });
    if (context.cancelled) return;  // those under way have lost rays
    gathered_ += uint32_t(count);
    for (size_t i = 0; i < count; ++i)
      if (made[i] && !cache.covers(places[i].position, places[i].normal, places[i].most)) records.insert(places[i], *made[i]);
    places.erase(places.begin(), places.begin() + std::ptrdiff_t(count));
  }
}

// Rays that refining has still to spend, were there `passes` in all.
double IrradianceRecords::rays_to_refine(int pass, double passes) const {
  return s_.refinement / std::max(1.0 - s_.refinement, 0.01) * pass_rays_ / pass * passes - refining_rays_;
}

// Passes that the picture will have, as far as that is known.
double IrradianceRecords::passes_to_expect(const RenderContext& context, int pass) const {
  double passes = context.passes > 0 ? context.passes : kInf;
  if (context.time_limit > 0.0) {
    const double each = (context.seconds() - overture_seconds_) / pass;
    const double in_time = (context.time_limit - overture_seconds_) / std::max(each, 1e-6) * (1.0 - s_.refinement);
    passes = std::min(passes, std::max<double>(pass, in_time));
  }
  return passes < double(kInf) ? passes : pass;
}

// More rays for the records, as many in all as the passes are worth: a record's value is the mean of its gathers, and the picture's the
// mean over passes, so that blotches fade as noise does.
void IrradianceRecords::refine(const Work& work, int pass) {
  const RenderContext& context = work.context;
  struct Chosen {
    int level;
    size_t record;
  };
  const uint64_t start = context.scene.rays_traced();
  // Passes to come pay in advance: the picture is the mean of what all of them see.
  const double to_expect = passes_to_expect(context, pass), wanted = rays_to_refine(pass, std::min<double>(kAhead * pass, to_expect));
  fill_gaps(work, pass, 0.5 * rays_to_refine(pass, to_expect));
  const size_t all = size();
  if (wanted > 0.0)
    for (IrradianceLevel& level : levels_) level.learn(context.pool);
  const auto spent = [&] { return double(context.scene.rays_traced() - start); };
  for (size_t idle = 0; idle < all && spent() < wanted;) {
    std::vector<Chosen> chosen;
    for (; chosen.size() < kRefined && idle < all; ++idle) {
      // Deepest first, as in the overture.
      size_t record = refined_++ % all;
      int level = int(levels_.size()) - 1;
      while (record >= levels_[size_t(level)].size()) record -= levels_[size_t(level--)].size();
      if (!levels_[size_t(level)].is_fixed(record)) chosen.push_back({level, record});
    }
    if (chosen.empty()) break;
    idle = 0;
    std::vector<GatheredIrradiance> made(chosen.size());
    context.pool.for_each(int(chosen.size()), context.cancelled, [&](int i) {
      const Chosen& c = chosen[size_t(i)];
      made[size_t(i)] = gather_guided_by_others(work, c.level, c.record, gathered_ + uint32_t(i));
    });
    if (context.cancelled) return;
    gathered_ += uint32_t(chosen.size());
    for (size_t i = 0; i < chosen.size(); ++i)
      levels_[size_t(chosen[i].level)].improve(chosen[i].record, made[i], worth_at(chosen[i].level));
  }
  for (IrradianceLevel& level : levels_)
    if (level.is_worth_smoothing()) level.smooth(context.pool, context.cancelled, pass);
  refining_rays_ += spent();
}

GatheredRay IrradianceRecords::follow(const Work& work, const IrradiancePlace& place, int level, Vec3 direction, Sampler& sampler) const {
  if (dot(direction, place.ng) <= 0.0f || work.context.cancelled) return {};
  const CameraRay from{{offset_point(place.position, place.ng, direction), direction}, place.spread, place.footprint};
  PathState path;
  path.depth = path.diffuse_depth = int16_t(level);
  advance(path, kReflection | kDiffuse, s_.limits);
  GatheredRay seen = work.follow(from, path, sampler);
  if (!is_finite(seen.radiance)) seen.radiance = Rgb();
  return seen;
}

GatheredIrradiance IrradianceRecords::gather(const Work& work, const IrradiancePlace& place, int level, uint32_t serial) const {
  const uint32_t seed = hash_combine(work.context.seed, kGatherSalt);
  return gather_irradiance(
      place.position, place.normal, first_samples_at(level), [&](int i) { return Sampler(seed, serial, uint32_t(i)).next_2d(); },
      [&](int i, Vec3 direction) {
        Sampler sampler(seed, serial, uint32_t(i));
        return follow(work, place, level, direction, sampler);
      });
}

GatheredIrradiance IrradianceRecords::gather_guided_by_others(const Work& work, int level, size_t record, uint32_t serial) const {
  const uint32_t seed = hash_combine(work.context.seed, kGatherSalt);
  const IrradiancePlace& place = levels_[size_t(level)].place(record);
  std::vector<Sampler> samplers;
  for (int i = 0; i < guided_samples_at(level); ++i) samplers.emplace_back(seed, serial, uint32_t(i));
  return gather_guided(
      place.normal, guided_samples_at(level), levels_[size_t(level)].guide(record),
      [&](int i) {
        const Vec2 within = samplers[size_t(i)].next_2d();
        return Vec3{within.x, within.y, samplers[size_t(i)].next_2d().x};
      },
      [&](int i, Vec3 direction) { return follow(work, place, level, direction, samplers[size_t(i)]); });
}

// A round of guided rays for all records of a level from `first` on.
void IrradianceRecords::sharpen(const Work& work, int level, size_t first) {
  const RenderContext& context = work.context;
  IrradianceLevel& records = levels_[size_t(level)];
  records.learn(context.pool);
  for (size_t begin = first; begin < records.size() && !context.cancelled && !is_late(context); begin += kRefined) {
    std::vector<GatheredIrradiance> made(std::min(kRefined, records.size() - begin));
    context.pool.for_each(int(made.size()), context.cancelled, [&](int i) {
      made[size_t(i)] = gather_guided_by_others(work, level, begin + size_t(i), gathered_ + uint32_t(i));
    });
    if (context.cancelled) return;
    gathered_ += uint32_t(made.size());
    for (size_t i = 0; i < made.size(); ++i) records.improve(begin + i, made[i], worth_at(level));
  }
}

}  // namespace gi
