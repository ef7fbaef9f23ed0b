// The scene as it arrives from export: the native twin of gi_engine/scene_data.py. Arrays are shared with NumPy.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/vec.h"
#include "shading/program.h"

namespace gi {

// A view of an array owned elsewhere (by NumPy); `owner` keeps it alive.
template <class T>
struct Array {
  T* data = nullptr;
  size_t size = 0;
  std::shared_ptr<void> owner;
  T& operator[](size_t i) const { return data[i]; }
  bool empty() const { return size == 0; }
};

enum class Domain : uint8_t { kPoint, kCorner, kFace };

struct AttributeData {
  std::string name;
  Domain domain = Domain::kCorner;
  int components = 3;
  Array<const float> data;
};

// What a mesh is made of. Ribbons turn to whoever sees them and are shaded as if they were round.
enum class Primitive : uint8_t { kTriangle, kRibbon, kThick, kThickLinear, kSphere };

// What true displacement changes of a mesh.
struct MeshShape {
  Array<float> positions;
  Array<const float> normals;
};

struct MeshData {
  std::string name;
  Array<float> positions;  // 3 per vertex; taken over: moved to world space where one instance alone uses the mesh
  Array<const int32_t> corner_vert, tri_corner, tri_face, face_material;
  bool triangulated = false;  // all faces are triangles: no tri_corner, no tri_face
  Domain normals_domain = Domain::kFace;
  Array<const float> normals;  // of faces: the vertices', for displacement, or none
  Array<const uint8_t> sharp_face;  // of meshes with normals of corners: not 0 where flat; or none
  std::vector<AttributeData> attributes;
  std::string active_uv;
  Vec3 texture_location, texture_size{1, 1, 1};
  int32_t before = -1;  // which mesh of the scene before this one it is (Editing), checked there; -1: none
  bool is_moved = false;  // by Scene, to world space
  std::optional<MeshShape> undisplaced;  // object space; where true displacement has moved the mesh
  Primitive primitive = Primitive::kTriangle;
  Array<const float> radius;         // of vertices; where the primitive is no triangle
  Array<const int32_t> first_vertex;  // of each curve, and the number of vertices; none of points
  int subdivisions = 2;              // of ribbons: a segment is cut into 2^n + 1 straight pieces, 17 at the most
  std::vector<std::string> warnings;
  bool is_strands() const { return primitive != Primitive::kTriangle; }  // curves or points
  size_t strand_count() const { return primitive == Primitive::kSphere ? vertex_count() : std::max<size_t>(first_vertex.size, 1) - 1; }
  size_t triangle_count() const { return (triangulated ? corner_vert.size : tri_corner.size) / 3; }
  size_t corner(size_t k) const { return triangulated ? k : size_t(tri_corner[k]); }  // 3 per triangle
  bool has_faces() const { return triangulated || !tri_face.empty(); }
  size_t face(size_t triangle) const { return triangulated ? triangle : size_t(tri_face[triangle]); }
  bool is_flat(size_t triangle) const {
    return normals_domain == Domain::kFace || (!sharp_face.empty() && sharp_face[face(triangle)] != 0);
  }
  // As in Cycles, which shades flat faces among smooth ones by the normals of their corners until they are displaced.
  bool shades_flat(size_t triangle) const { return normals_domain == Domain::kFace || (undisplaced && is_flat(triangle)); }
  size_t vertex_count() const { return positions.size / 3; }
};

struct InstanceAttribute {
  std::string name;
  float value[4];
};

struct InstanceData {
  std::string name;
  uint32_t mesh = 0;
  Affine matrix;
  std::vector<int32_t> materials;  // program of each slot
  uint32_t visibility = 0xffffffffu;
  float color[4] = {1, 1, 1, 1};
  int object_index = 0;
  float random = 0;
  bool holdout = false;
  float shadow_terminator_offset = 0, shadow_terminator_geometry_offset = 0;
  std::vector<InstanceAttribute> attributes;
};

enum class LampKind : uint8_t { kPoint, kSpot, kArea, kSun };

struct LampData {  // units: gi_engine/scene_data.py Light
  std::string name;
  LampKind kind = LampKind::kPoint;
  Affine matrix;
  Rgb color;
  bool normalize = true;
  float radius = 0;
  bool soft_falloff = true;
  float spot_size = 0.7853982f, spot_blend = 0;
  bool ellipse = false;
  float size_x = 1, size_y = 1, spread = kPi;
  float angle = 0;
  int program = -1;
  uint32_t visibility = 0xffffffffu;
  bool cast_shadow = true, use_mis = true;
  int max_bounces = 1024;
};

struct WorldData {
  int program = -1;
  uint32_t visibility = 0xffffffffu;
  bool sampled = true;     // light sampling of the world
  int map_resolution = 0;  // of the importance map; 0: automatic
  int max_bounces = 1024;
};

enum class EmissionSampling : uint8_t { kNone, kAuto, kFront, kBack, kFrontBack };

struct MaterialData {
  Program program;
  int pass_index = 0;
  EmissionSampling emission_sampling = EmissionSampling::kAuto;
  bool transparent_shadows = true, bump_correction = true;
  int volume = -1;           // program of what fills objects of this material; -1: nothing
  bool only_volume = false;  // its surface is not there
  int displacement = -1;            // program that moves its vertices; -1: none
  bool bumps_displacement = false;  // its surface is bumped by the displacement as well
};

struct SceneData {
  std::vector<MeshData> meshes;
  std::vector<InstanceData> instances;
  std::vector<LampData> lamps;
  std::vector<MaterialData> materials;  // programs of materials, lamps and the world
  std::vector<std::string> attribute_names;
  WorldData world;
};

// Checks shapes, index ranges and finiteness; mends what it can (NaN vertices, indices out of range: the triangle goes)
// with a warning that names the object. Throws InputError where nothing sensible is left.
void validate(SceneData& data, std::vector<std::string>& warnings);

}  // namespace gi
