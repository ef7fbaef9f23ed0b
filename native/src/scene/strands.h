// Curves and points, ready for tracing. Curves are splines through their vertices, the ends doubled [Catmull & Rom 1974], or straight
// between them; radii go the same way. Segments are counted through all curves.
#pragma once
#include <span>
#include <vector>

#include "scene/scene_data.h"

namespace gi {

class Strands {
 public:
  explicit Strands(const MeshData& mesh);

  Primitive primitive() const { return primitive_; }
  bool is_ribbon() const { return primitive_ == Primitive::kRibbon; }
  bool are_points() const { return primitive_ == Primitive::kSphere; }
  size_t count() const { return are_points() ? vertices_.size() / 4 : segments_.size(); }  // segments, or points

  // As Embree wants them: x, y, z, radius of each vertex; the first vertex of each segment.
  std::span<const float> vertices() const { return vertices_; }
  std::span<const uint32_t> segments() const { return segments_; }
  std::span<const uint32_t> strand_of_segments() const { return strands_; }

  uint32_t strand(uint32_t segment) const { return are_points() ? segment : strands_[segment]; }
  // Which of the mesh's vertices a segment begins at.
  uint32_t first_vertex(uint32_t segment) const { return are_points() ? segment : begins_[segment]; }
  // Object space; `u` from 0 to 1.
  Vec3 center(uint32_t segment, float u) const;
  Vec3 derivative(uint32_t segment, float u) const;  // of the centre, by u; of points zero
  float radius(uint32_t segment, float u) const;     // between the vertices', as the nodes that ask for it have it
  float largest_radius() const { return largest_radius_; }  // of the vertices
  size_t memory_bytes() const { return vertices_.size() * 4 + segments_.size() * 12; }

 private:
  bool is_spline() const { return primitive_ == Primitive::kRibbon || primitive_ == Primitive::kThick; }
  const float* vertex(uint32_t segment, uint32_t k) const { return vertices_.data() + 4 * size_t(segments_[segment] + k); }
  Vec3 place(uint32_t segment, uint32_t k) const {
    const float* v = vertex(segment, k);
    return {v[0], v[1], v[2]};
  }

  Primitive primitive_;
  float largest_radius_ = 0;
  std::vector<float> vertices_;
  std::vector<uint32_t> segments_, strands_, begins_;
};

}  // namespace gi
