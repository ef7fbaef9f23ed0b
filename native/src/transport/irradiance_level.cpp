// IrradianceLevel: how far records hold, and how they grow.
#include "transport/irradiance_level.h"

#include "core/check.h"

namespace gi {
namespace {

constexpr float kLeastReach = 0.5f;  // pixels
constexpr int kBatch = 256;

// Calls f(a's, b's) for each colour that gathering finds.
template <class F>
void for_each_colour(IrradianceRecord& a, const IrradianceRecord& b, const F& f) {
  f(a.irradiance, b.irradiance);
  for (int axis = 0; axis < 3; ++axis) f(a.translation[axis], b.translation[axis]), f(a.lateral[axis], b.lateral[axis]);
}

// Metres within which the gradient says something: the mean distance of what is seen, and where it would lead to darkness.
float gradient_radius(const IrradianceRecord& r) {
  const float slope = std::sqrt(sqr(luminance(r.translation[0])) + sqr(luminance(r.translation[1])) + sqr(luminance(r.translation[2])));
  return slope > 0.0f ? std::min(r.radius, luminance(r.irradiance) / slope) : r.radius;
}

// Where a record has to hold for longer than its gradient does, that must not run away. [Ward & Heckbert 1992]
void temper(IrradianceRecord& record, float radius) {
  const float most = gradient_radius(record);
  if (radius > most)
    for (Rgb& axis : record.translation) axis *= most / radius;
}

}  // namespace

// Not beyond what it sees nearest, whatever the least spacing, nor beyond where its gradient ends.
IrradianceRecord IrradianceLevel::settled(const IrradiancePlace& place, const GatheredIrradiance& gathered) const {
  IrradianceRecord r = gathered.record;
  const float error = cache_.error(), pixel = 2.0f * place.footprint;
  r.reach = std::max(gathered.nearest, kLeastReach * pixel);
  r.least = std::max({spacing_.min_pixels * pixel, spacing_.min_length, 1e-6f}) / error;
  const float most = std::min(spacing_.max_pixels * pixel, spacing_.max_length > 0.0f ? spacing_.max_length : kInf) / error;
  const float radius = std::max(r.least, std::min(gradient_radius(r), most));
  temper(r, radius);
  r.radius = radius;
  return r;
}

void IrradianceLevel::insert(const IrradiancePlace& place, const GatheredIrradiance& gathered) {
  const IrradianceRecord record = settled(place, gathered);
  cache_.insert(record);
  growth_.push_back({place});
  gathered_.push_back({record, gathered.variance, gathered.wall});
}

void IrradianceLevel::improve(size_t index, const GatheredIrradiance& gathered) {
  IrradianceRecord more = gathered.record;
  temper(more, cache_.records()[index].radius);
  auto& [light, variance, wall] = gathered_[index];
  const float share = 1.0f / ++growth_[index].gathers;
  for_each_colour(light, more, [&](Rgb& mean, Rgb value) { mean += (value - mean) * share; });
  variance = variance * sqr(1.0f - share) + gathered.variance * sqr(share);
  ++improved_;
}

void IrradianceLevel::smooth(ThreadPool& pool, const std::atomic<bool>& cancelled, int pass, size_t first) {
  if (first >= size()) return;
  if (!smoothing_.serves(size(), first)) smoothing_ = IrradianceSmoothing(cache_, gathered_, first, pool, cancelled);
  if (cancelled) return;
  pool.for_each(int((size() + kBatch - 1) / kBatch), cancelled, [&](int batch) {
    for (size_t i = std::max(first, size_t(batch) * kBatch); i < std::min(size(), size_t(batch + 1) * kBatch); ++i) {
      Growth& g = growth_[i];
      if (g.fixed) continue;
      IrradianceRecord record = cache_.records()[i];
      for_each_colour(g.seen, record, [&](Rgb& sum, Rgb value) { sum += value * float(pass - g.changed); });
      g.changed = pass;
      for_each_colour(record, smoothing_.smooth(gathered_, uint32_t(i), strength_), [](Rgb& light, Rgb value) { light = value; });
      cache_.set_light(i, record);
    }
  });
  improved_ = 0;
}

double IrradianceLevel::gathers() const {
  double count = 0;
  for (const Growth& g : growth_) count += g.gathers;
  return count;
}

std::vector<float> IrradianceLevel::rows(int passes) const {
  std::vector<float> rows(size() * kColumns);
  for (size_t i = 0; i < size(); ++i) {
    const Growth& g = growth_[i];
    IrradianceRecord record = cache_.records()[i];
    if (g.changed > 0 && passes > 0) {
      const float now = float(std::max(passes - g.changed, 0));
      for_each_colour(record, g.seen, [&](Rgb& mean, Rgb sum) { mean = (mean * now + sum) / (float(g.changed) + now); });
    }
    float* row = &rows[i * kColumns];
    record.write(row);
    row += IrradianceRecord::kNumbers;
    for (int k = 0; k < 3; ++k) row[k] = g.place.ng[k];
    row[3] = g.place.footprint, row[4] = g.place.spread, row[5] = g.gathers, row[6] = gathered_[i].variance, row[7] = gathered_[i].wall;
  }
  return rows;
}

void IrradianceLevel::check(const std::vector<float>& rows, const std::string& name) {
  for (size_t begin = 0; begin < rows.size(); begin += kColumns) {
    const IrradianceRecord r = IrradianceRecord::read(&rows[begin]);
    const float* more = &rows[begin + IrradianceRecord::kNumbers];
    bool good = r.radius > 0.0f && r.least >= 0.0f && r.reach > 0.0f && std::isfinite(r.radius) && is_finite(r.irradiance) &&
                std::isfinite(length_squared(r.position)) && std::abs(length_squared(r.normal) - 1.0f) < 1e-3f && more[5] >= 1.0f &&
                more[6] >= 0.0f && more[7] >= 0.0f;
    for (int axis = 0; axis < 3; ++axis) good = good && is_finite(r.translation[axis]) && is_finite(r.lateral[axis]);
    for (int k = 0; k < 7; ++k) good = good && std::isfinite(more[k]);
    require(good, "'" + name + "', row " + std::to_string(begin / kColumns) + ": no irradiance record");
  }
}

void IrradianceLevel::begin_anew() {
  smoothing_ = {};  // it may have been stopped before it knew all neighbours
  for (Growth& g : growth_) g.changed = 0, g.seen = {};
}

void IrradianceLevel::take_over(const std::vector<float>& rows, bool fixed) {
  for (size_t begin = 0; begin < rows.size(); begin += kColumns) {
    const IrradianceRecord r = IrradianceRecord::read(&rows[begin]);
    const float* more = &rows[begin + IrradianceRecord::kNumbers];
    cache_.insert(r);
    growth_.push_back({{r.position, {more[0], more[1], more[2]}, r.normal, more[3], more[4]}, more[5], fixed});
    gathered_.push_back({r, more[6], more[7]});
  }
}

}  // namespace gi
