// Building: each node parts its points at the median of their longest axis.
#include "core/point_tree.h"

#include <atomic>

namespace gi {

PointTree::PointTree(const std::vector<Vec3>& points, ThreadPool& pool) {
  const size_t n = points.size();
  std::vector<Item> items(n);
  for (size_t i = 0; i < n; ++i) items[i] = {points[i], uint32_t(i)};
  size_t nodes = 0;  // levels are full but for the last
  for (size_t level = 1, largest = n; largest > kLeaf; largest -= largest / 2, level *= 2) nodes += level;
  nodes_.resize(nodes);

  // The first levels a node at a time, then whole subtrees.
  constexpr int kTogether = 6;
  const std::atomic<bool> never{false};
  std::vector<Range> level{{0, n}};
  for (int depth = 0; depth < kTogether && n > kLeaf; ++depth) {
    const size_t first = (size_t(1) << depth) - 1;
    pool.for_each(int(level.size()), never, [&](int i) {
      if (!level[size_t(i)].is_leaf()) split(items, first + size_t(i), level[size_t(i)]);
    });
    std::vector<Range> next;
    for (const Range& r : level) next.push_back(r.is_leaf() ? Range{0, 0} : r.low()), next.push_back(r.is_leaf() ? Range{0, 0} : r.high());
    level = std::move(next);
  }
  const size_t first = level.size() - 1;
  pool.for_each(int(level.size()), never, [&](int i) { build(items, first + size_t(i), level[size_t(i)]); });

  x_.resize(n), y_.resize(n), z_.resize(n), order_.resize(n);
  for (size_t i = 0; i < n; ++i) x_[i] = items[i].point.x, y_[i] = items[i].point.y, z_[i] = items[i].point.z, order_[i] = items[i].index;
}

void PointTree::split(std::vector<Item>& items, size_t node, Range range) {
  Vec3 low = items[range.begin].point, high = low;
  for (size_t i = range.begin; i < range.end; ++i) low = min(low, items[i].point), high = max(high, items[i].point);
  const Vec3 extent = high - low;
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  const auto middle = items.begin() + ptrdiff_t(range.high().begin);
  std::nth_element(
      items.begin() + ptrdiff_t(range.begin), middle, items.begin() + ptrdiff_t(range.end),
      [axis](const Item& a, const Item& b) { return a.point[axis] != b.point[axis] ? a.point[axis] < b.point[axis] : a.index < b.index; });
  nodes_[node] = {middle->point[axis], uint32_t(axis)};
}

void PointTree::build(std::vector<Item>& items, size_t node, Range range) {
  if (range.is_leaf()) return;
  split(items, node, range);
  build(items, 2 * node + 1, range.low());
  build(items, 2 * node + 2, range.high());
}

}  // namespace gi
