// Irradiance caching [Ward 1988]: light from one diffuse surface to another is worked out at few places and interpolated between them
// [Ward & Heckbert 1992]. Everything else is path traced, and what paths meet behind mirrors and glass uses the cache too.
// An overture fills the cache from coarse to fine, in waves whose order no thread can change; the passes only read.
#include "core/check.h"
#include "core/tally.h"
#include "integrators/integrator.h"
#include "transport/camera_path.h"
#include "transport/irradiance_level.h"

namespace gi {
namespace {

constexpr LightSampling kMode = LightSampling::kMis;
constexpr int kMostLevels = 8;
constexpr int kCoarsest = 32, kFinest = 1;        // pixels between camera rays of the overture
constexpr int kSeedStep = 4;                      // the same for deeper levels
constexpr size_t kLeastWave = 64;                 // records
constexpr size_t kWaveShare = 8;                  // a wave is at most this part of what is there
constexpr double kOvertureShare = 0.5;  // of the time limit, at most
constexpr double kDeeperShare = 0.25;   // of what remains of that, for each level but the first
constexpr float kSlack = 1.3f;          // times the error that is let pass where records were taken over, or each frame would add some
constexpr float kCoarser = 2.0f;        // times the maximum spacing that a record of another frame may hold for
constexpr size_t kRefined = 256;         // records at a time
constexpr int kAhead = 4;                // times the passes made for which refining may have been paid
constexpr uint32_t kSeekSalt = 0x1c5eedu, kGatherSalt = 0x1c6a74u;  // streams of their own

struct CacheSettings {
  float error;
  int samples, levels;
  float refinement;
  IrradianceSpacing spacing;
  BounceLimits limits;
  float clamp_direct, clamp_indirect;
  uint8_t no_caustics;  // CausticFlags of what is left out
  float filter_glossy;
};

// A path under way. What it finds of luminaires and what of anything else may count differently: luminaires are sampled at every
// surface, also where all other light came from the cache.
struct Walk {
  CameraPath path;            // its throughput is for all but luminaires
  Rgb to_luminaires{1.0f};
  float first_distance = kInf;
};

class IrradianceCacheIntegrator final : public Integrator {
 public:
  explicit IrradianceCacheIntegrator(const Parameters& p)
      : s_{p.real("error"),
           p.integer("record_samples"),
           p.integer("cached_bounces"),
           p.real("refinement"),
           {p.real("min_spacing"), p.real("max_spacing"), p.real("min_length"), p.real("max_length")},
           {p.integer("max_bounces"), p.integer("diffuse_bounces"), p.integer("glossy_bounces"), p.integer("transmission_bounces"),
            p.integer("transparent_bounces")},
           p.real("clamp_direct"),
           p.real("clamp_indirect"),
           no_caustics(p),
           p.real("filter_glossy")} {}

  void render_pass(const RenderContext& context, int pass, Film& film) override {
    if (levels_.empty())
      play_overture(context, film);
    else
      refine(context, film, pass);
    if (context.cancelled) return;
    const uint64_t rays = context.scene.rays_traced();
    for_each_pixel(context, pass, film, [&](const CameraRay& camera, Sampler& sampler, PixelSample& result) {
      Walk walk{CameraPath(camera)};
      trace(context, film, camera, walk, sampler, result);
    });
    pass_rays_ += double(context.scene.rays_traced() - rays);
    passes_ = pass + 1;
  }

  void finish_pass(const RenderContext& context, int) override;

  void take_over(const Kept& kept) override;
  Kept keep() const override;

 private:
  void trace(const RenderContext& context, const Film& film, const CameraRay& camera, Walk& walk, Sampler& sampler,
             PixelSample& result) const;
  std::optional<Rgb> read(const ShadingPoint& point, const Bsdf& bsdf, int level, PixelSample& result) const;

