// Scene: points of curves and of point clouds.
#include "scene/scene.h"

namespace gi {
namespace {

// The wall of a tube is seen from within where it begins, for it is open there.
void turn_to_view(ShadingPoint& p) {
  p.backfacing = dot(p.ng, p.wo) < 0.0f;
  if (p.backfacing) p.ng = -p.ng, p.ns = -p.ns;
}

}  // namespace

ShadingPoint Scene::strand_point(const Hit& hit, Vec3 position, Vec3 wo, const PathState& path, float footprint) const {
  const Instance& placed = instances_[hit.instance];
  const Strands& strands = *strands_[placed.mesh];
  ShadingPoint p;
  p.position = position, p.object_position = placed.to_object.point(position);
  p.wo = wo;
  p.instance = hit.instance, p.mesh = placed.mesh, p.triangle = hit.triangle, p.strand = strands.strand(hit.triangle);
  p.b1 = strands.are_points() ? 0.0f : hit.b1, p.b2 = strands.is_ribbon() ? hit.b2 : 0.0f;
  p.footprint = footprint;
  p.path = path;
  set_strand_normals(p);
  turn_to_view(p);
  return p;
}

// Tubes and spheres have the normal from their middle, made where they are round. A ribbon, which lies across the view, is shaded as the
// front of a tube; its geometric normal is the view itself.
void Scene::set_strand_normals(ShadingPoint& p) const {
  const Instance& placed = instances_[p.instance];
  const Strands& strands = *strands_[p.mesh];
  const auto normal_to_world = [&](Vec3 n) { return normalize_or(placed.to_object.transposed_vector(n), p.wo); };
  if (strands.are_points()) {
    p.ng = p.ns = normalize_or(p.position - placed.to_world.point(strands.center(p.triangle, 0.0f)), p.wo);
  } else if (!strands.is_ribbon()) {
    p.ng = p.ns = normal_to_world(p.object_position - strands.center(p.triangle, p.b1));
  } else {
    const Vec3 along = normalize(strands.derivative(p.triangle, p.b1)), across = normalize(cross(along, placed.to_object.vector(p.wo)));
    const float cosine = std::sqrt(std::max(1.0f - p.b2 * p.b2, 0.0f));
    p.ns = normal_to_world(p.b2 * across - cosine * normalize(cross(along, across)));
    p.ng = p.wo;
  }
}

ShadingPoint Scene::turned(const ShadingPoint& point, Vec3 wo, const PathState& path) const {
  if (point.strand == kNoId) return surface_point(point.instance, point.triangle, point.b1, point.b2, wo, path, point.footprint);
  ShadingPoint p = point;
  p.wo = wo, p.path = path;
  set_strand_normals(p);
  turn_to_view(p);
  return p;
}

Scene::StrandPlace Scene::strand_place(const ShadingPoint& point) const {
  const Instance& placed = instances_[point.instance];
  const Strands& strands = *strands_[point.mesh];
  // Where the matrix scales unevenly, by the mean over the axes.
  constexpr float kAxis = 0.57735027f;
  const float scale = length(placed.to_world.vector({kAxis, kAxis, kAxis}));
  const float thickness = 2.0f * strands.radius(point.triangle, point.b1);
  return {placed.to_world.point(strands.center(point.triangle, point.b1)),
          placed.to_world.vector(strands.derivative(point.triangle, point.b1)), thickness * scale, thickness};
}

}  // namespace gi
