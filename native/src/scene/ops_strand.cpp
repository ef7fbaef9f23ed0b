// Where fibres lie, for the hair nodes. On meshes that is along the first edge of each triangle, and across it along the last, as in
// Blender.
#include "scene/object_space.h"
#include "shading/ops.h"

namespace gi {
namespace {

constexpr float kNotRibbon = 2.0f;

// -> along, across, whether it is a strand, where a ribbon is met (−1 to 1; beyond where it is none)
void strand(const Operands& o, ShadeState& s) {
  o.set(0, Vec3{}), o.set(1, Vec3{}), o.set(2, 0.0f), o.set(3, kNotRibbon);
  if (!instance_of(s)) return;
  Vec3 v[3];
  s.resources.scene->triangle_vertices(s.point.instance, s.point.triangle, v);
  const float side = s.point.backfacing ? -1.0f : 1.0f;
  o.set(0, (v[1] - v[0]) * side), o.set(1, (v[2] - v[0]) * side);
}

const Op kOps[] = {{"strand", "vvff", "", 0, OpKind::kContext, strand}};

}  // namespace

std::span<const Op> strand_ops() { return kOps; }

}  // namespace gi