  void play_overture(const RenderContext& context, Film& film);
  void fill_level(const RenderContext& context, const Film& film, int level);
  void seek(const RenderContext& context, const Film& film, const Camera& eye, int x, int y, int level,
            std::vector<IrradiancePlace>& places) const;
  void fill(const RenderContext& context, const Film& film, std::vector<IrradiancePlace> places, int level);
  void refine(const RenderContext& context, const Film& film, int pass);
  double rays_to_refine(const RenderContext& context, int pass) const;
  GatheredIrradiance gather(const RenderContext& context, const Film& film, const IrradiancePlace& place, int level, uint32_t serial) const;
  bool is_late(const RenderContext& context) const { return context.time_limit > 0.0 && context.seconds() > level_ends_; }
  size_t record_count() const;

  // Diffuse bounces that a path may still make, and how many of all it has made: its level.
  int most_bounces() const { return std::min(s_.limits.diffuse, s_.limits.total); }
  int level_of(const PathState& state) const {
    return most_bounces() - std::min(s_.limits.diffuse - state.diffuse_depth, s_.limits.total - state.depth);
  }
  int level_count() const { return std::min(s_.levels, most_bounces()); }
  // Deeper records are seen through shallower ones: they may be coarser.
  float error_at(int level) const { return level == 0 ? s_.error : std::min(2.0f * s_.error, 0.6f); }
  int samples_at(int level) const { return level == 0 ? s_.samples : std::max(s_.samples / 3, 32); }

