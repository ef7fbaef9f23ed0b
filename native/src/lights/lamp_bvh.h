// Which lamps' bounds a ray meets: all of them one by one where they are few, a small BVH where they are many.
#pragma once
#include <algorithm>
#include <vector>

#include "core/vec.h"

namespace gi {

class LampBvh {
 public:
  struct Item {
    Bounds box;
    uint32_t lamp;
  };

  LampBvh() = default;
  explicit LampBvh(std::vector<Item> items) : items_(std::move(items)) {
    if (items_.empty()) return;
    nodes_.emplace_back();
    build(0, 0, uint32_t(items_.size()));
  }

  bool empty() const { return nodes_.empty(); }
  // Calls f(lamp) for every lamp whose bounds the ray's line touches within its range.
  template <class F>
  void visit(const Ray& ray, const F& f) const {
    if (nodes_.empty()) return;
    const Vec3 inverse{1.0f / ray.direction.x, 1.0f / ray.direction.y, 1.0f / ray.direction.z};
    uint32_t stack[64], size = 0;
    stack[size++] = 0;
    while (size > 0) {
      const Node& node = nodes_[stack[--size]];
      if (!touches(node.box, ray, inverse)) continue;
      if (node.count == 0) {
        stack[size++] = node.first, stack[size++] = node.first + 1;
        continue;
      }
      for (uint32_t i = 0; i < node.count; ++i) f(items_[node.first + i].lamp);
    }
  }

 private:
  static constexpr uint32_t kLeafSize = 4;
  struct Node {
    Bounds box;
    uint32_t first = 0, count = 0;  // count 0: inner node, children first and first + 1
  };

  // Halves at the median of the longest axis: its depth is the logarithm, so the stack above is enough.
  void build(uint32_t node, uint32_t begin, uint32_t end) {
    Bounds box, centers;
    for (uint32_t i = begin; i < end; ++i) box.add(items_[i].box), centers.add(items_[i].box.center());
    // Flat lamps: room for rounding.
    const Vec3 e = box.extent();
    const float pad = 1e-5f * (std::max({e.x, e.y, e.z}) + std::max({std::abs(box.lo.x), std::abs(box.lo.y), std::abs(box.lo.z),
                                                                     std::abs(box.hi.x), std::abs(box.hi.y), std::abs(box.hi.z)}));
    box.lo = box.lo - Vec3{pad, pad, pad}, box.hi = box.hi + Vec3{pad, pad, pad};
    nodes_[node].box = box;
    if (end - begin <= kLeafSize) {
      nodes_[node].first = begin, nodes_[node].count = end - begin;
      return;
    }
    const Vec3 c = centers.extent();
    const int axis = c.x >= c.y && c.x >= c.z ? 0 : c.y >= c.z ? 1 : 2;
    const uint32_t middle = (begin + end) / 2;
    std::nth_element(items_.begin() + begin, items_.begin() + middle, items_.begin() + end,
                     [axis](const Item& a, const Item& b) { return a.box.center()[axis] < b.box.center()[axis]; });
    const uint32_t child = uint32_t(nodes_.size());
    nodes_.resize(nodes_.size() + 2);
    nodes_[node].first = child;
    build(child, begin, middle);
    build(child + 1, middle, end);
  }

  static bool touches(const Bounds& b, const Ray& ray, Vec3 inverse) {
    float t0 = ray.t_min, t1 = ray.t_max;
    for (int i = 0; i < 3; ++i) {
      // NaN (0 · ∞) fails both comparisons and leaves the range as it is.
      const float a = (b.lo[i] - ray.origin[i]) * inverse[i], c = (b.hi[i] - ray.origin[i]) * inverse[i];
      const float near = a < c ? a : c, far = a < c ? c : a;
      if (near > t0) t0 = near;
      if (far < t1) t1 = far;
    }
    return t0 <= t1 * 1.000001f;
  }

  std::vector<Item> items_;
  std::vector<Node> nodes_;
};

}  // namespace gi
