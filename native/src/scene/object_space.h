// What ops need of the object that was hit: its transforms and its Generated coordinates. On the world there is no object, and
// spaces are all the world's.
#pragma once
#include "scene/scene.h"

namespace gi {

inline const Instance* instance_of(const ShadeState& s) {
  if (!s.resources.scene || s.point.instance == kNoId) return nullptr;
  return &s.resources.scene->instances()[s.point.instance];
}

inline Vec3 normal_to_object(const ShadeState& s, Vec3 n) {
  const Instance* i = instance_of(s);
  const Affine* to_world = i ? &i->to_world : s.point.lamp_to_world;
  return to_world ? normalize(to_world->transposed_vector(n)) : n;
}
inline Vec3 normal_to_world(const ShadeState& s, Vec3 n) {
  const Instance* i = instance_of(s);
  return i ? normalize(i->to_object.transposed_vector(n)) : normalize(n);
}

// A place in the object's space within the texture space of the mesh, as 0..1.
inline Vec3 in_texture_space(const MeshData& mesh, Vec3 p) {
  const Vec3 d = p - mesh.texture_location, size = mesh.texture_size;
  return Vec3{safe_divide(d.x, size.x), safe_divide(d.y, size.y), safe_divide(d.z, size.z)} * 0.5f + Vec3{0.5f, 0.5f, 0.5f};
}

// Where the point is in there. `slot`: the attribute that holds positions before deformation, used where there is one.
inline Vec3 generated_coordinates(const ShadeState& s, int slot) {
  const Instance* i = instance_of(s);
  if (!i) return s.point.object_position;
  const MeshData& mesh = s.resources.scene->mesh(i->mesh);
  float a[4];
  Vec3 p = s.point.object_position;
  if (s.resources.scene->attribute(s.point, slot, a) == 3)
    p = {a[0], a[1], a[2]};
  else if (const auto before = s.resources.scene->undisplaced(s.point))
    p = i->to_object.point(before->position);
  return in_texture_space(mesh, p);
}

}  // namespace gi
