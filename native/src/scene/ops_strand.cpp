// Where fibres lie, for the hair nodes, and what strands and points know of themselves. On meshes fibres lie along the first edge of each
// triangle, and across it along the last, as in Blender.
#include "scene/object_space.h"
#include "shading/ops.h"

namespace gi {
namespace {

constexpr float kNotRibbon = 2.0f;

// -> along, across, whether it is a strand, where a ribbon is met (−1 to 1; beyond where it is none)
void strand(const Operands& o, ShadeState& s) {
  o.set(0, Vec3{}), o.set(1, Vec3{}), o.set(2, 0.0f), o.set(3, kNotRibbon);
  if (!instance_of(s)) return;
  if (s.point.strand != kNoId) {
    const bool is_point = s.resources.scene->mesh(s.point.mesh).primitive == Primitive::kSphere;
    const Vec3 along = s.resources.scene->strand_place(s.point).along;
    // Where points of a curve lie on one another it has no direction: any across the surface, or it would be black.
    o.set(0, is_point || !(along == Vec3{}) ? along : Frame::from_normal(s.point.ns).x), o.set(2, is_point ? 0.0f : 1.0f);
    if (s.resources.scene->is_ribbon(s.point)) o.set(3, -s.point.b2);
    return;
  }
  Vec3 v[3];
  s.resources.scene->triangle_vertices(s.point.instance, s.point.triangle, v);
  const float side = s.point.backfacing ? -1.0f : 1.0f;
  o.set(0, (v[1] - v[0]) * side), o.set(1, (v[2] - v[0]) * side);
}

// -> middle, diameter (immediate: whether in object space), normal across the view; of strands and points, zeros on meshes
void strand_place(const Operands& o, ShadeState& s) {
  o.set(0, Vec3{}), o.set(1, 0.0f), o.set(2, Vec3{});
  if (!instance_of(s) || s.point.strand == kNoId) return;
  const auto place = s.resources.scene->strand_place(s.point);
  const Vec3 wo = s.point.wo, along = place.along;
  o.set(0, place.center), o.set(1, o.imm(3) ? place.own_thickness : place.thickness);
  if (!(along == Vec3{})) o.set(2, normalize(wo - along * (dot(along, wo) / length_squared(along))));
}

// The surface's tangent -> the strand's own where there is one, unit.
void along_strand(const Operands& o, ShadeState& s) {
  const bool strand = instance_of(s) && s.point.strand != kNoId;
  o.set(0, strand ? normalize_or(s.resources.scene->strand_place(s.point).along, Vec3{}) : o.v(1));
}

const Op kOps[] = {
    {"along_strand", "v", "v", 0, OpKind::kContext, along_strand},
    {"strand", "vvff", "", 0, OpKind::kContext, strand},
    {"strand_place", "vfv", "", 1, OpKind::kContext, strand_place},
};

}  // namespace

std::span<const Op> strand_ops() { return kOps; }

}  // namespace gi
