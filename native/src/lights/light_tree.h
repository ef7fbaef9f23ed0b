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

class LightTree {
 public:
  struct Pick {
    uint32_t light;
    float probability;
  };
  // Upper estimates of the irradiance from each of a node's children; 0 only if there can be none.
  struct Importance {
    float of[4] = {0, 0, 0, 0};
    float sum() const { return (of[0] + of[1]) + (of[2] + of[3]); }
  };

  LightTree() = default;
  explicit LightTree(const std::vector<LightBounds>& lights);

  bool empty() const { return nodes_.empty(); }
  // Of all there is: what `sample` and `probability` begin with.
  Importance root(const LightQuery& query) const { return empty() ? Importance() : importance(nodes_[0], query); }
  std::optional<Pick> sample(const LightQuery& query, const Importance& root, float u) const;
  float probability(const LightQuery& query, const Importance& root, uint32_t light) const;
  size_t memory_bytes() const { return nodes_.size() * sizeof(Node) + place_of_.size() * sizeof(Place); }

 private:
  static constexpr uint32_t kWidth = 4, kLightBit = 0x80000000u;
  // Four children side by side, so that their importances are worked out together.
  struct alignas(64) Node {
    float center_x[kWidth] = {}, center_y[kWidth] = {}, center_z[kWidth] = {}, radius2[kWidth] = {};
    float axis_x[kWidth] = {}, axis_y[kWidth] = {}, axis_z[kWidth] = {}, power[kWidth] = {};  // power 0: no child
    float cos_normals[kWidth] = {}, sin_normals[kWidth] = {}, cos_emission[kWidth] = {}, sides[kWidth] = {};
    uint32_t child[kWidth] = {};  // another node, or a light with kLightBit
    uint32_t parent = 0, slot = 0;
    void set(uint32_t k, const LightBounds& bounds);
  };
  struct Place {
    uint32_t node, slot;
  };
  struct Item {
    LightBounds bounds;
    Vec3 center;
    uint32_t light;
  };
  static Importance importance(const Node& node, const LightQuery& query);
  static uint32_t split(std::span<Item> items);  // puts them in order; how many go left

  std::vector<Node> nodes_;      // children after their parents
  std::vector<Place> place_of_;  // of each light
};

}  // namespace gi
