// Building the light tree by the surface area orientation heuristic, walking it down to sample and up for densities.
#include "lights/light_tree.h"

#include <numeric>

namespace gi {

namespace {

float sin_from(float c) { return safe_sqrt(1.0f - c * c); }
// cos and sin of max(0, a − b).
float cos_difference(float cos_a, float cos_b) { return cos_a > cos_b ? 1.0f : cos_a * cos_b + sin_from(cos_a) * sin_from(cos_b); }

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

// M_Ω: solid angle that the cluster shines into, weighed by the cosine beyond its normals. [Conty & Kulla 2018, eq. 1]
float orientation_measure(const LightBounds& b) {
  const float theta_o = std::acos(std::clamp(b.cos_normals, -1.0f, 1.0f));
  const float theta_w = std::min(theta_o + std::acos(std::clamp(b.cos_emission, -1.0f, 1.0f)), kPi);
  const float sin_o = std::sin(theta_o);
  const float m = 2.0f * kPi * (1.0f - b.cos_normals) +
                  0.5f * kPi * (2.0f * theta_w * sin_o - std::cos(theta_o - 2.0f * theta_w) - 2.0f * theta_o * sin_o + b.cos_normals);
  return b.two_sided ? 2.0f * m : m;
}

float split_cost(const LightBounds& b, float elongation) {
  if (!(b.power > 0.0f)) return 0.0f;
  const Vec3 e = b.hi - b.lo;
  return b.power * orientation_measure(b) * elongation * (2.0f * (e.x * e.y + e.y * e.z + e.z * e.x));
}

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

float light_importance(const LightBounds& b, const LightQuery& query) {
  const Vec3 to = query.position - (b.lo + b.hi) * 0.5f;
  const float d2 = length_squared(to), r2 = 0.25f * length_squared(b.hi - b.lo);
  const Vec3 w = d2 > 0.0f ? to * (1.0f / std::sqrt(d2)) : Vec3{0, 0, 1};  // from the lights to the point
  const float cos_bounds = d2 > r2 ? safe_sqrt(1.0f - r2 / d2) : -1.0f;

  // The least angle to a normal, over all the cluster's places and normals.
  float c = dot(w, b.axis);
  if (b.two_sided) c = std::abs(c);
  c = std::clamp(c, -1.0f, 1.0f);
  const float after_normals = cos_difference(c, b.cos_normals);
  const float least = cos_difference(after_normals, cos_bounds);
  if (least < b.cos_emission - 1e-4f) return 0.0f;
  // Emission beyond the cosine's reach (spheres, points) has cos_normals = −1, hence least = 1.
  float importance = b.power * std::max(least, 0.01f) / std::max(d2, std::max(r2, 1e-12f));

  // Receiver. Its lobes may have bumped normals, so nothing is ruled out.
  if (length_squared(query.normal) > 0.0f) {
    float cos_i = -dot(w, query.normal);
    if (query.transmission) cos_i = std::abs(cos_i);
    importance *= std::max(cos_difference(std::clamp(cos_i, -1.0f, 1.0f), cos_bounds), 0.02f);
  }
  return importance;
}

LightTree::LightTree(const std::vector<LightBounds>& lights) : order_(lights.size()), slot_of_(lights.size()), leaf_of_(lights.size()) {
  if (lights.empty()) return;
  std::iota(order_.begin(), order_.end(), 0u);
  nodes_.reserve(lights.size() / 2 + 2);
  nodes_.emplace_back();
  build(0, 0, uint32_t(lights.size()), lights);
  slots_.reserve(lights.size());
  for (uint32_t light : order_) slots_.push_back(lights[light]);
}

void LightTree::build(uint32_t root, uint32_t root_begin, uint32_t root_end, const std::vector<LightBounds>& lights) {
  struct Task {
    uint32_t node, begin, end;
  };
  std::vector<Task> tasks{{root, root_begin, root_end}};
  while (!tasks.empty()) {
    const auto [node, begin, end] = tasks.back();
    tasks.pop_back();
    LightBounds bounds;
    for (uint32_t i = begin; i < end; ++i) bounds = merge(bounds, lights[order_[i]]);
    nodes_[node].bounds = bounds;
    if (end - begin <= kLeafSize) {
      nodes_[node].first = begin, nodes_[node].count = end - begin;
      for (uint32_t i = begin; i < end; ++i) slot_of_[order_[i]] = i, leaf_of_[order_[i]] = node;
      continue;
    }
    const uint32_t middle = split(begin, end, bounds, lights), child = uint32_t(nodes_.size());
    nodes_[node].first = child;
    nodes_.emplace_back(), nodes_.emplace_back();
    nodes_[child].parent = nodes_[child + 1].parent = node;
    tasks.push_back({child, begin, middle});
    tasks.push_back({child + 1, middle, end});
  }
}

uint32_t LightTree::split(uint32_t begin, uint32_t end, const LightBounds& bounds, const std::vector<LightBounds>& lights) {
  constexpr int kBins = 12;
  Bounds centers;
  for (uint32_t i = begin; i < end; ++i) centers.add(lights[order_[i]].box().center());
  const Vec3 extent = centers.extent(), box = bounds.hi - bounds.lo;
  const float longest = std::max({box.x, box.y, box.z});
  float best = kInf;
  int best_axis = -1, best_bin = 0;
  const auto bin_of = [&](uint32_t light, int axis) {
    const float x = (lights[light].box().center()[axis] - centers.lo[axis]) / extent[axis];
    return std::clamp(int(x * kBins), 0, kBins - 1);
  };
  for (int axis = 0; axis < 3; ++axis) {
    if (!(extent[axis] > 0.0f)) continue;
    LightBounds bins[kBins];
    for (uint32_t i = begin; i < end; ++i) {
      LightBounds& bin = bins[bin_of(order_[i], axis)];
      bin = merge(bin, lights[order_[i]]);
    }
    LightBounds above[kBins];
    for (int b = kBins - 1; b > 0; --b) above[b - 1] = merge(b < kBins - 1 ? above[b] : LightBounds{}, bins[b]);
    LightBounds below;
    const float elongation = longest / std::max(box[axis], 1e-20f);
    for (int b = 0; b < kBins - 1; ++b) {
      below = merge(below, bins[b]);
      if (!(below.power > 0.0f) || !(above[b].power > 0.0f)) continue;
      const float cost = split_cost(below, elongation) + split_cost(above[b], elongation);
      if (cost < best) best = cost, best_axis = axis, best_bin = b;
    }
  }
  const auto first = order_.begin() + begin, last = order_.begin() + end;
  auto middle = first;
  if (best_axis >= 0) middle = std::partition(first, last, [&](uint32_t light) { return bin_of(light, best_axis) <= best_bin; });
  // All in one place (or numbers too wild for the heuristic): halves.
  if (middle == first || middle == last) middle = first + (last - first) / 2;
  return uint32_t(middle - order_.begin());
}

std::optional<LightTree::Pick> LightTree::sample(const LightQuery& query, float u) const {
  if (empty()) return std::nullopt;
  float probability = 1.0f;
  const Node* node = &nodes_[0];
  while (node->count == 0) {
    const Node* child = &nodes_[node->first];
    const float left = light_importance(child[0].bounds, query), right = light_importance(child[1].bounds, query);
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
    const float mine = light_importance(nodes_[index].bounds, query), other = light_importance(nodes_[sibling].bounds, query);
    if (!(mine > 0.0f)) return 0.0f;
    p *= mine / (mine + other);
    index = nodes_[index].parent;
  }
  return p;
}

}  // namespace gi