  CacheSettings s_;
  std::vector<IrradianceLevel> levels_;
  mutable Tally hits_, misses_;       // of the first bounce, while the picture is made
  uint32_t gathered_ = 0;                // records, those included that were not needed in the end
  std::vector<std::vector<float>> taken_over_;  // rows, by level
  size_t refined_ = 0;                   // records, all levels' in turn
  double refining_rays_ = 0, pass_rays_ = 0;
  int passes_ = 0;
  float slack_ = 1.0f;
  double overture_seconds_ = 0;
  double level_ends_ = 0;                // seconds after which no more records are begun, where there is a time limit
};

// ---------------------------------------------------------------- paths

// What diffuse lobes scatter of light from other surfaces; nothing where the cache does not know it for all of them.
std::optional<Rgb> IrradianceCacheIntegrator::read(const ShadingPoint& point, const Bsdf& bsdf, int level, PixelSample& result) const {
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

void IrradianceCacheIntegrator::trace(const RenderContext& context, const Film& film, const CameraRay& camera, Walk& walk, Sampler& sampler,
                                      PixelSample& result) const {
  Bsdf bsdf;
  CameraPath& path = walk.path;
  bool may_scatter = true;
  float least_pdf = kInf;
  const auto add = [&](Rgb throughput, Rgb radiance, int depth) {
    if (is_black(radiance) || is_black(throughput)) return;
    result.radiance += clamp_contribution(throughput * radiance, depth > 1 ? s_.clamp_indirect : s_.clamp_direct);
  };

  for (uint32_t bounce = 0;; ++bounce) {
    sampler.jump_to(bounce + 1);
    const uint32_t visibility = visibility_of(path.state.kind);
    const int depth = path.state.depth;
    const auto hit = context.scene.intersect(path.ray, visibility);
    add(walk.to_luminaires, lamps_along(context, path.ray, hit ? hit->t : kInf, path.origin, kMode, visibility), depth);
    if (!hit) {
      if (!path.seen_from_camera && is_black(walk.to_luminaires)) break;
      add(walk.to_luminaires, path.leave(context, film, kMode, result), depth);
      break;
    }
    if (bounce == 0) walk.first_distance = hit->t;
    if (!may_scatter || is_black(path.throughput)) {
      if (is_black(walk.to_luminaires)) break;
      if (const auto emitted = path.end(context, camera, *hit, kMode)) {
        add(walk.to_luminaires, *emitted, depth);
        break;
      }
    }
    const ShadingPoint point = path.arrive(context, film, camera, *hit, bsdf, result);
    if (least_pdf < s_.filter_glossy) bsdf.blur(0.5f * std::sqrt(1.0f - least_pdf / s_.filter_glossy));

    const Rgb emitted = surface_emission(context, point, bsdf.emission, path.origin, kMode);
    if (depth == 0) result.emission += path.throughput * emitted;
    add(walk.to_luminaires, emitted, depth);

    // Luminaires are sampled here; other light of the diffuse lobes is looked up.
    const float u_light_choice = sampler.next_1d(), u_lobe = sampler.next_1d();
    const Vec2 u_light = sampler.next_2d(), u = sampler.next_2d();
    bool is_cached = false;
    if (may_scatter && !is_black(path.throughput)) {
      add(path.throughput, sample_direct_light(context, point, bsdf, kMode, u_light_choice, u_light), depth + 1);
      const int level = level_of(path.state);
      if ((bsdf.flags() & kDiffuse) && level < level_count()) {
        const auto radiance = read(point, bsdf, level, result);
        if (depth == 0) (radiance ? hits_ : misses_).add();
        if (radiance) result.radiance += path.throughput * *radiance;
        is_cached = bool(radiance);
      }
    }

    // Draw the next direction.
    const auto next = bsdf.sample(point.wo, u, u_lobe);
    if (!next || !(next->pdf_dir > 0.0f)) break;
    const bool transparent = next->flags & kTransparent;
    if (!may_scatter && !transparent) break;
    path.travelled += hit->t;
    if (transparent) {
      const Rgb weight = next->value / next->pdf_dir;
      path.throughput *= weight, walk.to_luminaires *= weight;
      if (!advance(path.state, next->flags, s_.limits)) break;
      path.ray = {offset_point(point.position, point.ng, path.ray.direction), path.ray.direction, 0.0f, path.ray.t_max - hit->t};
      path.origin.query.path = path.state;
      continue;
    }

    // Follow it: to luminaires by all lobes, to all else by those that are not in the cache.
    const bool delta = next->flags & kSpecular;
    Rgb rest = next->value;
    if (is_cached && !delta) rest = positive(rest - bsdf.eval(point.wo, next->wi, kReflection | kTransmission | kDiffuse).value);
    walk.to_luminaires = path.throughput * next->value / next->pdf_dir;
    path.throughput *= rest / next->pdf_dir;
    if (is_black(walk.to_luminaires)) break;
    may_scatter = advance(path.state, next->flags, s_.limits);
    const FilmSpec& spec = film.spec();
    if (!(spec.transparent_glass && (next->flags & kTransmission) && next->roughness <= spec.transparent_roughness))
      path.seen_from_camera = false;
    path.state.without = next->flags & kDiffuse ? s_.no_caustics : 0;
    path.origin = {light_query(point, bsdf), delta ? kInf : next->pdf_dir};
    if (!delta) least_pdf = std::min(least_pdf, next->pdf_dir);
    path.ray = {offset_point(point.position, point.ng, next->wi), next->wi, 0.0f, kInf};

    // Russian roulette for all but luminaires, which the next ray meets anyway.
    const float alpha = std::min(1.0f, std::sqrt(max_component(path.throughput)));
    if (alpha < 1.0f) path.throughput = sampler.next_1d() < alpha ? path.throughput / alpha : Rgb();
  }
}

// ---------------------------------------------------------------- what is kept

std::string name_of_level(size_t level) { return "bounce " + std::to_string(level + 1); }

Kept IrradianceCacheIntegrator::keep() const {
  Kept kept;
  for (size_t level = 0; level < levels_.size(); ++level)
    kept[name_of_level(level)] = {IrradianceLevel::kColumns, levels_[level].rows(passes_)};
  return kept;
}

void IrradianceCacheIntegrator::take_over(const Kept& kept) {
  taken_over_.assign(kMostLevels, {});
  for (const auto& [name, table] : kept) {
    size_t level = 0;
    while (level < kMostLevels && name != name_of_level(level)) ++level;
    require(level < kMostLevels && table.columns == IrradianceLevel::kColumns, "'" + name + "' is no table of irradiance records");
    IrradianceLevel::check(table.numbers, name);
    taken_over_[level] = table.numbers;
  }
}

size_t IrradianceCacheIntegrator::record_count() const {
  size_t count = 0;
  for (const IrradianceLevel& level : levels_) count += level.size();
  return count;
}

void IrradianceCacheIntegrator::finish_pass(const RenderContext& context, int) {
  const double hits = double(hits_.total()), all = hits + double(misses_.total());
  const double rate = all > 0.0 ? hits / all : 1.0;
  context.log.set("cache hit rate", rate);
  char text[64];
  std::snprintf(text, sizeof text, "%zu records, %.1f %% hits", record_count(), 100.0 * rate);
  context.log.note(text);
}

// ---------------------------------------------------------------- overture

void IrradianceCacheIntegrator::play_overture(const RenderContext& context, Film& film) {
  for (int level = 0; level < std::max(level_count(), 1); ++level) {
    levels_.emplace_back(context.scene.bounds(), error_at(level), s_.spacing);
    if (!taken_over_.empty()) levels_.back().take_over(taken_over_[size_t(level)], context.steady);
  }
  taken_over_.clear();
  const size_t before = record_count();
  for (const IrradianceLevel& level : levels_) gathered_ += uint32_t(level.gathers());  // rays of their own for those to come
  const uint32_t gathered_before = gathered_;
  if (before > 0) slack_ = kSlack;
  // Deepest first: records of a level are made with the help of those below.
  for (int level = level_count() - 1; level >= 0 && !context.cancelled; --level) {
    const double seconds = context.seconds(), left = std::max(kOvertureShare * context.time_limit - seconds, 0.0);
    level_ends_ = seconds + (level > 0 ? kDeeperShare : 1.0) * left;
    fill_level(context, film, level);
    levels_[size_t(level)].freeze();
  }
  const size_t records = record_count();
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
void IrradianceCacheIntegrator::fill_level(const RenderContext& context, const Film& film, int level) {
  struct Pixel {
    int x, y, eye;
  };
  const FilmSpec& spec = film.spec();
  for (int step = kCoarsest; step >= (level == 0 ? kFinest : kSeedStep) && !context.cancelled; step /= 2) {
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
        seek(context, film, p.eye < 0 ? context.camera : context.path[size_t(p.eye)], p.x, p.y, level, found[size_t(batch)]);
      }
    });
    std::vector<IrradiancePlace> places;
    for (const auto& batch : found) places.insert(places.end(), batch.begin(), batch.end());
    fill(context, film, std::move(places), level);
  }
}

// Diffuse surfaces of a level along one path through a pixel that the cache does not cover.
void IrradianceCacheIntegrator::seek(const RenderContext& context, const Film& film, const Camera& eye, int x, int y, int level,
                                     std::vector<IrradiancePlace>& places) const {
  const FilmSpec& spec = film.spec();
  Sampler sampler(hash_combine(context.seed, kSeekSalt + uint32_t(level)), uint32_t(y) * uint32_t(spec.width) + uint32_t(x), 0);
  const Vec2 pixel{1.0f / float(spec.width), 1.0f / float(spec.height)};
  const CameraRay camera = eye.sample({(float(x) + 0.5f) * pixel.x, (float(y) + 0.5f) * pixel.y}, pixel, sampler.next_2d());
  Bsdf bsdf;
  CameraPath path(camera);
  PixelSample nowhere;
  for (uint32_t bounce = 0;; ++bounce) {
    sampler.jump_to(bounce + 1);
    const auto hit = context.scene.intersect(path.ray, visibility_of(path.state.kind));
    if (!hit) return;
    const ShadingPoint point = path.arrive(context, film, camera, *hit, bsdf, nowhere);
    const int here = level_of(path.state);
    if (here > level) return;
    if (here == level) {
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
    path.travelled += hit->t;
    if (!advance(path.state, next->flags, s_.limits) || max_component(path.throughput) < 0.01f) return;
    if (!(next->flags & kTransparent)) path.seen_from_camera = false;
    path.ray = {offset_point(point.position, point.ng, next->wi), next->wi, 0.0f, kInf};
  }
}

// Wave by wave: look up together, work out together, insert one after the other.
void IrradianceCacheIntegrator::fill(const RenderContext& context, const Film& film, std::vector<IrradiancePlace> places, int level) {
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
      if (!is_late(context)) made[size_t(i)] = gather(context, film, places[size_t(i)], level, gathered_ + uint32_t(i));
    });
    if (context.cancelled) return;  // those under way have lost rays
    gathered_ += uint32_t(count);
    for (size_t i = 0; i < count; ++i)
      if (made[i] && !cache.covers(places[i].position, places[i].normal, places[i].most)) records.insert(places[i], *made[i]);
    places.erase(places.begin(), places.begin() + std::ptrdiff_t(count));
  }
}

