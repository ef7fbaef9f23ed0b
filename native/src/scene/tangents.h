// Tangents of a UV map by corner, smooth across faces: the frame in which tangent-space normal maps are baked and read.
#pragma once
#include <vector>

#include "scene/scene_data.h"

namespace gi {

struct CornerTangent {
  Vec3 direction{1, 0, 0};  // of u, unit, object space
  float side = -1;          // v is along side · (n × direction)
};

// What tangents are made from, for 3 corners of each triangle.
struct TangentCorner {
  Vec3 position, normal;  // object space
  Vec2 uv;
};

// One for each corner, in the same order. Corners share a tangent where they share position, normal and UV and their triangles are
// connected by edges and turn the same way in the UV map: MikkTSpace. [Mikkelsen 2008, ch. 3]
std::vector<CornerTangent> corner_tangents(const std::vector<TangentCorner>& corners);

// The UV map that stands in where a mesh has none: a sphere's about the object's origin.
Vec2 spherical_uv(Vec3 position);

}  // namespace gi
