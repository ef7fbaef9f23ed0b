// Bounds from samples, at the corners of each cell and at random within it: with a margin, and widened by those of the neighbours, into
// which something may reach that none of their samples saw.
#include "core/sampler.h"
#include "transport/volumes.h"

namespace gi {
namespace {

constexpr int kWithin = 2;               // samples within a cell
constexpr float kMargin = 0.25f;         // of what the samples of a cell differ by
constexpr float kLeastLooks = 0.25f;     // across a box, wherever there seems to be nothing
constexpr float kLeastShare = 0.01f, kMostOfThat = 4.0f;  // of the most in the box, likewise; but no more looks across the box than that
constexpr float kEmissionLooks = 8.0f;   // across a box as bright as its brightest cell

struct Seen {
  Rgb least{kInf}, most;
  float emission = 0;
  void add(const Medium& m) {
    const Rgb sigma = m.sigma_t;
    for (int c = 0; c < 3; ++c) least[c] = std::min(least[c], sigma[c]), most[c] = std::max(most[c], sigma[c]);
    const float shines = max_component(abs(m.emission));
    if (std::isfinite(shines)) emission = std::max(emission, shines);
  }
  void add(const Seen& s) {
    for (int c = 0; c < 3; ++c) least[c] = std::min(least[c], s.least[c]), most[c] = std::max(most[c], s.most[c]);
    emission = std::max(emission, s.emission);
  }
};

// A cube of n³ values, by x fastest.
template <class T>
struct Cube {
  int n;
  std::vector<T> values;
  explicit Cube(int side) : n(side), values(size_t(side) * size_t(side) * size_t(side)) {}
  size_t index(int x, int y, int z) const { return (size_t(z) * size_t(n) + size_t(y)) * size_t(n) + size_t(x); }
  T& operator()(int x, int y, int z) { return values[index(x, y, z)]; }
};

// Calls f(x, y, z) for all of a cube of side n, in threads.
template <class F>
void for_each_cell(ThreadPool& pool, int n, const F& f) {
  static const std::atomic<bool> kNever{false};
  pool.for_each(n, kNever, [&](int z) {
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) f(x, y, z);
  });
}

// Each cell with its neighbours along one axis.
Cube<Seen> widened(const Cube<Seen>& from, int axis) {
  Cube<Seen> to = from;
  const int n = from.n;
  for (int z = 0; z < n; ++z)
    for (int y = 0; y < n; ++y)
      for (int x = 0; x < n; ++x) {
        const int at[3] = {x, y, z};
        for (const int step : {-1, 1}) {
          int other[3] = {x, y, z};
          other[axis] = std::clamp(at[axis] + step, 0, n - 1);
          to(x, y, z).add(from.values[from.index(other[0], other[1], other[2])]);
        }
      }
  return to;
}

}  // namespace

VolumeGrid::VolumeGrid(const Bounds& innermost, int boxes, int cells, float metres_per_unit, const Look& look, ThreadPool& pool)
    : cells_(cells) {
  const Vec3 center = innermost.center();
  Vec3 half = innermost.extent() * 0.5f;
  const float thinnest = std::max({half.x, half.y, half.z, 1e-6f}) * 1e-3f;
  half = max(half, {thinnest, thinnest, thinnest});
  for (int k = 0; k < boxes; ++k, half = half * 2.0f) {
    Box& box = boxes_.emplace_back();
    box.lo = center - half, box.hi = center + half, box.cell = half * (2.0f / float(cells));
    const auto sample = [&](float x, float y, float z) {
      Seen seen;
      look(box.lo + box.cell * Vec3{x, y, z}, [&](const Medium& m) { seen.add(m); });
      return seen;
    };
    Cube<Seen> corners(cells + 1), all(cells);
    for_each_cell(pool, cells + 1, [&](int x, int y, int z) { corners(x, y, z) = sample(float(x), float(y), float(z)); });
    for_each_cell(pool, cells, [&](int x, int y, int z) {
      Seen seen;
      Sampler random(uint32_t(k), uint32_t((z * cells + y) * cells + x), 0);
      for (int s = 0; s < kWithin; ++s) {
        const float u = random.next_1d();
        const Vec2 v = random.next_2d();
        seen.add(sample(float(x) + u, float(y) + v.x, float(z) + v.y));
      }
      for (int c = 0; c < 8; ++c) seen.add(corners(x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)));
      all(x, y, z) = seen;
    });
    for (int axis = 0; axis < 3; ++axis) all = widened(all, axis);

    Seen total;
    for (const Seen& s : all.values) total.add(s);
    const float across = 2.0f * length(half) * metres_per_unit;
    const float floor = std::max(kLeastLooks / across, std::min(kLeastShare * max_component(total.most), kMostOfThat / across));
    for (const Seen& s : all.values) {
      VolumeBounds& b = box.bounds.emplace_back();
      for (int c = 0; c < 3; ++c) {
        const float margin = kMargin * (s.most[c] - s.least[c]);
        b.least[c] = std::max(s.least[c] - margin, 0.0f);
        b.most = std::max(b.most, s.most[c] + margin), b.spread = std::max(b.spread, s.most[c] + margin - b.least[c]);
      }
      const float glow = total.emission > 0.0f ? kEmissionLooks / across * (s.emission / total.emission) : 0.0f;
      b.most = std::max({b.most, floor, glow}), b.spread = std::max(b.spread, floor);
    }
  }
}

const VolumeBounds& VolumeGrid::at(Vec3 origin, Vec3 direction, float t, float& until) const {
  const Vec3 p = origin + direction * t;
  const auto holds = [&](const Box& b) {
    return p.x >= b.lo.x && p.y >= b.lo.y && p.z >= b.lo.z && p.x < b.hi.x && p.y < b.hi.y && p.z < b.hi.z;
  };
  size_t k = 0;
  while (k + 1 < boxes_.size() && !holds(boxes_[k])) ++k;
  const Box& box = boxes_[k];
  const bool is_last = k + 1 == boxes_.size();
  int cell[3];
  until = kInf;
  for (int a = 0; a < 3; ++a) {
    const int i = cell[a] = int(std::clamp((p[a] - box.lo[a]) / box.cell[a], 0.0f, float(cells_ - 1)));
    const bool up = direction[a] > 0.0f;
    if (direction[a] == 0.0f || (is_last && i == (up ? cells_ - 1 : 0))) continue;
    const float plane = box.lo[a] + box.cell[a] * float(up ? i + 1 : i);
    // A little beyond it, or the same cell would be found again.
    until = std::min(until, (plane - origin[a]) / direction[a] + 1e-4f * box.cell[a] / std::abs(direction[a]));
  }
  if (!(until > t)) until = std::nextafter(t + 1e-6f * (std::abs(t) + length(box.cell)), kInf);
  const size_t n = size_t(cells_);
  return box.bounds[(size_t(cell[2]) * n + size_t(cell[1])) * n + size_t(cell[0])];
}

float VolumeGrid::end(Vec3 origin, Vec3 direction) const {
  const Box& box = boxes_.back();
  float t = kInf;
  for (int a = 0; a < 3; ++a)
    if (direction[a] != 0.0f) t = std::min(t, ((direction[a] > 0.0f ? box.hi[a] : box.lo[a]) - origin[a]) / direction[a]);
  return std::max(t, 0.0f);
}

}  // namespace gi
