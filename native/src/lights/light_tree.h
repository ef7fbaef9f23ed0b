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

// The same, as the choice wants it.
struct LightCluster {
  Vec3 center;
  float radius2 = 0;
  Vec3 axis{0, 0, 1};
  float power = 0;
  float cos_normals = 1, sin_normals = 0, cos_emission = 0;
  bool two_sided = false;

  LightCluster() = default;
  explicit LightCluster(const LightBounds& b)
      : center((b.lo + b.hi) * 0.5f),
        radius2(0.25f * length_squared(b.hi - b.lo)),
        axis(b.axis),
        power(b.power),
        cos_normals(b.cos_normals),
        sin_normals(safe_sqrt(1.0f - b.cos_normals * b.cos_normals)),
        cos_emission(b.cos_emission),
        two_sided(b.two_sided) {}
};
// An upper estimate of the irradiance from the cluster; 0 only if there can be none.
float light_importance(const LightCluster& cluster, const LightQuery& query);

class LightTree {
 public:
  struct Pick {
    uint32_t light;
    float probability;
  };

  LightTree() = default;
  explicit LightTree(const std::vector<LightBounds>& lights);

  bool empty() const { return nodes_.empty(); }
  float importance(const LightQuery& query) const { return empty() ? 0.0f : light_importance(nodes_[0].cluster, query); }
  std::optional<Pick> sample(const LightQuery& query, float u) const;
  float probability(const LightQuery& query, uint32_t light) const;
  size_t memory_bytes() const { return nodes_.size() * sizeof(Node) + slots_.size() * sizeof(LightCluster) + order_.size() * 12; }

 private:
  static constexpr uint32_t kLeafSize = 8;
  struct alignas(64) Node {
    LightCluster cluster;
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
  std::vector<LightCluster> slots_;   // lights in the order of the leaves
  std::vector<uint32_t> order_;       // light of each slot
  std::vector<uint32_t> slot_of_, leaf_of_;  // of each light
};

}  // namespace gi
