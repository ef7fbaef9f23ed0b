// Building the light tree by the surface area orientation heuristic, walking it down to sample and up for densities.
#include "lights/light_tree.h"

#include <algorithm>

namespace gi {

namespace {

struct Cone {
  Vec3 axis;
  float cos_angle;
};

Vec3 rotate(Vec3 v, Vec3 unit_axis, float angle) {
  const float c = std::cos(angle), s = std::sin(angle);
  return v * c + cross(unit_axis, v) * s + unit_axis * (dot(unit_axis, v) * (1.0f - c));
}

Cone merge_cones(Cone a, Cone b) {
  if (a.cos_angle < b.cos_angle) std::swap(a, b);  // b is the wider from here
  const float angle_a = std::acos(std::clamp(a.cos_angle, -1.0f, 1.0f)), angle_b = std::acos(std::clamp(b.cos_angle, -1.0f, 1.0f));
  const float between = std::atan2(length(cross(a.axis, b.axis)), dot(a.axis, b.axis));
  if (std::min(between + angle_a, kPi) <= angle_b) return b;
  const float angle = 0.5f * (angle_a + between + angle_b);
  const Vec3 turn = cross(b.axis, a.axis);
  if (angle >= kPi || length_squared(turn) < 1e-14f) return {b.axis, -1.0f};
  return {normalize(rotate(b.axis, normalize(turn), angle - angle_b)), std::cos(angle)};
}

// M_Ω: the solid angle into which a cone of normals shines, weighed by the cosine beyond it. [Conty & Kulla 2018, eq. 1]
float orientation_measure(float cos_o, float cos_e) {
  const float theta_o = std::acos(std::clamp(cos_o, -1.0f, 1.0f)), sin_o = std::sin(theta_o);
  const float theta_w = std::min(theta_o + std::acos(std::clamp(cos_e, -1.0f, 1.0f)), kPi);
  return 2.0f * kPi * (1.0f - cos_o) +
         0.5f * kPi * (2.0f * theta_w * sin_o - std::cos(theta_o - 2.0f * theta_w) - 2.0f * theta_o * sin_o + cos_o);
}

// What the split heuristic sums up. The cone of normals is judged by the length of their mean, far cheaper than its bound.
struct Bin {
  Bounds box;
  Vec3 normals;
  float power = 0, cos_emission = 1, cos_normals = 1;
  bool two_sided = false;
  uint32_t count = 0;

