// The border: what arrives from export is checked once, here. Messages name the Blender object.
#include <cmath>

#include "core/check.h"
#include "scene/scene_data.h"

namespace gi {
namespace {

// A broken triangle: one that names a vertex that is not there, or whose vertices are not all finite.
bool triangle_is_sound(const MeshData& mesh, size_t t) {
  for (int k = 0; k < 3; ++k) {
    const size_t corner = mesh.corner(3 * t + size_t(k));  // a negative one is out of range, too
    if (corner >= mesh.corner_vert.size) return false;
    const int32_t v = mesh.corner_vert[corner];
    if (v < 0 || size_t(v) >= mesh.vertex_count()) return false;
    const float* p = mesh.positions.data + 3 * size_t(v);
    if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) return false;
  }
  return true;
}

Array<const int32_t> owned(std::vector<int32_t> values) {
  auto keep = std::make_shared<std::vector<int32_t>>(std::move(values));
  return {keep->data(), keep->size(), keep};
}

void drop_broken_triangles(MeshData& mesh) {
  const size_t n = mesh.triangle_count();
  size_t first = 0;
  while (first < n && triangle_is_sound(mesh, first)) ++first;
  if (first == n) return;
  std::vector<int32_t> corners, faces;
  for (size_t t = 0; t < n; ++t) {
    if (!triangle_is_sound(mesh, t)) continue;
    for (size_t k = 0; k < 3; ++k) corners.push_back(int32_t(mesh.corner(3 * t + k)));
    if (mesh.has_faces()) faces.push_back(int32_t(mesh.face(t)));
  }
  mesh.warnings.push_back("mesh '" + mesh.name + "': " + std::to_string(n - corners.size() / 3) +
                          " triangles with vertices that are not finite or out of range are left out");
  mesh.tri_corner = owned(std::move(corners));
  if (mesh.has_faces()) mesh.tri_face = owned(std::move(faces));
  mesh.triangulated = false;
}

size_t elements(const MeshData& mesh, Domain domain, size_t faces) {
  return domain == Domain::kPoint ? mesh.vertex_count() : domain == Domain::kCorner ? mesh.corner_vert.size : faces;
}

void require_attribute(const AttributeData& a, const std::string& who, size_t least) {
  require(a.components >= 1 && a.components <= 4, who + "attribute '" + a.name + "' must have 1 to 4 components");
  require(a.data.size >= least * size_t(a.components), who + "attribute '" + a.name + "' has " + std::to_string(a.data.size) +
                                                           " values instead of " + std::to_string(least * size_t(a.components)));
}

// Embree leaves out segments whose vertices are not finite by itself.
void validate_strands(MeshData& mesh) {
  const std::string who = "'" + mesh.name + "': ";
  require(mesh.positions.size % 3 == 0, who + "positions must have 3 columns");
  require(mesh.radius.size == mesh.vertex_count(), who + "radius must have one number for each vertex");
  require(mesh.subdivisions >= 0 && mesh.subdivisions <= 24, who + "subdivisions must be 0 to 24");
  const Array<const int32_t>& first = mesh.first_vertex;
  if (mesh.primitive == Primitive::kSphere) {
    require(first.empty(), who + "points have no first_vertex");
  } else {
    require(!first.empty() && first[0] == 0 && size_t(first[first.size - 1]) == mesh.vertex_count(),
            who + "first_vertex must begin with 0 and end with the number of vertices");
    for (size_t s = 1; s < first.size; ++s) require(first[s] >= first[s - 1], who + "first_vertex must not fall");
  }
  for (const AttributeData& a : mesh.attributes) {
    require(a.domain != Domain::kCorner, who + "attribute '" + a.name + "' must be of vertices (POINT) or strands (FACE)");
    require_attribute(a, who, a.domain == Domain::kPoint ? mesh.vertex_count() : mesh.strand_count());
  }
}

void validate_mesh(MeshData& mesh) {
  if (mesh.is_strands()) return validate_strands(mesh);
  const std::string who = "mesh '" + mesh.name + "': ";
  require(mesh.positions.size % 3 == 0, who + "positions must have 3 columns");
  require(mesh.tri_corner.size % 3 == 0, who + "tri_corner must have 3 columns");
  require(!mesh.triangulated || mesh.corner_vert.size % 3 == 0, who + "without tri_corner, corner_vert must hold triangles");
  require(!mesh.triangulated || mesh.tri_face.empty(), who + "tri_face needs tri_corner");
  require(mesh.tri_face.empty() || mesh.tri_face.size == mesh.triangle_count(), who + "tri_face must have one entry for each triangle");
  size_t faces = mesh.triangulated ? mesh.triangle_count() : mesh.face_material.size;
  drop_broken_triangles(mesh);
  for (size_t t = 0; t < mesh.tri_face.size; ++t) {
    require(mesh.tri_face[t] >= 0, who + "tri_face holds a negative index");
    faces = std::max(faces, size_t(mesh.tri_face[t]) + 1);
  }
  require(mesh.face_material.empty() || mesh.face_material.size == faces, who + "tri_face is out of the range of face_material");
  require(mesh.face_material.empty() || mesh.has_faces() || mesh.triangle_count() == 0, who + "face_material needs tri_face");
  require(mesh.sharp_face.empty() || (mesh.sharp_face.size >= faces && mesh.has_faces()) || mesh.triangle_count() == 0,
          who + "sharp_face needs tri_face and one entry for each face");
  if (mesh.normals_domain != Domain::kFace || !mesh.normals.empty()) {
    const size_t want = 3 * elements(mesh, mesh.normals_domain == Domain::kCorner ? Domain::kCorner : Domain::kPoint, faces);
    require(mesh.normals.size == want,
            who + "normals has " + std::to_string(mesh.normals.size) + " values instead of " + std::to_string(want));
  }
  for (const AttributeData& a : mesh.attributes) {
    require(a.domain != Domain::kFace || mesh.has_faces() || mesh.triangle_count() == 0,
            who + "attribute '" + a.name + "' on faces needs tri_face");
    require_attribute(a, who, elements(mesh, a.domain, faces));
  }
}

bool is_finite(const Affine& m) {
  for (const auto& row : m.m)
    for (const float x : row)
      if (!std::isfinite(x)) return false;
  return true;
}

void check_program(const SceneData& data, int program, const std::string& who, int least) {
  require(program >= least && program < int(data.materials.size()),
          who + " refers to program " + std::to_string(program) + ", which does not exist");
}

}  // namespace

