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

void LightTree::Node::set(uint32_t k, const LightBounds& b) {
  const Vec3 center = (b.lo + b.hi) * 0.5f;
  center_x[k] = center.x, center_y[k] = center.y, center_z[k] = center.z;
  radius2[k] = 0.25f * length_squared(b.hi - b.lo);
  axis_x[k] = b.axis.x, axis_y[k] = b.axis.y, axis_z[k] = b.axis.z, power[k] = b.power;
  cos_normals[k] = b.cos_normals, sin_normals[k] = safe_sqrt(1.0f - b.cos_normals * b.cos_normals), cos_emission[k] = b.cos_emission;
  sides[k] = b.two_sided ? 2.0f : 1.0f;
}

// Without branches, so that the compiler does four at a time.
LightTree::Importance LightTree::importance(const Node& n, const LightQuery& query) {
  const Vec3 p = query.position, m = query.normal;
  const float has_normal = length_squared(m) > 0.0f ? 1.0f : 0.0f, through = query.transmission ? 1.0f : 0.0f;
  Importance result;
  for (uint32_t k = 0; k < kWidth; ++k) {
    const float x = p.x - n.center_x[k], y = p.y - n.center_y[k], z = p.z - n.center_z[k];
    const float d2 = x * x + y * y + z * z, r2 = n.radius2[k];
    const float inverse2 = 1.0f / std::max(d2, 1e-30f), inverse = std::sqrt(inverse2), sin2 = std::min(r2 * inverse2, 1.0f);
    const float sin_bounds = std::sqrt(sin2), cos_bounds = std::sqrt(1.0f - sin2);

    // The least angle to a normal, over all the cluster's places and normals: θ − θ_normals − θ_bounds.
    const float c = (x * n.axis_x[k] + y * n.axis_y[k] + z * n.axis_z[k]) * inverse, facing = n.sides[k] > 1.0f ? std::abs(c) : c;
    const float past_normals = facing * n.cos_normals[k] + std::sqrt(std::max(1.0f - facing * facing, 0.0f)) * n.sin_normals[k];
    const float c1 = facing < n.cos_normals[k] ? past_normals : 1.0f;
    const float past_bounds = c1 * cos_bounds + std::sqrt(std::max(1.0f - c1 * c1, 0.0f)) * sin_bounds;
    const float c2 = c1 < cos_bounds ? past_bounds : 1.0f;
    const float emitter = c2 < n.cos_emission[k] - 1e-4f ? 0.0f : std::max(c2, 0.01f);

    // Receiver. Its lobes may have bumped normals, so nothing is ruled out.
    const float cr = -(x * m.x + y * m.y + z * m.z) * inverse, seen = through > 0.0f ? std::abs(cr) : cr;
    const float within = std::max(seen * cos_bounds + std::sqrt(std::max(1.0f - seen * seen, 0.0f)) * sin_bounds, 0.02f);
    const float receiver = has_normal > 0.0f && seen < cos_bounds ? within : 1.0f;

    // Among the lights every angle is possible.
    const float outside = inverse2 * emitter * receiver, inside = 1.0f / std::max(r2, 1e-12f);
    result.of[k] = n.power[k] * (d2 > r2 ? outside : inside);
  }
  return result;
}

