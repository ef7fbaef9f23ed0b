// Scene: placing meshes and building what is traced. Ray tracing itself is Accel's.
#include "scene/scene.h"

#include <algorithm>

#include "core/check.h"

namespace gi {
namespace {

Bounds bounds_of(const MeshData& mesh) {
  Bounds bounds;
  for (size_t v = 0; v < mesh.vertex_count(); ++v) {
    const float* q = mesh.positions.data + 3 * v;
    const float r = mesh.radius.empty() ? 0.0f : mesh.radius[v];
    const Vec3 p{q[0], q[1], q[2]}, around{r, r, r};
    if (is_finite(p) && std::isfinite(r)) bounds.add(p - around), bounds.add(p + around);
  }
  return bounds;
}

// Turns and scales alike in all directions.
bool keeps_angles(const Affine& a) {
  const Vec3 x = a.column(0), y = a.column(1), z = a.column(2);
  const float s = dot(x, x), small = 1e-4f * s;
  return std::abs(dot(y, y) - s) < small && std::abs(dot(z, z) - s) < small && std::abs(dot(x, y)) < small && std::abs(dot(y, z)) < small &&
         std::abs(dot(z, x)) < small;
}

}  // namespace

Scene::Scene(SceneData data, std::unique_ptr<ShaderResources> resources, const std::string& embree, int threads, const Editing& editing)
    : data_(std::move(data)), resources_(std::move(resources)) {
  resources_->scene = this;
  part_what_moves_differently(data_);
  index_vertices(editing.before);
  make_strands(editing.before);
  resolve_attributes();
  make_tangents(editing.before);
  place_instances();
  displace(editing.before, threads);
  place_meshes(editing);  // all else is in object space
  build_accel(embree, threads, editing.before);
}

Scene::~Scene() = default;

void Scene::index_vertices(const Scene* before) {
  for (const MeshData& mesh : data_.meshes) {
    if (mesh.before >= 0) {
      indices_.push_back(before->indices_[size_t(mesh.before)]);
      continue;
    }
    if (mesh.triangulated) {
      const Array<const int32_t>& corners = mesh.corner_vert;
      indices_.push_back({reinterpret_cast<const uint32_t*>(corners.data), corners.size, corners.owner});
      continue;
    }
    auto indices = std::make_shared<std::vector<uint32_t>>(mesh.tri_corner.size);
    for (size_t k = 0; k < indices->size(); ++k) (*indices)[k] = uint32_t(mesh.corner_vert[size_t(mesh.tri_corner[k])]);
    indices_.push_back({indices->data(), indices->size(), indices});
  }
}

void Scene::make_strands(const Scene* before) {
  for (const MeshData& mesh : data_.meshes) {
    std::shared_ptr<const Strands>& made = strands_.emplace_back();
    if (mesh.is_strands()) made = mesh.before >= 0 ? before->strands_[size_t(mesh.before)] : std::make_shared<const Strands>(mesh);
  }
}

void Scene::place_instances() {
  std::vector<uint32_t> uses(data_.meshes.size(), 0);
  for (const InstanceData& i : data_.instances) ++uses[i.mesh];
  for (const InstanceData& i : data_.instances) {
    Instance placed;
    placed.mesh = i.mesh;
    placed.to_world = i.matrix;
    placed.to_object = i.matrix.inverse();
    placed.mirrored = i.matrix.determinant() < 0.0f;
    placed.is_only = uses[i.mesh] == 1;
    placed.data = &i;
    instances_.push_back(placed);
  }
}

// To world space, where they need not stay in their own.
void Scene::place_meshes(const Editing& editing) {
  mesh_bounds_.resize(data_.meshes.size());
  for (Instance& placed : instances_) {
    const InstanceData& i = *placed.data;
    MeshData& mesh = data_.meshes[i.mesh];
    // As an instance, what is flat by its matrix could not be traced. Strands are no thicker by a matrix than along their width.
    placed.world_space = placed.is_only && !mesh.is_strands() && (!editing.movable || i.matrix.inverse().determinant() == 0.0f);
    // So does Cycles, which moves a mesh that one object alone uses, normals and all, if it is not displaced.
    placed.world_normals = placed.is_only && !mesh.undisplaced && !keeps_angles(i.matrix);
    if (placed.world_space && !i.matrix.is_identity()) {
      // The caller's array stays as it is; the moved one takes its place (and its memory, once the caller lets go).
      auto moved = std::make_shared<std::vector<float>>(mesh.positions.size + 1);
      for (size_t v = 0; v < mesh.positions.size; v += 3) {
        const Vec3 p = i.matrix.point({mesh.positions[v], mesh.positions[v + 1], mesh.positions[v + 2]});
        (*moved)[v] = p.x, (*moved)[v + 1] = p.y, (*moved)[v + 2] = p.z;
      }
      mesh.positions = {moved->data(), mesh.positions.size, moved};
      mesh.before = -1, mesh.is_moved = true;
    }
    Bounds& local = mesh_bounds_[i.mesh];
    if (mesh.before >= 0) local = editing.before->mesh_bounds_[size_t(mesh.before)];
    if (local.empty()) local = bounds_of(mesh);
    for (int corner = 0; corner < 8 && !local.empty(); ++corner) {
      const Vec3 p{corner & 1 ? local.hi.x : local.lo.x, corner & 2 ? local.hi.y : local.lo.y, corner & 4 ? local.hi.z : local.lo.z};
      bounds_.add(placed.world_space ? p : placed.to_world.point(p));
    }
  }
}

void Scene::resolve_attributes() {
  for (const MeshData& mesh : data_.meshes) {
    const auto find = [&](const std::string& name) {
      for (size_t a = 0; a < mesh.attributes.size() && !name.empty(); ++a)
        if (mesh.attributes[a].name == name) return int32_t(a);
      return int32_t(-1);
    };
    active_uv_.push_back(find(mesh.active_uv));
    std::vector<int32_t>& slots = attribute_index_.emplace_back();
    for (const std::string& name : data_.attribute_names) slots.push_back(name.empty() ? active_uv_.back() : find(name));
  }
}

// What the scene before had of the same mesh and map, undisplaced.
Scene::Tangents Scene::known_tangents(const MeshData& mesh, int slot, const Scene* before) const {
  if (mesh.before < 0) return nullptr;
  const size_t m = size_t(mesh.before);
  const std::vector<Tangents>& known = before->moved_by_[m] >= 0 ? before->undisplaced_tangents_[m] : before->tangents_[m];
  if (known.empty()) return nullptr;
  const std::vector<std::string>& names = before->data_.attribute_names;
  const auto found = std::find(names.begin(), names.end(), data_.attribute_names[size_t(slot)]);
  return found == names.end() ? nullptr : known[size_t(found - names.begin())];
}

void Scene::make_tangents(const Scene* before) {
  // Which op takes tangents of the map in which of its immediates.
  static constexpr std::pair<std::string_view, int> kUsers[] = {{"normal_map_tangent", 0}, {"tangent_uv", 0}, {"vector_displacement", 0}};
  tangents_.resize(data_.meshes.size());
  for (const InstanceData& i : data_.instances) {
    std::vector<int32_t> programs = i.materials;
    for (const int32_t m : i.materials)
      if (data_.materials[size_t(m)].displacement >= 0) programs.push_back(data_.materials[size_t(m)].displacement);
    for (const int32_t program : programs) {
      for (const auto& [op, immediate] : kUsers) {
        for (const int32_t slot : data_.materials[size_t(program)].program.immediates(op, immediate)) {
          tangents_[i.mesh].resize(data_.attribute_names.size());
          Tangents& made = tangents_[i.mesh][size_t(slot)];
          if (!made) made = known_tangents(data_.meshes[i.mesh], slot, before);
          if (!made) made = std::make_shared<const std::vector<CornerTangent>>(tangents_of(i.mesh, slot));
        }
      }
    }
  }
}

std::vector<CornerTangent> Scene::tangents_of(uint32_t m, int slot) const {
  const MeshData& mesh = data_.meshes[m];
  const int32_t index = attribute_index_[m][size_t(slot)];
  if (index < 0 && !data_.attribute_names[size_t(slot)].empty()) return {};
  std::vector<TangentCorner> corners(indices_[m].size);
  ShadingPoint point;
  for (size_t c = 0; c < corners.size(); ++c) {
    const float* p = mesh.positions.data + 3 * size_t(indices_[m][c]);
    corners[c].position = {p[0], p[1], p[2]};
    corners[c].uv = spherical_uv(corners[c].position);
    if (index < 0) continue;
    float uv[4];
    point.triangle = uint32_t(c / 3), point.b1 = c % 3 == 1, point.b2 = c % 3 == 2;
    interpolate(m, mesh.attributes[size_t(index)], point, uv);
    corners[c].uv = {uv[0], uv[1]};
  }
  for (size_t c = 0; c < corners.size(); c += 3) {
    const Vec3 a = corners[c].position, flat = normalize(cross(corners[c + 1].position - a, corners[c + 2].position - a));
    for (size_t k = 0; k < 3; ++k) corners[c + k].normal = mesh.shades_flat(c / 3) ? flat : corner_normal(m, uint32_t(c / 3), int(k));
  }
  return corner_tangents(corners);
}

void Scene::build_accel(const std::string& embree, int threads, const Scene* before) {
  std::vector<AccelMesh> meshes;
  std::vector<int32_t> mesh_before;
  for (size_t m = 0; m < data_.meshes.size(); ++m) {
    const MeshData& mesh = data_.meshes[m];
    meshes.push_back({mesh.positions.data, mesh.vertex_count(), indices_[m].data, mesh.triangle_count(), mesh.positions.owner,
                      indices_[m].owner, strands_[m], mesh.subdivisions});
    mesh_before.push_back(mesh.before);
  }
  std::vector<AccelInstance> placed;
  for (const Instance& i : instances_) {
    bool transparent = false;
    for (const int program : i.data->materials) {
      const MaterialData& material = data_.materials[size_t(program)];
      transparent |= material.transparent_shadows && material.program.has_transparency();
    }
    uint32_t mask = i.data->visibility & 0xffffu;
    if (transparent && (mask & kRayShadow)) mask = (mask & ~uint32_t(kRayShadow)) | kTransparentShadowBit, any_transparent_ = true;
    for (const int program : i.data->materials)
      if (data_.materials[size_t(program)].volume >= 0 && !strands_[i.mesh]) mask |= kVolumeBit;  // a strand holds nothing
    placed.push_back({i.mesh, i.world_space ? nullptr : &i.to_world, mask});
  }
  accel_ = gi::build_accel(embree, std::move(meshes), std::move(placed), threads, before ? before->accel_.get() : nullptr, mesh_before);
}

size_t Scene::memory_bytes() const {
  size_t bytes = accel_->memory_bytes() + instances_.size() * (sizeof(Instance) + sizeof(InstanceData));
  for (const MeshData& m : data_.meshes) {
    bytes += (m.positions.size + m.corner_vert.size + 2 * m.tri_corner.size + m.tri_face.size + m.face_material.size + m.normals.size) * 4;
    for (const AttributeData& a : m.attributes) bytes += a.data.size * 4;
    if (m.undisplaced) bytes += (m.undisplaced->positions.size + m.undisplaced->normals.size) * 4;
  }
  for (const auto& strands : strands_) bytes += strands ? strands->memory_bytes() : 0;
  for (const auto& slots : tangents_)
    for (const Tangents& corners : slots) bytes += corners ? corners->size() * sizeof(CornerTangent) : 0;
  return bytes;
}

}  // namespace gi
