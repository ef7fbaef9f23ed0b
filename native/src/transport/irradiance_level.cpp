// IrradianceLevel: how far records hold, and how they grow.
#include "transport/irradiance_level.h"

#include "core/check.h"

namespace gi {
namespace {

constexpr float kLeastReach = 0.5f;  // pixels

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
  cache_.insert(settled(place, gathered));
  growth_.push_back({place});
}

void IrradianceLevel::improve(size_t index, const GatheredIrradiance& gathered, int pass) {
  Growth& g = growth_[index];
  IrradianceRecord record = cache_.records()[index], more = gathered.record;
  const float passes = float(pass - g.changed);
  for_each_colour(g.seen, record, [&](Rgb& sum, Rgb value) { sum += value * passes; });
  g.changed = pass;
  temper(more, record.radius);
  const float share = 1.0f / ++g.gathers;
  for_each_colour(record, more, [&](Rgb& mean, Rgb value) { mean += (value - mean) * share; });
  cache_.set_light(index, record);
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
    row[3] = g.place.footprint, row[4] = g.place.spread, row[5] = g.gathers;
  }
  return rows;
}

void IrradianceLevel::check(const std::vector<float>& rows, const std::string& name) {
  for (size_t begin = 0; begin < rows.size(); begin += kColumns) {
    const IrradianceRecord r = IrradianceRecord::read(&rows[begin]);
    const float* more = &rows[begin + IrradianceRecord::kNumbers];
    bool good = r.radius > 0.0f && r.least >= 0.0f && r.reach > 0.0f && std::isfinite(r.radius) && is_finite(r.irradiance) &&
                std::isfinite(length_squared(r.position)) && std::abs(length_squared(r.normal) - 1.0f) < 1e-3f && more[5] >= 1.0f;
    for (int axis = 0; axis < 3; ++axis) good = good && is_finite(r.translation[axis]) && is_finite(r.lateral[axis]);
    for (int k = 0; k < 6; ++k) good = good && std::isfinite(more[k]);
    require(good, "'" + name + "', row " + std::to_string(begin / kColumns) + ": no irradiance record");
  }
}

void IrradianceLevel::take_over(const std::vector<float>& rows, bool fixed) {
  for (size_t begin = 0; begin < rows.size(); begin += kColumns) {
    const IrradianceRecord r = IrradianceRecord::read(&rows[begin]);
    const float* more = &rows[begin + IrradianceRecord::kNumbers];
    cache_.insert(r);
    growth_.push_back({{r.position, {more[0], more[1], more[2]}, r.normal, more[3], more[4]}, more[5], fixed});
  }
}

}  // namespace gi