void validate(SceneData& data, std::vector<std::string>& warnings) {
  for (MeshData& mesh : data.meshes) {
    if (mesh.before < 0) validate_mesh(mesh);
    warnings.insert(warnings.end(), mesh.warnings.begin(), mesh.warnings.end());
  }

  std::vector<uint32_t> uses(data.meshes.size(), 0);
  for (const InstanceData& i : data.instances) {
    require(i.mesh < data.meshes.size(), "object '" + i.name + "' refers to a mesh that does not exist");
    ++uses[i.mesh];
    require(!i.materials.empty(), "object '" + i.name + "' has no material program");
    for (const int program : i.materials) check_program(data, program, "object '" + i.name + "'", 0);
  }
  std::erase_if(data.instances, [&](const InstanceData& i) {
    if (!is_finite(i.matrix)) {
      warnings.push_back("object '" + i.name + "' has a transform that is not finite: left out");
      return true;
    }
    // A flattened mesh that is used once still shows its outline; as an instance it cannot be traced.
    if ((uses[i.mesh] > 1 || data.meshes[i.mesh].is_strands()) && i.matrix.inverse().determinant() == 0.0f) {
      warnings.push_back("object '" + i.name + "' has a singular transform (a scale of 0): left out");
      return true;
    }
    return false;
  });
  for (const MaterialData& m : data.materials) {
    check_program(data, m.volume, "the volume of '" + m.program.name() + "'", -1);
    check_program(data, m.displacement, "the displacement of '" + m.program.name() + "'", -1);
  }
  std::erase_if(data.lamps, [&](const LampData& lamp) {
    check_program(data, lamp.program, "light '" + lamp.name + "'", -1);
    if (is_finite(lamp.matrix) && is_finite(lamp.color)) return false;
    warnings.push_back("light '" + lamp.name + "' has a transform or strength that is not finite: left out");
    return true;
  });
  check_program(data, data.world.program, "the world", -1);
}

}  // namespace gi