  void add(const LightBounds& b) {
    box.add(b.box());
    // Of a two-sided light either normal is as good.
    normals += b.two_sided && dot(normals, b.axis) < 0.0f ? -b.axis : b.axis;
    power += b.power, cos_emission = std::min(cos_emission, b.cos_emission), cos_normals = std::min(cos_normals, b.cos_normals);
    two_sided = two_sided || b.two_sided, ++count;
  }
  void add(const Bin& b) {
    if (b.count == 0) return;
    box.add(b.box);
    normals += b.two_sided && dot(normals, b.normals) < 0.0f ? -b.normals : b.normals;
    power += b.power, cos_emission = std::min(cos_emission, b.cos_emission), cos_normals = std::min(cos_normals, b.cos_normals);
    two_sided = two_sided || b.two_sided, count += b.count;
  }
  float cost() const {
    const float mean = std::min(length(normals) / float(count), 1.0f);
    const float spread = std::min(2.0f * mean - 1.0f, cos_normals);  // normals even over a cone of this cosine have this mean
    const Vec3 e = box.extent();
    const float area = 2.0f * (e.x * e.y + e.y * e.z + e.z * e.x);
    return power * area * orientation_measure(spread, cos_emission) * (two_sided ? 2.0f : 1.0f);
  }
};

}  // namespace

LightBounds merge(const LightBounds& a, const LightBounds& b) {
  if (!(a.power > 0.0f)) return b;
  if (!(b.power > 0.0f)) return a;
  LightBounds r;
  r.lo = min(a.lo, b.lo), r.hi = max(a.hi, b.hi);
  const bool flip = a.two_sided && b.two_sided && dot(a.axis, b.axis) < 0.0f;
  const Cone cone = merge_cones({a.axis, a.cos_normals}, {flip ? -b.axis : b.axis, b.cos_normals});
  r.axis = cone.axis, r.cos_normals = cone.cos_angle;
  r.cos_emission = std::min(a.cos_emission, b.cos_emission);
  r.power = a.power + b.power;
  r.two_sided = a.two_sided || b.two_sided;
  return r;
}

float light_importance(const LightCluster& b, const LightQuery& query) {
  const Vec3 to = query.position - b.center;
  const float d2 = length_squared(to);
  const bool has_normal = length_squared(query.normal) > 0.0f;
  if (!(d2 > b.radius2)) return b.power / std::max(b.radius2, 1e-12f);  // among the lights every angle is possible
  const float inverse2 = 1.0f / d2, inverse = std::sqrt(inverse2), sin2_bounds = b.radius2 * inverse2;
  const float sin_bounds = std::sqrt(sin2_bounds), cos_bounds = safe_sqrt(1.0f - sin2_bounds);
  float importance = b.power * inverse2;

  // The least angle to a normal, over all the cluster's places and normals: θ − θ_normals − θ_bounds.
  if (b.cos_normals > -1.0f) {
    float c = dot(to, b.axis) * inverse;
    if (b.two_sided) c = std::abs(c);
    if (c < b.cos_normals) {
      c = c * b.cos_normals + safe_sqrt(1.0f - c * c) * b.sin_normals;
      if (c < cos_bounds) {
        c = c * cos_bounds + safe_sqrt(1.0f - c * c) * sin_bounds;
        if (c < b.cos_emission - 1e-4f) return 0.0f;
        importance *= std::max(c, 0.01f);
      }
    }
  }

  // Receiver. Its lobes may have bumped normals, so nothing is ruled out.
  if (has_normal) {
    float c = -dot(to, query.normal) * inverse;
    if (query.transmission) c = std::abs(c);
    if (c < cos_bounds) importance *= std::max(c * cos_bounds + safe_sqrt(1.0f - c * c) * sin_bounds, 0.02f);
  }
  return importance;
}

LightTree::LightTree(const std::vector<LightBounds>& lights) : slot_of_(lights.size()), leaf_of_(lights.size()) {
  if (lights.empty()) return;
  std::vector<Item> items;
  items.reserve(lights.size());
  for (uint32_t i = 0; i < lights.size(); ++i) items.push_back({lights[i], lights[i].box().center(), i});
  nodes_.reserve(lights.size() / 2 + 2);
  nodes_.emplace_back();
  build(items);
  slots_.reserve(items.size()), order_.reserve(items.size());
  for (const Item& item : items) slots_.emplace_back(item.bounds), order_.push_back(item.light);
}

void LightTree::build(std::vector<Item>& items) {
  std::vector<LightBounds> bounds(1);  // of the nodes
  struct Task {
    uint32_t node, begin, end;
  };
  std::vector<Task> tasks{{0, 0, uint32_t(items.size())}};
  while (!tasks.empty()) {
    const auto [node, begin, end] = tasks.back();
    tasks.pop_back();
    if (end - begin <= kLeafSize) {
      nodes_[node].first = begin, nodes_[node].count = end - begin;
      for (uint32_t i = begin; i < end; ++i) {
        slot_of_[items[i].light] = i, leaf_of_[items[i].light] = node;
        bounds[node] = merge(bounds[node], items[i].bounds);
      }
      continue;
    }
    const uint32_t middle = split({items.data() + begin, end - begin}) + begin, child = uint32_t(nodes_.size());
    nodes_[node].first = child;
    nodes_.resize(nodes_.size() + 2), bounds.resize(nodes_.size());
    nodes_[child].parent = nodes_[child + 1].parent = node;
    tasks.push_back({child, begin, middle});
    tasks.push_back({child + 1, middle, end});
  }
  // Children come after their parents.
  for (size_t i = nodes_.size(); i-- > 0;) {
    Node& n = nodes_[i];
    if (n.count == 0) bounds[i] = merge(bounds[n.first], bounds[n.first + 1]);
    n.cluster = LightCluster(bounds[i]);
  }
}

uint32_t LightTree::split(std::span<Item> items) {
  constexpr int kBins = 12;
  Bounds centers, box;
  for (const Item& item : items) centers.add(item.center), box.add(item.bounds.box());
  const Vec3 extent = centers.extent(), size = box.extent();
  const Vec3 scale{extent.x > 0 ? kBins / extent.x : 0.0f, extent.y > 0 ? kBins / extent.y : 0.0f, extent.z > 0 ? kBins / extent.z : 0.0f};
  const auto bin_of = [&](const Item& item, int axis) {
    return std::clamp(int((item.center[axis] - centers.lo[axis]) * scale[axis]), 0, kBins - 1);
  };
  Bin bins[3][kBins];
  for (const Item& item : items) {
    for (int axis = 0; axis < 3; ++axis) bins[axis][bin_of(item, axis)].add(item.bounds);
  }

  const float longest = std::max({size.x, size.y, size.z});
  float best = kInf;
  int best_axis = -1, best_bin = 0;
  for (int axis = 0; axis < 3; ++axis) {
    if (!(extent[axis] > 0.0f)) continue;
    const float elongation = longest / std::max(size[axis], 1e-20f);
    float above[kBins];
    Bin sum;
    for (int b = kBins - 1; b > 0; --b) sum.add(bins[axis][b]), above[b - 1] = sum.count ? sum.cost() : -1.0f;
    sum = {};
    for (int b = 0; b < kBins - 1; ++b) {
      sum.add(bins[axis][b]);
      if (sum.count == 0 || above[b] < 0.0f) continue;
      const float cost = elongation * (sum.cost() + above[b]);
      if (cost < best) best = cost, best_axis = axis, best_bin = b;
    }
  }
  auto middle = items.begin();
  if (best_axis >= 0)
    middle = std::partition(items.begin(), items.end(), [&](const Item& item) { return bin_of(item, best_axis) <= best_bin; });
  // All in one place (or numbers too wild for the heuristic): halves.
  if (middle == items.begin() || middle == items.end()) middle = items.begin() + std::ptrdiff_t(items.size() / 2);
  return uint32_t(middle - items.begin());
}

std::optional<LightTree::Pick> LightTree::sample(const LightQuery& query, float u) const {
  if (empty()) return std::nullopt;
  float probability = 1.0f;
  const Node* node = &nodes_[0];
  while (node->count == 0) {
    const Node* child = &nodes_[node->first];
    const float left = light_importance(child[0].cluster, query), right = light_importance(child[1].cluster, query);
    if (!(left + right > 0.0f)) return std::nullopt;
    const float p = left / (left + right);
    const bool go_left = u < p;
    probability *= go_left ? p : right / (left + right);
    u = go_left ? u / p : (u - p) / (1.0f - p);
    u = std::min(std::max(u, 0.0f), kOneMinusEpsilon);
    node = child + (go_left ? 0 : 1);
  }
  float weights[kLeafSize], sum = 0;
  for (uint32_t i = 0; i < node->count; ++i) sum += weights[i] = light_importance(slots_[node->first + i], query);
  if (!(sum > 0.0f)) return std::nullopt;
  float x = u * sum;
  uint32_t last = 0;
  for (uint32_t i = 0; i < node->count; ++i) {
    if (weights[i] == 0.0f) continue;
    last = i;
    if (x < weights[i]) break;
    x -= weights[i];
  }
  return Pick{order_[node->first + last], probability * weights[last] / sum};
}

float LightTree::probability(const LightQuery& query, uint32_t light) const {
  uint32_t index = leaf_of_[light];
  const Node& leaf = nodes_[index];
  float sum = 0;
  for (uint32_t i = 0; i < leaf.count; ++i) sum += light_importance(slots_[leaf.first + i], query);
  if (!(sum > 0.0f)) return 0.0f;
  float p = light_importance(slots_[slot_of_[light]], query) / sum;
  while (index != 0 && p > 0.0f) {
    const uint32_t sibling = index & 1u ? index + 1 : index - 1;
    const float mine = light_importance(nodes_[index].cluster, query), other = light_importance(nodes_[sibling].cluster, query);
    if (!(mine > 0.0f)) return 0.0f;
    p *= mine / (mine + other);
    index = nodes_[index].parent;
  }
  return p;
}

}  // namespace gi
