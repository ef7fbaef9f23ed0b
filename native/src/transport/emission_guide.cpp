// Building the tree of boxes: where a halving lowers the variance by more than chance would seem to, as decision trees are grown.
#include "transport/emission_guide.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>

#include "core/vec.h"

namespace gi {
namespace {

constexpr int kBins = 8;          // along each axis that a box is looked at by: what lies in the middle has equal halves
constexpr double kChance = 3.0;   // gain that as many equal trials might show by chance, times their number
constexpr double kLeastGain = 1e-4;  // of the whole
constexpr double kUnseen = 1.0;      // trials
constexpr int kMostHalvings = 12;    // of one axis

}  // namespace

// The density of least variance is in proportion to √(mean of f²) [Kahn & Marshall 1953]. Taken here is √(mean of f): the same where
// particles bring all or nothing, and not led astray by the few that bring much. A box's mass is that times its volume.
struct EmissionGuide::Builder {
  std::vector<Node>& nodes;
  double whole, even;
  std::vector<double> mass = {0.0};  // of each node

  struct Box {
    EmissionNumbers low{};
    std::array<int, kEmissionAxes> halvings{};
    double volume = 1;
    float size(int axis) const { return std::ldexp(1.0f, -halvings[size_t(axis)]); }
  };

  void grow(uint32_t index, std::span<Trial> trials, const Box& box, double worth) {
    mass[index] = std::sqrt(worth * box.volume);
    double sum = 0, squares = 0, bins[kEmissionAxes][kBins] = {};
    for (const Trial& t : trials) {
      sum += double(t.worth), squares += double(t.worth) * double(t.worth);
      for (int a = 0; a < int(kEmissionAxes); ++a) {
        const float place = (t.u[size_t(a)] - box.low[size_t(a)]) / box.size(a);
        bins[a][std::clamp(int(place * kBins), 0, kBins - 1)] += double(t.worth);
      }
    }
    if (!(sum > 0)) return;
    int best = -1;
    double most = kChance * squares / (sum * sum);
    for (int a = 0; a < int(kEmissionAxes); ++a) {
      if (box.halvings[size_t(a)] == kMostHalvings) continue;
      double divided = 0;
      for (const double b : bins[a]) divided += std::sqrt(b / sum / kBins);
      if (1.0 - divided > most) most = 1.0 - divided, best = a;
    }
    if (best < 0 || most * mass[index] < kLeastGain * whole) return;

    Box halves[2] = {box, box};
    for (Box& h : halves) h.volume *= 0.5, ++h.halvings[size_t(best)];
    const float middle = halves[1].low[size_t(best)] += halves[1].size(best);
    const auto second = std::partition(trials.begin(), trials.end(), [&](const Trial& t) { return t.u[size_t(best)] < middle; });
    // As if each half had one more: few trials do not say that there is nothing where they are not.
    const double count = sum * sum / squares, below = std::accumulate(bins[best], bins[best] + kBins / 2, 0.0) / sum;
    const double share = (below * count + kUnseen) / (count + 2.0 * kUnseen);
    const uint32_t first = uint32_t(nodes.size());
    nodes.resize(nodes.size() + 2), mass.resize(nodes.size());
    nodes[index].first = first, nodes[index].axis = uint32_t(best);
    grow(first, {trials.begin(), second}, halves[0], share * worth);
    grow(first + 1, {second, trials.end()}, halves[1], (1.0 - share) * worth);
    mass[index] = mass[first] + mass[first + 1];
  }

  // Mixes even numbers in.
  void share(uint32_t index, double volume, double total) {
    Node& n = nodes[index];
    mass[index] = (1.0 - even) * mass[index] / total + even * volume;
    if (n.first == 0) return;
    for (uint32_t c : {n.first, n.first + 1}) share(c, 0.5 * volume, total);
    n.lower = float(mass[n.first] / mass[index]);
    n.over[0] = 1.0f / n.lower, n.over[1] = 1.0f / (1.0f - n.lower);
  }
};

EmissionGuide::EmissionGuide(std::vector<Trial> trials, float even) {
  std::erase_if(trials, [](const Trial& t) { return !(t.worth > 0.0f) || !std::isfinite(t.worth); });
  double sum = 0;
  for (const Trial& t : trials) sum += double(t.worth);
  if (!(sum > 0)) return;
  nodes_.resize(1);
  Builder builder{nodes_, std::sqrt(sum), double(even)};
  builder.grow(0, trials, {}, sum);
  builder.share(0, 1.0, builder.mass[0]);
}

float EmissionGuide::warp(EmissionNumbers& u) const {
  if (nodes_.empty()) return 1.0f;
  EmissionNumbers low{}, size;
  size.fill(1.0f);
  float weight = 1.0f;
  // Both sides are worked out: which it is would be guessed wrong every other time.
  for (const Node* n = &nodes_[0]; n->first != 0;) {
    const uint32_t a = n->axis;
    const float below = u[a] * n->over[0], above = (u[a] - n->lower) * n->over[1], middle = low[a] + (size[a] *= 0.5f);
    const bool upper = above >= 0.0f;
    u[a] = std::min(upper ? above : below, kOneMinusEpsilon);  // below 1, or a half of no mass might be taken
    low[a] = upper ? middle : low[a];
    weight *= 0.5f * (upper ? n->over[1] : n->over[0]);
    n = &nodes_[n->first + upper];
  }
  for (size_t a = 0; a < kEmissionAxes; ++a) u[a] = std::min(low[a] + size[a] * u[a], kOneMinusEpsilon);
  return weight;
}

SeenPoints::SeenPoints(const std::vector<Vec3>& points, ThreadPool& pool) : tree_(points, pool) {
  constexpr size_t kNeighbours = 8;
  std::vector<PointTree::Found> found;
  for (uint32_t k = 0; k < tree_.size(); ++k) {
    tree_.nearest(tree_.point(k), kNeighbours, kInf, found);
    float reach = 0.0f;
    for (const auto& f : found) reach = std::max(reach, f.distance_squared);
    reach_.push_back(reach);
  }
}

float SeenPoints::density(Vec3 position) const {
  float best = kInf;
  uint32_t nearest = 0;
  tree_.within(position, best, [&](uint32_t k, float d2) {
    if (d2 < best) best = d2, nearest = k;
  });
  return best < kInf && best <= reach_[nearest] && reach_[nearest] > 0.0f ? 1.0f / reach_[nearest] : 0.0f;
}

}  // namespace gi
