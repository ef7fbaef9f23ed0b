// IrradianceSmoothing: neighbours, and how many of them to take.
#include "transport/irradiance_smoothing.h"

#include <span>

#include "core/point_tree.h"

namespace gi {
namespace {

constexpr size_t kSteps[] = {1, 2, 4, 8, 16, 36};  // records of the means that are tried
constexpr size_t kJudges = 12;               // records whose mean variance is taken for that of each
constexpr float kAlone = 2.0f;               // times as far off a record alone may be: its noise has a long tail
constexpr float kSameSide = 0.9f;            // cosine between normals
constexpr float kOfWall = 1.0f / 3.0f;       // of the distance to walls: how far records may lie apart
constexpr float kAlike = 1.5f;               // between distances that may well be the same: few rays know them
constexpr float kFar = 12.0f;                // times as far as a record holds: farther ones are no neighbours
constexpr float kFlat = 0.15f;               // of the distance: how far from the tangent plane
constexpr int kBatch = 256;

// Whether nothing that either sees comes nearer or goes away between them, as along a wall: in every eighth of a turn things are either
// far off or as far from one as from the other.
bool are_alike(const Around& a, const Around& b, float distance) {
  for (size_t k = 0; k < a.size(); ++k) {
    const float nearer = std::min(a[k], b[k]), farther = std::max(a[k], b[k]);
    if (distance > kOfWall * nearer && !(farther <= kAlike * nearer)) return false;
  }
  return true;
}

bool are_of_one_surface(const IrradianceRecord& a, const IrradianceRecord& b, float reach) {
  const Vec3 d = b.position - a.position;
  const float distance = length(d);
  return distance <= reach && dot(a.normal, b.normal) > kSameSide &&
         std::abs(dot(d, a.normal)) + std::abs(dot(d, b.normal)) <= 2.0f * kFlat * distance;
}

}  // namespace

IrradianceSmoothing::IrradianceSmoothing(const IrradianceCache& cache, const std::vector<Gathered>& gathered, size_t first,
                                         ThreadPool& pool, const std::atomic<bool>& cancelled)
    : first_(first) {
  const std::vector<IrradianceRecord>& records = cache.records();
  std::vector<Vec3> positions;
  for (const IrradianceRecord& r : records) positions.push_back(r.position);
  const PointTree tree(positions, pool);
  const float overlap = IrradianceCache::kOverlap * cache.error();
  // Metres: things nearer than that hide no more than a little of what is seen.
  const auto clear_of_walls = [&](size_t k) { return std::max(records[k].reach, kOfWall * gathered[k].wall); };
  // Metres within which others may be alike.
  std::vector<float> open(records.size());
  for (size_t k = 0; k < records.size(); ++k) {
    Around around = gathered[k].around;
    std::sort(around.begin(), around.end());
    open[k] = std::min(around[around.size() / 2], kFar * records[k].radius * overlap);
  }
  std::vector<std::vector<uint32_t>> found(records.size());
  pool.for_each(int((records.size() + kBatch - 1) / kBatch), cancelled, [&](int batch) {
    std::vector<PointTree::Found> near;
    for (size_t i = std::max(first, size_t(batch) * kBatch); i < std::min(records.size(), size_t(batch + 1) * kBatch); ++i) {
      const IrradianceRecord& own = records[i];
      const auto accepts = [&](uint32_t k) {
        const uint32_t other = tree.order()[k];
        const float seen = std::min(clear_of_walls(i), clear_of_walls(other)), held = overlap * std::min(own.radius, records[other].radius);
        if (are_of_one_surface(own, records[other], std::max(seen, held))) return true;
        return are_of_one_surface(own, records[other], std::min(open[i], open[other])) &&
               are_alike(gathered[i].around, gathered[other].around, length(own.position - records[other].position));
      };
      const float farthest = 1.001f * std::max({clear_of_walls(i), overlap * own.radius, open[i]});
      tree.nearest(own.position, std::end(kSteps)[-1], sqr(farthest), near, accepts);
      for (PointTree::Found& f : near) f.point = tree.order()[f.point];
      std::sort(near.begin(), near.end(), [&](const auto& a, const auto& b) {
        if ((a.point == i) != (b.point == i)) return a.point == i;
        return a.distance_squared != b.distance_squared ? a.distance_squared < b.distance_squared : a.point < b.point;
      });
      for (const PointTree::Found& f : near) found[i].push_back(f.point);
    }
  });
  begin_.push_back(0);
  for (const auto& list : found) {
    neighbours_.insert(neighbours_.end(), list.begin(), list.end());
    begin_.push_back(uint32_t(neighbours_.size()));
  }
}

// Of means over more and more records, the widest that differs from every narrower one by no more than that one's noise.
IrradianceRecord IrradianceSmoothing::smooth(const std::vector<Gathered>& records, uint32_t index, float strength) const {
  const IrradianceRecord& own = records[index].light;
  const std::span<const uint32_t> near(&neighbours_[begin_[index]], begin_[index + 1] - begin_[index]);
  // Of a record alone, variance goes with what its rays happened to find: dark ones would seem sure, and bright ones be darkened.
  float variance = 0;
  const size_t judges = std::min(near.size(), kJudges);
  for (size_t k = 0; k < judges; ++k) variance += records[near[k]].variance / float(judges);

  IrradianceRecord sum = own, best = own;
  Vec3 towards;
  float narrower[std::size(kSteps)] = {luminance(own.irradiance)}, tolerated[std::size(kSteps)] = {kAlone * strength * std::sqrt(variance)};
  for (size_t step = 1, taken = 1; step < std::size(kSteps) && kSteps[step] <= near.size(); ++step) {
    for (; taken < kSteps[step]; ++taken) {
      const IrradianceRecord& light = records[near[taken]].light;
      towards += own.position - light.position;
      sum.irradiance += light.irradiance;
      for (int axis = 0; axis < 3; ++axis) sum.translation[axis] += light.translation[axis], sum.lateral[axis] += light.lateral[axis];
    }
    // The mean is of the light in their midst: on from there by the mean gradient, whose noise is less than that of each.
    const float share = 1.0f / float(taken);
    IrradianceRecord mean = own;
    mean.irradiance = sum.irradiance * share;
    for (int axis = 0; axis < 3; ++axis) {
      mean.translation[axis] = sum.translation[axis] * share, mean.lateral[axis] = sum.lateral[axis] * share;
      mean.irradiance += mean.translation[axis] * (towards[axis] * share);
    }
    const float value = luminance(mean.irradiance);
    for (size_t k = 0; k < step; ++k)
      if (!(std::abs(value - narrower[k]) <= tolerated[k])) return best;
    narrower[step] = value, tolerated[step] = strength * std::sqrt(variance * share);
    best = mean;
  }
  return best;
}

}  // namespace gi
