// A balanced k-d tree over points, for finding those near a place: all within a radius, or the nearest k. Its shape follows from the number
// of points alone, so nodes hold no pointers; leaves hold a handful each. [Bentley 1975; Friedman, Bentley & Finkel 1977]
#pragma once
#include <vector>

#include "core/large_vector.h"
#include "core/parallel.h"
#include "core/vec.h"

namespace gi {

class PointTree {
 public:
  PointTree() = default;
  // The tree does not depend on the number of threads.
  PointTree(const std::vector<Vec3>& points, ThreadPool& pool) : PointTree(points, [](Vec3 p) { return p; }, pool) {}
  // Of position(thing) of all `things`.
  template <class Things, class Position>
  PointTree(const Things& things, const Position& position, ThreadPool& pool) {
    LargeVector<Item> items;
    items.reserve(things.size());
    for (const auto& thing : things) items.push_back({position(thing), uint32_t(items.size())});
    build(items, pool);
  }

  size_t size() const { return order_.size(); }
  // Points are known by their place in the tree; order()[k] is that among those given.
  const LargeVector<uint32_t>& order() const { return order_; }
  Vec3 point(uint32_t k) const { return {x_[k], y_[k], z_[k]}; }
  size_t memory_bytes() const { return nodes_.size() * sizeof(Node) + size() * (3 * sizeof(float) + sizeof(uint32_t)); }

  // Calls f(k, squared distance) for each point nearer than √radius_squared; f may make that smaller.
  template <class F>
  void within(Vec3 p, float& radius_squared, const F& f) const;

  struct Found {
    float distance_squared;
    uint32_t point;
  };
  // The nearest `count` points within √radius_squared, in any order, into `found`.
  void nearest(Vec3 p, size_t count, float radius_squared, std::vector<Found>& found) const {
    nearest(p, count, radius_squared, found, [](uint32_t) { return true; });
  }
  // Of those that accept(k).
  template <class Accept>
  void nearest(Vec3 p, size_t count, float radius_squared, std::vector<Found>& found, const Accept& accept) const;

 private:
  static constexpr size_t kLeaf = 16;
  struct Node {
    float split = 0;
    uint32_t axis = 0;
  };
  struct Range {
    size_t begin, end;
    size_t size() const { return end - begin; }
    bool is_leaf() const { return size() <= kLeaf; }
    Range low() const { return {begin, begin + size() / 2}; }
    Range high() const { return {begin + size() / 2, end}; }
  };
  struct Item {
    Vec3 point;
    uint32_t index;
  };
  void build(LargeVector<Item>& items, ThreadPool& pool);
  void build_below(LargeVector<Item>& items, size_t node, Range range);
  void split(LargeVector<Item>& items, size_t node, Range range);

  LargeVector<Node> nodes_;  // of node i the children are 2i + 1 and 2i + 2
  LargeVector<float> x_, y_, z_;
  LargeVector<uint32_t> order_;
};

template <class F>
void PointTree::within(Vec3 p, float& radius_squared, const F& f) const {
  struct Pending {
    size_t node;
    Range range;
    float distance_squared;  // at least
  };
  Pending stack[64];
  int depth = 0;
  stack[depth++] = {0, {0, size()}, 0.0f};
  while (depth > 0) {
    auto [node, range, least] = stack[--depth];
    if (least >= radius_squared) continue;
    while (!range.is_leaf()) {
      const float away = p[int(nodes_[node].axis)] - nodes_[node].split;
      const Pending low{2 * node + 1, range.low(), 0.0f}, high{2 * node + 2, range.high(), 0.0f};
      Pending far = away < 0.0f ? high : low;
      const Pending& near = away < 0.0f ? low : high;
      far.distance_squared = std::max(least, away * away);
      if (far.distance_squared < radius_squared) stack[depth++] = far;
      node = near.node, range = near.range;
    }
    float d2[kLeaf];
    const size_t n = range.size();
    const float *x = x_.data() + range.begin, *y = y_.data() + range.begin, *z = z_.data() + range.begin;
    for (size_t i = 0; i < n; ++i) d2[i] = sqr(x[i] - p.x) + sqr(y[i] - p.y) + sqr(z[i] - p.z);
    for (size_t i = 0; i < n; ++i)
      if (d2[i] < radius_squared) f(uint32_t(range.begin + i), d2[i]);
  }
}

template <class Accept>
void PointTree::nearest(Vec3 p, size_t count, float radius_squared, std::vector<Found>& found, const Accept& accept) const {
  // Twice as many as are wanted are collected before the farther half is dropped: cheaper than a heap.
  found.clear();
  if (count == 0) return;
  const auto nearer = [](const Found& a, const Found& b) {
    return a.distance_squared != b.distance_squared ? a.distance_squared < b.distance_squared : a.point < b.point;
  };
  const auto keep = [&] {
    std::nth_element(found.begin(), found.begin() + ptrdiff_t(count - 1), found.end(), nearer);
    found.resize(count);
  };
  within(p, radius_squared, [&](uint32_t k, float d2) {
    if (!accept(k)) return;
    found.push_back({d2, k});
    if (found.size() < 2 * count) return;
    keep();
    radius_squared = found.back().distance_squared;
  });
  if (found.size() > count) keep();
}

}  // namespace gi
