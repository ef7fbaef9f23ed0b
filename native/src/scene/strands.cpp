// Strands: which vertices make which segment, and where it is.
#include "scene/strands.h"

#include <algorithm>

namespace gi {

Strands::Strands(const MeshData& mesh) : primitive_(mesh.primitive) {
  const size_t ends = is_spline() ? 1 : 0;  // doubled at either end
  vertices_.reserve(4 * (mesh.vertex_count() + 2 * ends * mesh.strand_count()));
  const auto add_vertex = [&](size_t v) {
    const float* p = mesh.positions.data + 3 * v;
    vertices_.insert(vertices_.end(), {p[0], p[1], p[2], mesh.radius[v]});
    largest_radius_ = std::max(largest_radius_, mesh.radius[v]);
  };
  if (are_points()) {
    for (size_t v = 0; v < mesh.vertex_count(); ++v) add_vertex(v);
    return;
  }
  for (size_t s = 0; s < mesh.strand_count(); ++s) {
    const size_t from = size_t(mesh.first_vertex[s]), to = size_t(mesh.first_vertex[s + 1]);
    const uint32_t first = uint32_t(vertices_.size() / 4);
    for (size_t k = 0; k < ends && to > from; ++k) add_vertex(from);
    for (size_t v = from; v < to; ++v) add_vertex(v);
    for (size_t k = 0; k < ends && to > from; ++k) add_vertex(to - 1);
    for (size_t v = from; v + 1 < to; ++v) {
      segments_.push_back(first + uint32_t(v - from));
      strands_.push_back(uint32_t(s)), begins_.push_back(uint32_t(v));
    }
  }
}

Vec3 Strands::center(uint32_t segment, float u) const {
  if (are_points()) return {vertices_[4 * size_t(segment)], vertices_[4 * size_t(segment) + 1], vertices_[4 * size_t(segment) + 2]};
  if (!is_spline()) return lerp(place(segment, 0), place(segment, 1), u);
  const float v = 1.0f - u;
  return 0.5f * (place(segment, 0) * (-u * v * v) + place(segment, 1) * (2.0f + u * u * (3.0f * u - 5.0f)) +
                 place(segment, 2) * (2.0f + v * v * (3.0f * v - 5.0f)) + place(segment, 3) * (-v * u * u));
}

Vec3 Strands::derivative(uint32_t segment, float u) const {
  if (are_points()) return {};
  if (!is_spline()) return place(segment, 1) - place(segment, 0);
  const float v = 1.0f - u;
  return 0.5f * (place(segment, 0) * (v * (2.0f * u - v)) + place(segment, 1) * (u * (9.0f * u - 10.0f)) +
                 place(segment, 2) * (-v * (9.0f * v - 10.0f)) + place(segment, 3) * (u * (u - 2.0f * v)));
}

float Strands::radius(uint32_t segment, float u) const {
  if (are_points()) return vertices_[4 * size_t(segment) + 3];
  const uint32_t k = is_spline() ? 1 : 0;
  return lerp(vertex(segment, k)[3], vertex(segment, k + 1)[3], u);
}

}  // namespace gi
