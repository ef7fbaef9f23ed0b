// A parametrisation of a surface without seams: every triangle carries a lattice of 4^level small triangles, and lattice points
// on the edges and corners that smooth neighbours share are one node. Hat functions about the nodes add up to 1 everywhere.
// Leaves out what the nodes hold (texels.h).
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "scene/scene.h"

namespace gi {

// The nodes whose hats cover a point, and how much of it each has. Nodes may be named twice.
struct LatticePoint {
  static constexpr int kMost = 6;
  int count = 0;
  uint32_t node[kMost];
  float weight[kMost];
  void add(uint32_t n, float w) {
    if (w > 0.0f) node[count] = n, weight[count++] = w;
  }
};

// The small triangle that holds a point: its lattice points (towards the 2nd and 3rd corner, of 2^level), and their hats there.
struct LatticeCell {
  uint32_t triangle = 0;
  int size = 1;  // 2^level
  std::array<std::array<int, 2>, 3> at;
  float weight[3];
  uint32_t index = 0;  // of the small triangle within the whole lattice
};

class TexelLattice {
 public:
  // For the places of `instance`'s mesh, as large as this instance is. `size`: the wished edge of a small triangle, in metres; those
  // of long thin triangles are long, for their area is what is kept.
  TexelLattice(const Scene& scene, uint32_t instance, double size);

  // How many nodes there would be, without the merging of triangles much smaller than `size`.
  static double estimate_nodes(const Scene& scene, uint32_t instance, double size);

  uint32_t node_count() const { return uint32_t(area_.size()); }
  uint32_t triangle_count() const { return uint32_t(triangles_.size()); }
  uint32_t cell_count() const { return cells_; }
  // ∫ of the node's hat over the surface, m².
  const std::vector<float>& area() const { return area_; }
  size_t memory_bytes() const;

  LatticeCell locate(uint32_t triangle, float b1, float b2) const;
  // Whether the triangle is so small that it has no nodes of its own.
  bool is_merged(uint32_t triangle) const {
    const Triangle& t = triangles_[triangle];
    return t.level == 0 && (t.corner[0] & t.corner[1] & t.corner[2] & kMerged);
  }
  int level(uint32_t triangle) const { return triangles_[triangle].level; }  // log2 of the small triangles along an edge
  bool continues(uint32_t triangle, int edge) const { return triangles_[triangle].continues >> edge & 1; }  // of 01, 12, 20
  // The k-th small triangle of a triangle, with the weights of its middle.
  LatticeCell cell(uint32_t triangle, uint32_t k) const;
  // The node, or nodes, that a corner of the cell belongs to, times `weight`. `choice`: a number in [0, 1) that picks one of the
  // many that a merged vertex belongs to; each in proportion to its share.
  void add_nodes(const LatticeCell& cell, int corner, float weight, float choice, LatticePoint& out) const;
  // As above with every node: calls f(node, weight).
  template <class F>
  void for_each_node(const LatticeCell& cell, int corner, float weight, const F& f) const {
    Corner c[2];
    const int n = resolve(cell.triangle, cell.at[size_t(corner)][0], cell.at[size_t(corner)][1], cell.size, c);
    for (int k = 0; k < n; ++k) spread(c[k].id, weight * c[k].weight, f);
  }

 private:
  struct Triangle {
    uint32_t corner[3];      // node, or kMerged + row
    uint32_t edge[3];        // first node of the edges 01, 12, 20
    uint32_t interior;       // first node inside
    uint32_t cell;           // first small triangle
    uint8_t level;           // log2 of the small triangles along an edge
    uint8_t edge_level[3];   // never more: the coarser neighbour's
    bool reversed[3];        // the edge's nodes are counted from its other end
    uint8_t continues;       // bit of each edge beyond which the same surface lies in the same plane, about
  };
  struct Corner {
    uint32_t id;
    float weight;
  };
  static constexpr uint32_t kMerged = 0x80000000u;
  struct Share {
    uint32_t node;
    float weight;
  };

  struct Builder;
  // What lattice point (i, j) of the triangle belongs to: one node, or two where the neighbour is coarser.
  int resolve(uint32_t triangle, int i, int j, int n, Corner out[2]) const;
  template <class F>
  void spread(uint32_t id, float weight, const F& f) const {
    if (!(id & kMerged)) return f(id, weight);
    const uint32_t row = id & ~kMerged;
    for (uint32_t k = row_[row]; k < row_[row + 1]; ++k) f(share_[k].node, weight * share_[k].weight);
  }

  std::vector<Triangle> triangles_;
  std::vector<float> area_;
  std::vector<uint32_t> row_;  // of merged vertices: where their shares begin
  std::vector<Share> share_;
  uint32_t cells_ = 0;
};

}  // namespace gi