// Rays that refining has still to spend before a pass. Where it is known how many passes there will be, those to come pay in advance: the
// picture is the mean of what all passes see.
double IrradianceCacheIntegrator::rays_to_refine(const RenderContext& context, int pass) const {
  double passes = pass;
  const double share = s_.refinement / std::max(1.0 - s_.refinement, 0.01);
  if (context.passes > 0) passes = std::min<double>(kAhead * pass, context.passes);
  if (context.time_limit > 0.0) {
    const double seconds = context.seconds(), each = (seconds - overture_seconds_) / pass;
    passes = std::min<double>(
        passes, std::max<double>(pass, (context.time_limit - overture_seconds_) / std::max(each, 1e-6) * (1.0 - s_.refinement)));
  }
  return share * pass_rays_ / pass * passes - refining_rays_;
}

// More rays for the records, as many in all as the passes are worth: a record's value is the mean of its gathers, and the picture's the
// mean over passes, so that blotches fade as noise does.
void IrradianceCacheIntegrator::refine(const RenderContext& context, const Film& film, int pass) {
  struct Chosen {
    int level;
    size_t record;
  };
  const uint64_t start = context.scene.rays_traced();
  const double wanted = rays_to_refine(context, pass);
  const size_t all = record_count();
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
    if (chosen.empty()) return;
    idle = 0;
    std::vector<GatheredIrradiance> made(chosen.size());
    context.pool.for_each(int(chosen.size()), context.cancelled, [&](int i) {
      const Chosen& c = chosen[size_t(i)];
      made[size_t(i)] = gather(context, film, levels_[size_t(c.level)].place(c.record), c.level, gathered_ + uint32_t(i));
    });
    if (context.cancelled) return;
    gathered_ += uint32_t(chosen.size());
    for (size_t i = 0; i < chosen.size(); ++i) levels_[size_t(chosen[i].level)].improve(chosen[i].record, made[i], pass);
  }
  refining_rays_ += spent();
}

