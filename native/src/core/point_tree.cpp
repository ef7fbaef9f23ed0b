// Building: each node parts its points at the median of their longest axis.
#include "core/point_tree.h"

#include <algorithm>
#include <atomic>
#include <bit>

namespace gi {
namespace {

// Orders items along an axis; those at equal places by their index, so that no two are equal.
template <int kAxis, class Item>
uint64_t key(const Item& item) {
  const uint32_t bits = std::bit_cast<uint32_t>(item.point[kAxis]);
  const uint32_t ordered = bits ^ (bits >> 31 ? 0xffffffffu : 0x80000000u);
  return uint64_t(ordered) << 32 | item.index;
}

// As std::nth_element. Pivots are those of a sample that should lie where `middle` does [Floyd & Rivest 1975, "Expected time bounds for
// selection"], and items change sides without a branch, which would be guessed wrong every other time.
template <int kAxis, class Item>
void select(Item* first, Item* middle, Item* last) {
  constexpr size_t kSample = 16, kFew = 64;
  constexpr int kTries = 16;
  for (int i = 0; i < kTries && size_t(last - first) > kFew; ++i) {
    const size_t n = size_t(last - first), rank = std::max<size_t>(size_t(middle - first) * kSample / n, 1);
    uint64_t sample[kSample];
    for (size_t k = 0; k < kSample; ++k) sample[k] = key<kAxis>(first[(2 * k + 1) * n / (2 * kSample)]);
    std::nth_element(sample, sample + rank, sample + kSample);
    const uint64_t pivot = sample[rank];
    Item* border = first;
    for (Item* item = first; item < last; ++item) {
      const Item moved = *item;
      *item = *border, *border = moved;
      border += key<kAxis>(moved) < pivot;
    }
    (middle < border ? last : first) = border;
  }
  std::nth_element(first, middle, last, [](const Item& a, const Item& b) { return key<kAxis>(a) < key<kAxis>(b); });
}

}  // namespace

void PointTree::build(LargeVector<Item>& items, ThreadPool& pool) {
  const size_t n = items.size();
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
  pool.for_each(int(level.size()), never, [&](int i) { build_below(items, first + size_t(i), level[size_t(i)]); });

  x_.resize(n), y_.resize(n), z_.resize(n), order_.resize(n);
  for (size_t i = 0; i < n; ++i) x_[i] = items[i].point.x, y_[i] = items[i].point.y, z_[i] = items[i].point.z, order_[i] = items[i].index;
}

void PointTree::split(LargeVector<Item>& items, size_t node, Range range) {
  Vec3 low = items[range.begin].point, high = low;
  for (size_t i = range.begin; i < range.end; ++i) low = min(low, items[i].point), high = max(high, items[i].point);
  const Vec3 extent = high - low;
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  Item *all = items.data(), *middle = all + range.high().begin;
  constexpr decltype(&select<0, Item>) kSelect[] = {select<0, Item>, select<1, Item>, select<2, Item>};
  kSelect[axis](all + range.begin, middle, all + range.end);
  nodes_[node] = {middle->point[axis], uint32_t(axis)};
}

void PointTree::build_below(LargeVector<Item>& items, size_t node, Range range) {
  if (range.is_leaf()) return;
  split(items, node, range);
  build_below(items, 2 * node + 1, range.low());
  build_below(items, 2 * node + 2, range.high());
}

}  // namespace gi