// Top down: every node halves the costliest of its parts until it has four; bounds then come from below.
LightTree::LightTree(const std::vector<LightBounds>& lights) : place_of_(lights.size()) {
  if (lights.empty()) return;
  std::vector<Item> items;
  items.reserve(lights.size());
  for (uint32_t i = 0; i < lights.size(); ++i) items.push_back({lights[i], lights[i].box().center(), i});

  struct Part {
    uint32_t begin, end;
    float cost;
  };
  const auto part = [&](uint32_t begin, uint32_t end) {
    Bin sum;
    for (uint32_t i = begin; i < end; ++i) sum.add(items[i].bounds);
    return Part{begin, end, end - begin > 1 ? std::max(sum.cost(), 0.0f) : -1.0f};
  };
  struct Task {
    uint32_t node, begin, end;
  };
  std::vector<LightBounds> bounds(kWidth);  // of the nodes' children
  nodes_.emplace_back();
  std::vector<Task> tasks{{0, 0, uint32_t(items.size())}};
  while (!tasks.empty()) {
    const auto [node, begin, end] = tasks.back();
    tasks.pop_back();
    std::vector<Part> parts{part(begin, end)};
    while (parts.size() < kWidth) {
      Part& widest = *std::max_element(parts.begin(), parts.end(), [](const Part& a, const Part& b) { return a.cost < b.cost; });
      if (widest.end - widest.begin < 2) break;
      const Part whole = widest;
      const uint32_t middle = whole.begin + split({items.data() + whole.begin, whole.end - whole.begin});
      widest = part(whole.begin, middle);
      parts.push_back(part(middle, whole.end));
    }
    for (uint32_t slot = 0; slot < parts.size(); ++slot) {
      const Part& p = parts[slot];
      if (p.end - p.begin == 1) {
        const Item& item = items[p.begin];
        nodes_[node].child[slot] = item.light | kLightBit;
        place_of_[item.light] = {node, slot};
        bounds[kWidth * node + slot] = item.bounds;
        continue;
      }
      const uint32_t child = uint32_t(nodes_.size());
      nodes_.emplace_back(), bounds.resize(kWidth * nodes_.size());
      nodes_[node].child[slot] = child, nodes_[child].parent = node, nodes_[child].slot = slot;
      tasks.push_back({child, p.begin, p.end});
    }
  }
  for (size_t i = nodes_.size(); i-- > 0;) {
    LightBounds all;
    for (uint32_t k = 0; k < kWidth; ++k) {
      const LightBounds& b = bounds[kWidth * i + k];
      if (b.power > 0.0f) nodes_[i].set(k, b), all = merge(all, b);
    }
    if (i > 0) bounds[kWidth * nodes_[i].parent + nodes_[i].slot] = all;
  }
}

uint32_t LightTree::split(std::span<Item> items) {
  constexpr int kBins = 12;
  constexpr size_t kFew = 8;  // too few for the heuristic to be worth its time
  Bounds centers, box;
  for (const Item& item : items) centers.add(item.center), box.add(item.bounds.box());
  const Vec3 extent = centers.extent(), size = box.extent();
  const Vec3 scale{extent.x > 0 ? kBins / extent.x : 0.0f, extent.y > 0 ? kBins / extent.y : 0.0f, extent.z > 0 ? kBins / extent.z : 0.0f};
  const auto bin_of = [&](const Item& item, int axis) {
    return std::clamp(int((item.center[axis] - centers.lo[axis]) * scale[axis]), 0, kBins - 1);
  };
  if (items.size() <= kFew) {
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    const auto middle = items.begin() + std::ptrdiff_t(items.size() / 2);
    std::nth_element(items.begin(), middle, items.end(), [axis](const Item& a, const Item& b) { return a.center[axis] < b.center[axis]; });
    return uint32_t(items.size() / 2);
  }
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

std::optional<LightTree::Pick> LightTree::sample(const LightQuery& query, const Importance& root, float u) const {
  if (empty()) return std::nullopt;
  float probability = 1.0f;
  Importance weights = root;
  for (uint32_t node = 0;;) {
    const float sum = weights.sum();
    if (!(sum > 0.0f)) return std::nullopt;
    float x = u * sum;
    uint32_t chosen = kWidth;
    for (uint32_t k = 0; k < kWidth; ++k) {
      if (weights.of[k] == 0.0f) continue;
      if (chosen < kWidth) x -= weights.of[chosen];
      chosen = k;
      if (x < weights.of[k]) break;
    }
    const float weight = weights.of[chosen];
    probability *= weight / sum;
    u = std::min(std::max(x / weight, 0.0f), kOneMinusEpsilon);
    node = nodes_[node].child[chosen];
    if (node & kLightBit) return Pick{node & ~kLightBit, probability};
    weights = importance(nodes_[node], query);
  }
}

float LightTree::probability(const LightQuery& query, const Importance& root, uint32_t light) const {
  auto [node, slot] = place_of_[light];
  float p = 1.0f;
  while (true) {
    const Importance weights = node == 0 ? root : importance(nodes_[node], query);
    const float mine = weights.of[slot];
    if (!(mine > 0.0f)) return 0.0f;
    p *= mine / weights.sum();
    if (node == 0) return p;
    slot = nodes_[node].slot, node = nodes_[node].parent;
  }
}

}  // namespace gi