GatheredIrradiance IrradianceCacheIntegrator::gather(const RenderContext& context, const Film& film, const IrradiancePlace& place,
                                                     int level, uint32_t serial) const {
  const uint32_t seed = hash_combine(context.seed, kGatherSalt);
  return gather_irradiance(
      place.position, place.normal, samples_at(level), [&](int i) { return Sampler(seed, serial, uint32_t(i)).next_2d(); },
      [&](int i, Vec3 direction) -> GatheredRay {
        if (dot(direction, place.ng) <= 0.0f || context.cancelled) return {};
        const CameraRay from{{offset_point(place.position, place.ng, direction), direction}, place.spread, place.footprint};
        Walk walk{CameraPath(from), Rgb()};  // luminaires are sampled where the record is used
        PathState& state = walk.path.state;
        state.depth = state.diffuse_depth = int16_t(level);
        advance(state, kReflection | kDiffuse, s_.limits);
        state.without = s_.no_caustics;
        walk.path.seen_from_camera = false;
        Sampler sampler(seed, serial, uint32_t(i));
        PixelSample found;
        trace(context, film, from, walk, sampler, found);
        return {is_finite(found.radiance) ? found.radiance : Rgb(), walk.first_distance};
      });
}

}  // namespace

const Descriptor& irradiance_cache_descriptor() {
  using Kind = Parameter::Kind;
  static const Descriptor descriptor{
      "irradiance_cache",
      "Irradiance Caching",
      "Light between diffuse surfaces is worked out at few places and interpolated: smooth interiors soon. Biased by the error allowed; "
      "rough diffuse surfaces are read as if light came to them evenly",
      {
          {"error", "Error", Kind::kFloat, 0.15, 0.01, 1, "Allowed between records: the smaller, the more of them"},
          {"record_samples", "Samples", Kind::kInt, 128, 16, 1 << 20,
           "Rays over the hemisphere of each record, to begin with and each time that it is refined"},
          {"refinement", "Refinement", Kind::kFloat, 0.25, 0, 0.95,
           "Share of the passes' time in which records get more rays: blotches fade as noise does. 0 leaves them as they were first"},
          {"cached_bounces", "Cached Bounces", Kind::kInt, 4, 1, kMostLevels,
           "Diffuse bounces that have records; further ones are path traced"},
          {"min_spacing", "Minimum Spacing", Kind::kFloat, 1.5, 0, 1e4, "Pixels for which a record holds at least"},
          {"max_spacing", "Maximum Spacing", Kind::kFloat, 40, 1, 1e6, "Pixels for which a record holds at most"},
          {"min_length", "Minimum Distance", Kind::kFloat, 0, 0, 1e6, "The same as a length", "LENGTH"},
          {"max_length", "Maximum Distance", Kind::kFloat, 0, 0, 1e6, "The same as a length; 0 is off", "LENGTH"},
          {"max_bounces", "Total", Kind::kInt, 12, 0, 1024, "Bounces of any kind"},
          {"diffuse_bounces", "Diffuse", Kind::kInt, 4, 0, 1024, "Diffuse reflections"},
          {"glossy_bounces", "Glossy", Kind::kInt, 4, 0, 1024, "Glossy and mirror reflections"},
          {"transmission_bounces", "Transmission", Kind::kInt, 12, 0, 1024, "Refractions"},
          {"transparent_bounces", "Transparent", Kind::kInt, 8, 0, 1024, "Transparent surfaces passed by one ray"},
          {"clamp_direct", "Clamp Direct", Kind::kFloat, 0, 0, 1e9,
           "Largest radiance that one sample may add directly; 0 is off. Loses light"},
          {"clamp_indirect", "Clamp Indirect", Kind::kFloat, 0, 0, 1e9,
           "Largest radiance that one sample may add after a bounce; 0 is off. Loses light"},
          {"caustics_reflective", "Reflective Caustics", Kind::kBool, 1, 0, 1, "Mirrors and glossy surfaces seen by diffuse ones"},
          {"caustics_refractive", "Refractive Caustics", Kind::kBool, 1, 0, 1, "Glass seen by diffuse surfaces"},
          {"filter_glossy", "Filter Glossy", Kind::kFloat, 0, 0, 100,
           "Makes glossy surfaces rougher where unlikely paths see them: less noise, blurred caustics. 0 is off"},
      },
      [](const Parameters& p) -> std::unique_ptr<Integrator> { return std::make_unique<IrradianceCacheIntegrator>(p); },
      /*bakes=*/false,
      /*kept_version=*/2,
      /*kept_by_place=*/true};
  return descriptor;
}

}  // namespace gi
