// Picks one of many local lights by bounds on what each cluster can send to a point: position, power and orientation.
// [Conty Estevez & Kulla 2018, "Importance sampling of many lights with adaptive tree splitting"]
// Suns and the world, which have no place, are chosen outside it.
#pragma once
#include <vector>

#include "lights/lights.h"

namespace gi {

// Where a light or cluster is, how strong it is and where it shines.
struct LightBounds {
  Vec3 lo{kInf, kInf, kInf}, hi{-kInf, -kInf, -kInf};
  Vec3 axis{0, 0, 1};
  float cos_normals = 1;   // half angle of the cone about `axis` that holds all normals
  float cos_emission = 0;  // of how far from its normal a light shines
  float power = 0;         // radiant intensity along the normal, summed
  bool two_sided = false;

  Bounds box() const { return {lo, hi}; }
};

LightBounds merge(const LightBounds& a, const LightBounds& b);
// An upper estimate of the irradiance from the bounds; 0 only if there can be none.
float light_importance(const LightBounds& bounds, const LightQuery& query);

class LightTree {
 public:
  struct Pick {
    uint32_t light;
    float probability;
  };

  LightTree() = default;
  explicit LightTree(const std::vector<LightBounds>& lights);

  bool empty() const { return nodes_.empty(); }
  float importance(const LightQuery& query) const { return empty() ? 0.0f : light_importance(nodes_[0].bounds, query); }
  std::optional<Pick> sample(const LightQuery& query, float u) const;
  float probability(const LightQuery& query, uint32_t light) const;
  size_t memory_bytes() const { return nodes_.size() * sizeof(Node) + slots_.size() * sizeof(LightBounds) + order_.size() * 12; }

 private:
  static constexpr uint32_t kLeafSize = 8;
  struct alignas(64) Node {
    LightBounds bounds;
    uint32_t first = 0;  // of the two children, or of the leaf's lights
    uint32_t count = 0;  // lights in the leaf; 0: inner node
    uint32_t parent = 0;
  };
  struct Item {
    LightBounds bounds;
    Vec3 center;
    uint32_t light;
  };
  void build(std::vector<Item>& items);
  static uint32_t split(std::span<Item> items);  // puts them in order; how many go left

  std::vector<Node> nodes_;           // siblings are neighbours
  std::vector<LightBounds> slots_;    // lights in the order of the leaves
  std::vector<uint32_t> order_;       // light of each slot
  std::vector<uint32_t> slot_of_, leaf_of_;  // of each light
};

}  // namespace gi
