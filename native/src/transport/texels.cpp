// Texels: where the lattices are, what stands on them, and the sums.
#include "transport/texels.h"

#include <bit>
#include <cstdlib>
#include <cstring>
#include <map>
#include <new>
#include <numeric>
#include <set>

#include "core/check.h"
#include "core/sampler.h"
#include "transport/path_state.h"

namespace gi {
namespace {

constexpr double kCoarser = 1.189207115;  // fourth root of 2: steps in which texels grow
constexpr double kMostCells = 1e7;        // that are looked at for what stands on them
constexpr double kMostSightRays = 1e7;    // spent on the areas of those that something does stand on
constexpr double kHidden = 0.02;          // share of a hat below which it counts as hidden
constexpr float kReaderParts = 64.0f;     // readers are counted in these
constexpr double kDarkest = 0.1;          // of the mean density that is read: darker nodes count as if they were this bright
constexpr uint32_t kSightMask = kRayDiffuse;

// The factor by which a transform scales lengths; 0 if not the same in all directions.
float uniform_scale(const Affine& a) {
  const Vec3 x = a.column(0), y = a.column(1), z = a.column(2);
  const float s = dot(x, x), small = 1e-3f * s;
  const bool uniform = std::abs(dot(y, y) - s) < small && std::abs(dot(z, z) - s) < small && std::abs(dot(x, y)) < small &&
                       std::abs(dot(y, z)) < small && std::abs(dot(z, x)) < small;
  return uniform ? std::sqrt(s) : 0.0f;
}

// Instances with the same key share a lattice: one mesh, of sizes within a factor of √2.
struct LatticeKey {
  uint32_t mesh;
  int scale;
  uint32_t own;  // the instance, where nothing is shared
  auto operator<=>(const LatticeKey&) const = default;
};
LatticeKey key_of(const Scene& scene, uint32_t i) {
  const Instance& instance = scene.instances()[i];
  const float scale = uniform_scale(instance.to_world);
  if (!(scale > 0.0f)) return {instance.mesh, 0, i};
  return {instance.mesh, int(std::lround(2.0 * std::log2(double(scale)))), kNoId};
}

// A small triangle in the world, between whose points sight is tested, a little above it; corners a little inside, for walls end there.
struct SightCell {
  Vec3 corner[3], middle, up;
  SightCell(const Scene& scene, uint32_t instance, const LatticeCell& cell, bool back) {
    Vec3 v[3];
    scene.triangle_vertices(instance, cell.triangle, v);
    const Vec3 e1 = (v[1] - v[0]) / float(cell.size), e2 = (v[2] - v[0]) / float(cell.size), n = cross(e1, e2);
    const Instance& placed = scene.instances()[instance];
    const float height = std::max(0.01f * std::sqrt(length(n)), 1e-5f * std::max({std::abs(v[0].x), std::abs(v[0].y), std::abs(v[0].z)}));
    up = normalize(n) * (back != placed.mirrored ? -height : height);
    for (size_t k = 0; k < 3; ++k) corner[k] = v[0] + float(cell.at[k][0]) * e1 + float(cell.at[k][1]) * e2;
    middle = (corner[0] + corner[1] + corner[2]) / 3.0f;
  }
  Vec3 inside(size_t k) const { return lerp(corner[k], middle, 0.03f); }
  // Near a corner, in the small triangle beyond the edge between two.
  Vec3 beyond(size_t k, size_t from, size_t to) const { return lerp(corner[k], corner[from] + corner[to] - middle, 0.03f); }
  bool sees(const Scene& scene, Vec3 a, Vec3 b) const {
    const Vec3 from = a + up, to = b + up;
    const float distance = length(to - from);
    return !(distance > 0.0f) || !scene.intersect({from, (to - from) / distance, 0.0f, distance}, kSightMask);
  }
};

}  // namespace

Texels::Texels(const Scene& scene, double size, size_t memory, ThreadPool& pool, const std::atomic<bool>& cancelled)
    : scene_(scene), size_(size), sums_(nullptr, std::free) {
  const Vec3 extent = scene.bounds().empty() ? Vec3{1, 1, 1} : scene.bounds().extent();
  const double whole = std::max(double(length(extent)), 1e-6);
  while (bytes_at(size_) > double(memory) && size_ < whole) size_ *= kCoarser;
  place_lattices();
  find_splits(pool, cancelled);
}

Texels::~Texels() = default;

double Texels::bytes_at(double size) const {
  std::map<LatticeKey, double> nodes;
  double bytes = 0;
  for (uint32_t i = 0; i < scene_.instances().size(); ++i) {
    const auto [at, is_new] = nodes.try_emplace(key_of(scene_, i), 0.0);
    if (is_new) {
      at->second = TexelLattice::estimate_nodes(scene_, i, size);
      bytes += 40.0 * double(scene_.mesh(scene_.instances()[i].mesh).triangle_count()) + 4.0 * at->second;
    }
    bytes += 2.0 * sizeof(Sum) * at->second;
  }
  return bytes;
}

void Texels::place_lattices() {
  struct Made {
    std::shared_ptr<const TexelLattice> lattice;
    float scale;
  };
  std::map<LatticeKey, Made> made;
  std::vector<size_t> first;
  size_t total = 0;
  for (uint32_t i = 0; i < scene_.instances().size(); ++i) {
    const float scale = uniform_scale(scene_.instances()[i].to_world);
    Made& m = made[key_of(scene_, i)];
    if (!m.lattice) m = {std::make_shared<TexelLattice>(scene_, i, size_), scale};
    Place& place = places_.emplace_back();
    place.lattice = m.lattice;
    if (scale > 0.0f) place.area_scale = sqr(scale / m.scale);
    first.push_back(total);
    total += 2 * size_t(m.lattice->node_count());
  }
  // Zeroed by the system page by page as it is used: the insides of closed things cost nothing.
  sums_.reset(static_cast<Sum*>(std::calloc(std::max(total, size_t(1)), sizeof(Sum))));
  if (!sums_) throw std::bad_alloc();
  for (size_t i = 0; i < places_.size(); ++i)
    for (size_t s = 0; s < 2; ++s) places_[i].side[s].sums = sums_.get() + first[i] + s * places_[i].lattice->node_count();
}

// ---------------------------------------------------------------- what stands on a surface

// A hat must not reach through a wall, nor count the floor beneath a box: where something comes between a point and the middle of a
// hat, the hat is 0 and its neighbours make up for it. Most small triangles are free and need not ask.
void Texels::find_splits(ThreadPool& pool, const std::atomic<bool>& cancelled) {
  struct Task {
    uint32_t instance, first, last;
    bool back;
    Splits found{};
  };
  std::vector<Task> tasks;
  double cells = 0;
  for (uint32_t i = 0; i < places_.size(); ++i) {
    const uint32_t count = uint32_t(scene_.mesh(scene_.instances()[i].mesh).triangle_count());
    cells += 2.0 * places_[i].lattice->cell_count();
    constexpr uint32_t kBatch = 64;
    for (int back = 0; back < 2; ++back)
      for (uint32_t t = 0; t < count; t += kBatch) tasks.push_back({i, t, std::min(t + kBatch, count), back == 1});
  }
  if (cells > kMostCells) {
    split_all_ = false;
    return;
  }
  pool.for_each(int(tasks.size()), cancelled, [&](int k) {
    Task& task = tasks[size_t(k)];
    for (uint32_t t = task.first; t < task.last; ++t) test_triangle(task.instance, t, task.back, task.found);
  });
  for (const Task& task : tasks) splits_ += task.found.cells.size() / 2;
  if (splits_ == 0 || cancelled) return;

  // The areas that are left of the hats, by testing points of each split small triangle.
  const int samples = std::clamp(int(std::sqrt(kMostSightRays / 3 / double(splits_))), 3, 12);
  for (size_t begin = 0, end = 0; begin < tasks.size(); begin = end) {
    while (end < tasks.size() && tasks[end].instance == tasks[begin].instance && tasks[end].back == tasks[begin].back) ++end;
    const uint32_t i = tasks[begin].instance;
    Place& place = places_[i];
    std::vector<uint32_t> all;
    for (size_t k = begin; k < end; ++k) all.insert(all.end(), tasks[k].found.cells.begin(), tasks[k].found.cells.end());
    if (all.empty()) continue;
    Side& side = place.side[tasks[begin].back];
    side.split.assign(place.lattice->cell_count() / 32 + 1, 0u);
    for (size_t k = begin; k < end; ++k)
      for (const uint32_t node : tasks[k].found.walled) side.walled.resize(place.lattice->node_count()), side.walled[node] = true;
    add_walled(*place.lattice, side, all);
    std::vector<double> area(place.lattice->area().begin(), place.lattice->area().end());
    for (double& a : area) a *= double(place.area_scale);
    for (size_t k = 0; k < all.size(); k += 2) {
      const uint32_t cell = place.lattice->cell(all[k], all[k + 1]).index;
      side.split[cell / 32] |= 1u << (cell % 32);
    }
    // In threads, added up in order: sums must not depend on which is first.
    constexpr size_t kBatch = 64;
    const size_t batches = (all.size() / 2 + kBatch - 1) / kBatch;
    std::vector<std::vector<std::pair<uint32_t, double>>> changes(batches);
    pool.for_each(int(batches), cancelled, [&](int b) {
      for (size_t k = size_t(b) * kBatch; k < std::min(all.size() / 2, (size_t(b) + 1) * kBatch); ++k)
        measure_split(i, tasks[begin].back, all[2 * k], all[2 * k + 1], samples, changes[size_t(b)]);
    });
    for (const auto& list : changes)
      for (const auto& [node, change] : list) area[node] += change;
    // What is all but hidden has no area: its power would be divided by rounding.
    for (size_t n = 0; n < area.size(); ++n)
      if (area[n] < kHidden * double(place.area_scale * place.lattice->area()[n])) area[n] = 0;
    side.area.assign(area.begin(), area.end());
  }
}

void Texels::test_triangle(uint32_t instance, uint32_t triangle, bool back, Splits& found) const {
  const TexelLattice& lattice = *places_[instance].lattice;
  if (lattice.is_merged(triangle)) return;
  // Every edge between lattice points belongs to one upright small triangle: (i, j) of row j. Those of a row alternate with the
  // others, upside down, across its edges.
  const uint32_t n = 1u << lattice.level(triangle);
  const auto index = [&](uint32_t i, uint32_t j, bool upright) { return j * (2 * n - j) + 2 * i + (upright ? 0 : 1); };
  std::vector<bool> split(size_t(n) * n, false);
  for (uint32_t j = 0; j < n; ++j)
    for (uint32_t i = 0; i + j < n; ++i) {
      const LatticeCell cell = lattice.cell(triangle, index(i, j, true));
      const SightCell s(scene_, instance, cell, back);
      // From one end to the other and, where the surface goes on, over to the edge's other side: a wall may stand on the edge itself.
      const auto cut = [&](size_t from, size_t to, bool goes_on) {
        if (s.sees(scene_, s.inside(from), goes_on ? s.beyond(to, from, to) : s.inside(to))) return false;
        if (goes_on && s.sees(scene_, s.inside(from), s.inside(to)) && s.sees(scene_, s.beyond(from, from, to), s.beyond(to, from, to)))
          for (const size_t end : {from, to})
            lattice.for_each_node(cell, int(end), 1.0f, [&](uint32_t node, float) { found.walled.push_back(node); });
        return true;
      };
      const bool below = cut(0, 1, j > 0 || lattice.continues(triangle, 0)), left = cut(2, 0, i > 0 || lattice.continues(triangle, 2)),
                 beyond = cut(1, 2, i + j + 1 < n || lattice.continues(triangle, 1));
      if (below || beyond || left) split[index(i, j, true)] = true;
      if (below && j > 0) split[index(i, j - 1, false)] = true;
      if (left && i > 0) split[index(i - 1, j, false)] = true;
      if (beyond && i + j + 1 < n) split[index(i, j, false)] = true;
    }
  for (uint32_t k = 0; k < n * n; ++k)
    if (split[k]) found.cells.push_back(triangle), found.cells.push_back(k);
}

// All small triangles at such nodes, as far as they are not among `cells`.
void Texels::add_walled(const TexelLattice& lattice, Side& side, std::vector<uint32_t>& cells) const {
  if (side.walled.empty()) return;
  std::set<std::pair<uint32_t, uint32_t>> known;
  for (size_t k = 0; k < cells.size(); k += 2) known.emplace(cells[k], cells[k + 1]);
  for (uint32_t t = 0; t < lattice.triangle_count(); ++t)
    for (uint32_t k = 0; !lattice.is_merged(t) && k < 1u << (2 * lattice.level(t)); ++k) {
      const LatticeCell cell = lattice.cell(t, k);
      if ((is_walled(side, lattice, cell, 0) || is_walled(side, lattice, cell, 1) || is_walled(side, lattice, cell, 2)) &&
          known.emplace(t, k).second)
        cells.push_back(t), cells.push_back(k);
    }
}

bool Texels::is_walled(const Side& side, const TexelLattice& lattice, const LatticeCell& cell, int corner) {
  bool walled = false;
  lattice.for_each_node(cell, corner, 1.0f, [&](uint32_t node, float w) { walled = walled || (w > 0.0f && side.walled[node]); });
  return walled;
}

void Texels::measure_split(uint32_t instance, bool back, uint32_t triangle, uint32_t k, int samples,
                           std::vector<std::pair<uint32_t, double>>& changes) const {
  const TexelLattice& lattice = *places_[instance].lattice;
  const LatticeCell found = lattice.cell(triangle, k);
  const SightCell s(scene_, instance, found, back);
  const double part = 0.5 * double(length(cross(s.corner[1] - s.corner[0], s.corner[2] - s.corner[0]))) / (samples * samples);
  // The middles of samples² equal triangles.
  for (int j = 0; j < samples; ++j)
    for (int i = 0; i < 2 * (samples - j) - 1; ++i) {
      const float third = i % 2 == 0 ? 1.0f / 3.0f : 2.0f / 3.0f;
      LatticeCell cell = found;
      cell.weight[1] = (float(i / 2) + third) / float(samples), cell.weight[2] = (float(j) + third) / float(samples);
      cell.weight[0] = 1.0f - cell.weight[1] - cell.weight[2];
      const LatticeCell before = cell;
      weigh_by_sight(instance, back, cell.weight[0] * s.corner[0] + cell.weight[1] * s.corner[1] + cell.weight[2] * s.corner[2], cell);
      for (int c = 0; c < 3; ++c) {
        const float change = cell.weight[c] - before.weight[c];
        if (change == 0.0f) continue;
        lattice.for_each_node(cell, c, change, [&](uint32_t node, float w) { changes.emplace_back(node, part * double(w)); });
      }
    }
}

void Texels::weigh_by_sight(uint32_t instance, bool back, Vec3 position, LatticeCell& cell) const {
  const SightCell s(scene_, instance, cell, back);
  const Side& side = places_[instance].side[back];
  // A node on a wall belongs to neither side, unless a point has no other.
  float seen[3], off_walls[3], sum = 0, sum_off_walls = 0;
  for (size_t k = 0; k < 3; ++k) {
    sum += seen[k] = s.sees(scene_, position, s.inside(k)) ? cell.weight[k] : 0.0f;
    const bool walled = !side.walled.empty() && is_walled(side, *places_[instance].lattice, cell, int(k));
    sum_off_walls += off_walls[k] = walled ? 0.0f : seen[k];
  }
  const bool off = sum_off_walls > 1e-4f;
  if (!off && !(sum > 1e-4f)) return;
  for (int k = 0; k < 3; ++k) cell.weight[k] = off ? off_walls[k] / sum_off_walls : seen[k] / sum;
}

// ---------------------------------------------------------------- sums

LatticeCell Texels::cell_of(const ShadingPoint& point, bool back) const {
  const Place& place = places_[point.instance];
  LatticeCell cell = place.lattice->locate(point.triangle, point.b1, point.b2);
  const std::vector<uint32_t>& split = place.side[back].split;
  if (!split.empty() && (split[cell.index / 32] >> (cell.index % 32) & 1u)) weigh_by_sight(point.instance, back, point.position, cell);
  return cell;
}

void Texels::clear(double largest) {
  unit_ = std::max(largest, 1e-30) * 0x1p-44;
  for (Place& place : places_)
    for (Side& side : place.side) {
      if (!side.touched) continue;
      std::memset(static_cast<void*>(side.sums), 0, place.lattice->node_count() * sizeof(Sum));
      side.touched = false;
    }
}

double Texels::deposit(const ShadingPoint& point, bool back, Rgb power) {
  Place& place = places_[point.instance];
  Side& side = place.side[back];
  side.touched.store(true, std::memory_order_relaxed);
  const LatticeCell cell = cell_of(point, back);
  // Any number that has nothing to do with the power will do.
  const float choice = to_unit_float(hash_combine(std::bit_cast<uint32_t>(point.b1), std::bit_cast<uint32_t>(point.b2)));
  LatticePoint nodes;
  for (int k = 0; k < 3; ++k)
    if (cell.weight[k] > 0.0f) place.lattice->add_nodes(cell, k, cell.weight[k], choice, nodes);
  // Whole numbers: their sum does not depend on the order.
  constexpr double kMost = 0x1p61;
  double worth = 0;
  for (int k = 0; k < nodes.count; ++k) {
    for (int c = 0; c < 3; ++c) {
      const double counts = std::min(double(power[c]) * double(nodes.weight[k]) / unit_, kMost);
      if (counts >= 1.0) side.sums[nodes.node[k]].channel[c].fetch_add(int64_t(counts), std::memory_order_relaxed);
    }
    if (!worth_.empty()) worth += double(average(power) * nodes.weight[k]) * double(worth_[index_of(side, nodes.node[k])]);
  }
  return worth;
}

double Texels::area(const Place& place, bool back, uint32_t node) const {
  const std::vector<float>& own = place.side[back].area;
  return own.empty() ? double(place.lattice->area()[node]) * double(place.area_scale) : double(own[node]);
}

Rgb Texels::density(const ShadingPoint& point, bool back) const {
  const Place& place = places_[point.instance];
  const Side& side = place.side[back];
  if (!side.touched && !readers_) return Rgb();
  const LatticeCell cell = cell_of(point, back);
  double sum[3] = {0, 0, 0}, used = 0;
  for (int k = 0; k < 3; ++k) {
    if (!(cell.weight[k] > 0.0f)) continue;
    place.lattice->for_each_node(cell, k, cell.weight[k], [&](uint32_t node, float w) {
      const double covered = area(place, back, node);
      if (!(covered > 0)) return;
      used += double(w);
      if (readers_) readers_[index_of(side, node)].fetch_add(uint32_t(w * kReaderParts), std::memory_order_relaxed);
      for (int c = 0; c < 3; ++c) sum[c] += double(side.sums[node].channel[c].load(std::memory_order_relaxed)) * double(w) / covered;
    });
  }
  if (!(used > 0)) return Rgb();
  const double scale = unit_ / used;
  return {float(sum[0] * scale), float(sum[1] * scale), float(sum[2] * scale)};
}

// ---------------------------------------------------------------- what is read

void Texels::watch() { readers_ = std::make_unique<std::atomic<uint32_t>[]>(node_count()); }

void Texels::appraise() {
  worth_.resize(node_count());
  const auto for_each_read = [&](const auto& f) {
    for (const Place& place : places_)
      for (const bool back : {false, true})
        for (uint32_t n = 0; n < place.lattice->node_count(); ++n) {
          const size_t i = index_of(place.side[back], n);
          const double readers = double(readers_[i].load(std::memory_order_relaxed)), covered = area(place, back, n);
          if (!(readers > 0)) continue;
          double sum = 0;
          for (const auto& c : sums_.get()[i].channel) sum += double(c.load(std::memory_order_relaxed));
          f(i, readers, covered, unit_ * sum / 3.0 / covered);
        }
  };
  double readers = 0, mean = 0;
  for_each_read([&](size_t, double n, double, double density) { readers += n, mean += n * density; });
  for_each_read([&](size_t i, double n, double covered, double density) {
    const double brightness = mean > 0 ? std::max(density * readers / mean, kDarkest) : 1.0;
    worth_[i] = float(n / readers / (covered * brightness));
  });
}

// ---------------------------------------------------------------- what there is

size_t Texels::node_count() const {
  size_t n = 0;
  for (const Place& place : places_) n += 2 * size_t(place.lattice->node_count());
  return n;
}

size_t Texels::memory_bytes() const {
  std::map<const TexelLattice*, size_t> lattices;
  size_t bytes = node_count() * sizeof(Sum);
  for (const Place& place : places_) {
    lattices[place.lattice.get()] = place.lattice->memory_bytes();
    for (const Side& side : place.side) bytes += 4 * (side.split.size() + side.area.size());
  }
  for (const auto& [lattice, size] : lattices) bytes += size;
  return bytes;
}

std::string Texels::description() const {
  char text[200];
  std::snprintf(text, sizeof text, "%zu texels of about %.4g m, %.0f MiB at most; %zu of them cut by what stands on them%s", node_count(),
                size_, double(memory_bytes()) / 0x1p20, splits_, split_all_ ? "" : " (too many to look at: light may creep under walls)");
  return text;
}

}  // namespace gi
