// IrradianceLevel: how far records hold, and how they grow.
#include "transport/irradiance_level.h"

#include "core/check.h"

namespace gi {
namespace {

constexpr float kLeastReach = 0.5f;  // pixels
constexpr int kBatch = 256;
constexpr size_t kGuides = 16;    // records whose rays guide those of one
constexpr float kTurned = 0.7f;   // cosine between their normals

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
  gathered_.push_back({record, gathered.variance, gathered.around, gathered.wall});
  sightings_.insert(sightings_.end(), gathered.seen.begin(), gathered.seen.end());
  sighted_.push_back(sightings_.size());
}

void IrradianceLevel::improve(size_t index, const GatheredIrradiance& guided, float worth) {
  auto& [light, variance, around, wall] = gathered_[index];
  growth_[index].gathers += worth;
  const float share = worth / growth_[index].gathers;
  const IrradianceRecord& more = guided.record;
  light.irradiance += (more.irradiance - light.irradiance) * share;
  for (int axis = 0; axis < 3; ++axis) light.lateral[axis] += (more.lateral[axis] - light.lateral[axis]) * share;
  variance = variance * sqr(1.0f - share) + guided.variance * sqr(share);
  improved_ += worth;
}

void IrradianceLevel::learn(ThreadPool& pool) {
  if (tree_.size() == size()) return;
  tree_ = PointTree(cache_.records(), [](const IrradianceRecord& r) { return r.position; }, pool);
}

IrradianceGuide IrradianceLevel::guide(size_t record) const {
  const IrradianceRecord& own = cache_.records()[record];
  const Frame frame = Frame::from_normal(own.normal);
  IrradianceGuide guide;
  std::vector<PointTree::Found> near;
  tree_.nearest(own.position, kGuides, kInf, near,
                [&](uint32_t k) { return dot(cache_.records()[tree_.order()[k]].normal, own.normal) > kTurned; });
  // In an order of its own: sums must not depend on that of the search.
  std::vector<uint32_t> guides;
  for (const PointTree::Found& f : near) guides.push_back(tree_.order()[f.point]);
  std::sort(guides.begin(), guides.end());
  for (const uint32_t other : guides) {
    const IrradianceRecord& r = cache_.records()[other];
    const Frame theirs = Frame::from_normal(r.normal);
    const Vec3 x = frame.to_local(theirs.x), y = frame.to_local(theirs.y), z = frame.to_local(theirs.z);
    const Vec3 apart = frame.to_local(r.position - own.position);
    for (size_t i = sighted_[other]; i < sighted_[other + 1]; ++i) {
      const Sighting& s = sightings_[i];
      const Vec3 way = s.local(), there = way.x * x + way.y * y + way.z * z;
      const Vec3 local = std::isfinite(s.distance()) ? normalize(there * s.distance() + apart) : there;
      if (local.z > 0.0f) guide.add(local, s.luminance());
    }
  }
  guide.settle();
  return guide;
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
    gathered_.push_back({r, more[6], {}, more[7]});
    sighted_.push_back(sightings_.size());
  }
}

}  // namespace gi
