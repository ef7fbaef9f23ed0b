// True displacement: vertices moved by their materials' programs, in object space, before anything is traced. What several objects share
// is moved as the first of them says. Leaves out dicing: there are as many vertices as the mesh brings.
#include <algorithm>

#include "core/parallel.h"
#include "scene/scene.h"
#include "scene/vertex_normals.h"
#include "shading/images.h"

namespace gi {
namespace {

constexpr size_t kVerticesAtOnce = 1024;

Array<float> with_slack(const std::vector<Vec3>& vectors) {
  auto numbers = std::make_shared<std::vector<float>>(3 * vectors.size() + 1);  // Embree reads 16 bytes at a time
  for (size_t v = 0; v < vectors.size(); ++v)
    for (int k = 0; k < 3; ++k) (*numbers)[3 * v + size_t(k)] = vectors[v][k];
  return {numbers->data(), 3 * vectors.size(), numbers};
}

Array<const float> fixed(const std::vector<Vec3>& vectors) {
  const Array<float> a = with_slack(vectors);
  return {a.data, a.size, a.owner};
}

// The programs that move each slot's vertices; empty where none does.
std::vector<int> movers_of(const SceneData& data, const InstanceData& instance) {
  std::vector<int> programs;
  for (const int32_t m : instance.materials) programs.push_back(data.materials[size_t(m)].displacement);
  if (std::all_of(programs.begin(), programs.end(), [](int p) { return p < 0; })) programs.clear();
  return programs;
}

bool same_attribute(const InstanceAttribute& a, const InstanceAttribute& b) {
  return a.name == b.name && std::equal(a.value, a.value + 4, b.value);
}

// Whether programs see the same of both.
bool looks_alike(const InstanceData& a, const InstanceData& b) {
  return std::equal(&a.matrix.m[0][0], &a.matrix.m[0][0] + 12, &b.matrix.m[0][0]) && std::equal(a.color, a.color + 4, b.color) &&
         a.object_index == b.object_index && a.random == b.random &&
         std::equal(a.attributes.begin(), a.attributes.end(), b.attributes.begin(), b.attributes.end(), same_attribute);
}

bool same_images(const ShaderResources& a, const ShaderResources& b) {
  return a.images == b.images || (a.images && b.images && a.images->same_as(*b.images));
}

}  // namespace

void part_what_moves_differently(SceneData& data) {
  struct Part {
    std::vector<int> movers;
    uint32_t mesh;
  };
  std::vector<std::vector<Part>> parts(data.meshes.size());
  for (InstanceData& instance : data.instances) {
    std::vector<Part>& known = parts[instance.mesh];
    std::vector<int> movers = movers_of(data, instance);
    auto found = std::find_if(known.begin(), known.end(), [&](const Part& part) { return part.movers == movers; });
    if (found == known.end()) {
      Part part{std::move(movers), instance.mesh};
      if (!known.empty()) {
        part.mesh = uint32_t(data.meshes.size());
        MeshData copy = data.meshes[instance.mesh];
        copy.before = -1;
        data.meshes.push_back(std::move(copy));
      }
      found = known.insert(known.end(), std::move(part));
    }
    instance.mesh = found->mesh;
  }
}

int Scene::displacement_of(uint32_t instance, uint32_t triangle) const { return material(material_of(instance, triangle)).displacement; }

void Scene::displace(const Scene* before, int threads) {
  moved_by_.assign(data_.meshes.size(), -1);
  undisplaced_tangents_.resize(data_.meshes.size());
  for (uint32_t i = 0; i < instances_.size(); ++i) {
    int32_t& mover = moved_by_[instances_[i].mesh];
    if (mover < 0 && !data_.meshes[instances_[i].mesh].is_strands() && !movers_of(data_, data_.instances[i]).empty()) mover = int32_t(i);
  }
  for (uint32_t m = 0; m < data_.meshes.size(); ++m) {
    MeshData& mesh = data_.meshes[m];
    if (moved_by_[m] < 0) {
      if (mesh.before >= 0 && before->moved_by_[size_t(mesh.before)] >= 0) mesh.before = -1;
      continue;
    }
    MeshShape shape{mesh.positions, mesh.normals};
    undisplaced_tangents_[m] = tangents_[m];
    if (mesh.before >= 0 && is_displaced_as(m, *before)) {
      const MeshData& known = before->data_.meshes[size_t(mesh.before)];
      mesh.positions = known.positions, mesh.normals = known.normals;
      mesh.undisplaced = std::move(shape);
      retie_tangents(m, &before->tangents_[size_t(mesh.before)]);
    } else {
      mesh.before = -1;
      displace_mesh(uint32_t(moved_by_[m]), threads);
      mesh.undisplaced = std::move(shape);
      retie_tangents(m, nullptr);
    }
  }
}

// Those of the displaced mesh. `known`: of the same, where there are some.
void Scene::retie_tangents(uint32_t m, const std::vector<Tangents>* known) {
  for (size_t slot = 0; slot < tangents_[m].size(); ++slot) {
    Tangents& made = tangents_[m][slot];
    if (!made) continue;
    made = known && slot < known->size() ? (*known)[slot] : nullptr;
    if (!made) made = std::make_shared<const std::vector<CornerTangent>>(tangents_of(m, int(slot)));
  }
}

// Whether what the scene before made of the mesh serves again: nothing that its programs may look at is another.
bool Scene::is_displaced_as(uint32_t m, const Scene& before) const {
  const int32_t mover = before.moved_by_[size_t(data_.meshes[m].before)];
  if (mover < 0 || data_.attribute_names != before.data_.attribute_names || !same_images(*resources_, *before.resources_)) return false;
  const InstanceData &now = data_.instances[size_t(moved_by_[m])], &then = before.data_.instances[size_t(mover)];
  const auto same_mover = [&](int32_t a, int32_t b) {
    const MaterialData &x = material(a), &y = before.material(b);
    if ((x.displacement < 0) != (y.displacement < 0) || x.bumps_displacement != y.bumps_displacement) return false;
    return x.displacement < 0 || material(x.displacement).program.same_as(before.material(y.displacement).program);
  };
  return looks_alike(now, then) &&
         std::equal(now.materials.begin(), now.materials.end(), then.materials.begin(), then.materials.end(), same_mover);
}

void Scene::displace_mesh(uint32_t instance, int threads) {
  const Instance& placed = instances_[instance];
  MeshData& mesh = data_.meshes[placed.mesh];
  // Each vertex moves as the first triangle says that has it and is displaced.
  std::vector<uint32_t> corners;
  std::vector<bool> done(mesh.vertex_count(), false);
  for (uint32_t t = 0; t < mesh.triangle_count(); ++t) {
    if (displacement_of(instance, t) < 0) continue;
    for (uint32_t c = 3 * t; c < 3 * t + 3; ++c) {
      const uint32_t v = indices_[placed.mesh][c];
      if (!done[v]) corners.push_back(c), done[v] = true;
    }
  }
  std::vector<Vec3> positions = vectors_of(mesh.positions.data, mesh.vertex_count());
  const std::vector<Vec3> smooth = mesh.normals.empty() ? vertex_normals(positions, indices_[placed.mesh], {}) : std::vector<Vec3>{};
  std::vector<Vec3> moved = positions;
  const std::atomic<bool> never{false};
  ThreadPool(threads).for_each(int((corners.size() + kVerticesAtOnce - 1) / kVerticesAtOnce), never, [&](int batch) {
    const size_t first = size_t(batch) * kVerticesAtOnce, end = std::min(first + kVerticesAtOnce, corners.size());
    for (size_t i = first; i < end; ++i) {
      const uint32_t t = corners[i] / 3, k = corners[i] % 3, v = indices_[placed.mesh][corners[i]];
      const Vec3 offset = displacement_at(instance, t, int(k), smooth.empty() ? displacement_normal(placed.mesh, t, int(k)) : smooth[v]);
      if (is_finite(offset)) moved[v] = positions[v] + offset;
    }
  });
  mesh.positions = with_slack(moved);
  renew_normals(instance, positions, moved);
}

// Object space: that of the corner where corners have their own, of the vertex otherwise, even where faces are flat.
Vec3 Scene::displacement_normal(uint32_t m, uint32_t triangle, int k) const {
  const MeshData& mesh = data_.meshes[m];
  if (mesh.normals_domain != Domain::kFace) return corner_normal(m, triangle, k);
  return vector_at(mesh.normals.data, indices_[m][3 * size_t(triangle) + size_t(k)]);
}

// How far corner `k` moves, object space. Seen along its normal.
Vec3 Scene::displacement_at(uint32_t instance, uint32_t triangle, int k, Vec3 normal) const {
  const Instance& placed = instances_[instance];
  PathState nowhere;
  nowhere.kind = 0;
  ShadingPoint point = surface_point(instance, triangle, k == 1, k == 2, Vec3{}, nowhere);
  point.ns = normalize_or(placed.to_object.transposed_vector(normal), point.ng);
  point.wo = point.ns;
  const Vec3 from = point.position;
  material(displacement_of(instance, triangle)).program.run(point, *resources_, nullptr);
  return placed.to_object.vector(point.position - from);
}

// As in Cycles: where displacement alone gives the surface its shape, vertices get the normals of what it has become; corners keep how
// they differed from them. Where a bump does the rest, vertices keep their normals, for it starts from them.
void Scene::renew_normals(uint32_t instance, const std::vector<Vec3>& from, const std::vector<Vec3>& to) {
  const uint32_t m = instances_[instance].mesh;
  MeshData& mesh = data_.meshes[m];
  if (mesh.normals_domain == Domain::kFace) return;
  std::vector<Vec3> normals = vectors_of(mesh.normals.data, mesh.normals.size / 3);
  if (mesh.normals_domain == Domain::kPoint) {
    const std::vector<Vec3> renewed = vertex_normals(to, indices_[m], [&](uint32_t t) {
      const MaterialData& paint = material(material_of(instance, t));
      return paint.displacement >= 0 && !paint.bumps_displacement;
    });
    for (size_t v = 0; v < normals.size(); ++v) normals[v] = normalize_or(renewed[v], normals[v]);
  } else {
    const std::vector<Vec3> then = vertex_normals(from, indices_[m], {}), now = vertex_normals(to, indices_[m], {});
    for (size_t c = 0; c < indices_[m].size; ++c) {
      const uint32_t v = indices_[m][c];
      const Vec3 old = vector_at(mesh.normals.data, mesh.corner(c));
      normals[mesh.corner(c)] = normalize_or(old + normalize(now[v]) - normalize(then[v]), old);
    }
  }
  mesh.normals = fixed(normals);
}

std::optional<Undisplaced> Scene::undisplaced(const ShadingPoint& p) const {
  if (p.instance == kNoId || !data_.meshes[p.mesh].undisplaced) return {};
  const Instance& placed = instances_[p.instance];
  const MeshData& mesh = data_.meshes[p.mesh];
  const MeshShape& shape = *mesh.undisplaced;
  const uint32_t* v = indices_[p.mesh].data + 3 * size_t(p.triangle);
  const float w[3] = {1.0f - p.b1 - p.b2, p.b1, p.b2};
  Vec3 at[3], normal;
  for (int k = 0; k < 3; ++k) at[k] = placed.to_world.point(vector_at(shape.positions.data, v[k]));
  Undisplaced u{w[0] * at[0] + w[1] * at[1] + w[2] * at[2], {}, at[1] - at[0], at[2] - at[0], {}};
  if (mesh.normals_domain == Domain::kFace) {
    normal = cross(u.e1, u.e2) * (placed.mirrored ? -1.0f : 1.0f);
  } else {
    for (int k = 0; k < 3; ++k)
      u.object_normal += w[k] * vector_at(shape.normals.data,
                                          mesh.normals_domain == Domain::kPoint ? v[k] : mesh.corner(3 * size_t(p.triangle) + size_t(k)));
    normal = placed.to_object.transposed_vector(u.object_normal);
  }
  u.normal = normalize_or(p.backfacing ? -normal : normal, p.ns);
  return u;
}

}  // namespace gi
