// Scene: placing meshes, interpolating what programs ask for, running them. Ray tracing itself is Accel's.
#include "scene/scene.h"

#include <algorithm>

#include "core/check.h"

namespace gi {
namespace {

// Instances whose materials may let shadow rays through answer to this bit instead of kRayShadow, so that one
// occlusion query settles all that is opaque.
constexpr uint32_t kTransparentShadowBit = 1u << 16;

Bounds bounds_of(const Array<float>& positions) {
  Bounds bounds;
  for (size_t v = 0; v < positions.size; v += 3) {
    const Vec3 p{positions[v], positions[v + 1], positions[v + 2]};
    if (is_finite(p)) bounds.add(p);
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

// As in Cycles, which shades flat faces among smooth ones by the normals of their corners until they are displaced.
bool shades_flat(const MeshData& mesh, size_t triangle) {
  return mesh.normals_domain == Domain::kFace || (mesh.undisplaced && mesh.is_flat(triangle));
}

}  // namespace

Scene::Scene(SceneData data, std::unique_ptr<ShaderResources> resources, const std::string& embree, int threads, const Editing& editing)
    : data_(std::move(data)), resources_(std::move(resources)) {
  resources_->scene = this;
  part_what_moves_differently(data_);
  index_vertices(editing.before);
  resolve_attributes();
  make_tangents(editing.before);
  place_instances();
  displace(editing.before, threads);
  place_meshes(editing);  // all else is in object space
  build_accel(embree, threads, editing.before);
}

Scene::~Scene() = default;

// ---------------------------------------------------------------- building

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
    // As an instance, what is flat by its matrix could not be traced.
    placed.world_space = placed.is_only && (!editing.movable || i.matrix.inverse().determinant() == 0.0f);
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
    if (local.empty()) local = bounds_of(mesh.positions);
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
    for (size_t k = 0; k < 3; ++k) corners[c + k].normal = shades_flat(mesh, c / 3) ? flat : corner_normal(m, uint32_t(c / 3), int(k));
  }
  return corner_tangents(corners);
}

void Scene::build_accel(const std::string& embree, int threads, const Scene* before) {
  std::vector<AccelMesh> meshes;
  std::vector<int32_t> mesh_before;
  for (size_t m = 0; m < data_.meshes.size(); ++m) {
    const MeshData& mesh = data_.meshes[m];
    meshes.push_back(
        {mesh.positions.data, mesh.vertex_count(), indices_[m].data, mesh.triangle_count(), mesh.positions.owner, indices_[m].owner});
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
      if (data_.materials[size_t(program)].volume >= 0) mask |= kVolumeBit;
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
  for (const auto& slots : tangents_)
    for (const Tangents& corners : slots) bytes += corners ? corners->size() * sizeof(CornerTangent) : 0;
  return bytes;
}

// ---------------------------------------------------------------- points

Vec3 Scene::vertex(const Instance& instance, uint32_t v) const {
  const float* p = data_.meshes[instance.mesh].positions.data + 3 * size_t(v);
  const Vec3 q{p[0], p[1], p[2]};
  return instance.world_space ? q : instance.to_world.point(q);
}

void Scene::triangle_vertices(uint32_t instance, uint32_t triangle, Vec3 out[3]) const {
  const Instance& placed = instances_[instance];
  const uint32_t* v = indices_[placed.mesh].data + 3 * size_t(triangle);
  for (int k = 0; k < 3; ++k) out[k] = vertex(placed, v[k]);
}

// Object space; for meshes that have normals.
Vec3 Scene::corner_normal(uint32_t m, uint32_t triangle, int k) const {
  const MeshData& mesh = data_.meshes[m];
  const size_t at = 3 * size_t(triangle) + size_t(k);
  const float* q = mesh.normals.data + 3 * size_t(mesh.normals_domain == Domain::kPoint ? indices_[m][at] : mesh.corner(at));
  return {q[0], q[1], q[2]};
}

int Scene::material_of(uint32_t instance, uint32_t triangle) const {
  const Instance& placed = instances_[instance];
  const MeshData& mesh = data_.meshes[placed.mesh];
  const std::vector<int32_t>& slots = placed.data->materials;
  if (mesh.face_material.empty()) return slots[0];
  const int slot = mesh.face_material[mesh.face(triangle)];
  return slots[size_t(std::clamp(slot, 0, int(slots.size()) - 1))];
}

ShadingPoint Scene::surface_point(uint32_t instance, uint32_t triangle, float b1, float b2, Vec3 wo, const PathState& path,
                                  float footprint) const {
  const Instance& placed = instances_[instance];
  const MeshData& mesh = data_.meshes[placed.mesh];
  Vec3 v[3];
  triangle_vertices(instance, triangle, v);
  const Vec3 e1 = v[1] - v[0], e2 = v[2] - v[0];

  ShadingPoint p;
  p.position = v[0] + b1 * e1 + b2 * e2;
  p.object_position = placed.to_object.point(p.position);
  p.wo = wo;
  p.instance = instance, p.mesh = placed.mesh, p.triangle = triangle;
  p.b1 = b1, p.b2 = b2, p.footprint = footprint;
  p.path = path;

  // Normals turn as the object does, so a mirrored one keeps its outside.
  const Vec3 n = cross(e1, e2);
  p.ng = normalize_or(placed.mirrored ? -n : n, wo);
  p.ns = p.ng;
  if (!shades_flat(mesh, triangle)) {
    const float w[3] = {1.0f - b1 - b2, b1, b2};
    Vec3 sum;
    const auto to_world = [&](Vec3 v) { return placed.to_object.transposed_vector(v); };
    for (int k = 0; k < 3; ++k) {
      const Vec3 corner = corner_normal(placed.mesh, triangle, k);
      sum += w[k] * (placed.world_normals ? normalize(to_world(corner)) : corner);
    }
    p.ns = normalize_or(placed.world_normals ? sum : to_world(sum), p.ng);
  }
  p.backfacing = dot(p.ng, wo) < 0.0f;
  if (p.backfacing) p.ng = -p.ng, p.ns = -p.ns;
  return p;
}

ShadingPoint Scene::shading_point(const Ray& ray, const Hit& hit, const PathState& path, float footprint) const {
  PathState arrived = path;
  arrived.ray_length = hit.t;
  return surface_point(hit.instance, hit.triangle, hit.b1, hit.b2, -ray.direction, arrived, footprint);
}

Vec3 Scene::shadow_origin(const ShadingPoint& point, Vec3 wi) const {
  const Instance& placed = instances_[point.instance];
  const MeshData& mesh = data_.meshes[placed.mesh];
  const float cutoff = placed.data->shadow_terminator_geometry_offset;
  if (!(cutoff > 0.0f) || shades_flat(mesh, point.triangle)) return point.position;
  // How near the terminator is: by both normals where light grazes the shading one, fading out towards the cutoff.
  const float side = dot(point.ns, wi) < 0.0f ? -1.0f : 1.0f;
  const float cos_shading = side * dot(point.ns, wi), cos_geometric = side * dot(point.ng, wi);
  const float amount =
      cos_shading < cutoff ? clamp01(2.0f - (cos_geometric + cos_shading) / cutoff) : clamp01(1.0f - cos_geometric / cutoff);
  if (amount == 0.0f) return point.position;

  // Height of the parabolic patch whose edges bend as the corner normals say.
  Vec3 v[3], n[3];
  triangle_vertices(point.instance, point.triangle, v);
  const float b[3] = {1.0f - point.b1 - point.b2, point.b1, point.b2};
  Vec3 lift;
  for (int k = 0; k < 3; ++k) {
    n[k] = normalize(placed.to_object.transposed_vector(corner_normal(placed.mesh, point.triangle, k)));
    if (dot(n[k], point.ng) * side < 0.0f) n[k] = -n[k];  // towards the side that light comes from
    lift += b[k] * n[k];
  }
  float height = 0.0f;
  for (int i = 0; i < 3; ++i)
    for (int j = i + 1; j < 3; ++j) height += b[i] * b[j] * dot(n[j] - n[i], v[j] - v[i]);
  return point.position + lift * (amount * std::max(height, 0.0f));  // hollow sides are not lifted
}

ShadingPoint Scene::world_point(Vec3 direction, const PathState& path) const {
  ShadingPoint p;
  p.position = p.object_position = direction;
  p.wo = p.ng = p.ns = -direction;
  p.path = path;
  return p;
}

// ---------------------------------------------------------------- shading

void Scene::shade(ShadingPoint& point, Bsdf& bsdf) const {
  bsdf.clear(point.ng, point.ns, point.path.without);
  bsdf.set_terminator_frequency(1.0f / (1.0f - 0.5f * instances_[point.instance].data->shadow_terminator_offset));
  const MaterialData& m = material(material_of(point.instance, point.triangle));
  bsdf.set_bump_correction(m.bump_correction);
  m.program.run(point, *resources_, &bsdf);
  bsdf.finish(point.wo);
}

void Scene::add_aovs(const ShadingPoint& point, std::span<float> aovs) const {
  const int program = point.instance == kNoId ? data_.world.program : material_of(point.instance, point.triangle);
  if (program >= 0 && material(program).program.has_aovs()) material(program).program.add_aovs(point, *resources_, aovs);
}

Rgb Scene::emission(ShadingPoint& point) const { return run_emission(material_of(point.instance, point.triangle), point); }

Rgb Scene::run_emission(int program, ShadingPoint& point) const {
  const Program& p = material(program).program;
  if (const auto& constant = p.constant_emission()) return *constant;
  Bsdf bsdf;
  bsdf.clear(point.ng, point.ns);
  p.emission_program().run(point, *resources_, &bsdf);
  return bsdf.emission;
}

Rgb Scene::transparency(ShadingPoint& point) const {
  const Program& p = material(material_of(point.instance, point.triangle)).program;
  if (!p.has_transparency()) return Rgb();
  Bsdf bsdf;
  bsdf.clear(point.ng, point.ns);
  p.transparency_program().run(point, *resources_, &bsdf);
  return bsdf.transparency;
}

void Scene::add_medium(int m, ShadingPoint& point, Medium& medium) const {
  const int volume = material(m).volume;
  if (volume >= 0) material(volume).program.run(point, *resources_, nullptr, &medium);
}

Rgb Scene::world_radiance(Vec3 direction, const PathState& path) const {
  if (data_.world.program < 0) return Rgb();
  ShadingPoint point = world_point(direction, path);
  return run_emission(data_.world.program, point);
}

namespace {
std::atomic<size_t> threads_seen{0};
constinit thread_local size_t my_counter = 0;  // from 1 on; 0: not yet given
}  // namespace

void Scene::count_ray() const {
  if (my_counter == 0) my_counter = 1 + threads_seen++ % kRayCounters;
  std::atomic<uint64_t>& counter = rays_[my_counter - 1].value;
  counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

uint64_t Scene::rays_traced() const {
  uint64_t sum = 0;
  for (const RayCounter& c : rays_) sum += c.value.load(std::memory_order_relaxed);
  return sum;
}

Rgb Scene::transmittance(const Ray& ray, const PathState& path) const {
  count_ray();
  if (accel_->occluded(ray, kRayShadow)) return Rgb();
  Rgb passed(1.0f);
  if (!any_transparent_) return passed;
  static thread_local std::vector<Hit> hits;
  accel_->all_hits(ray, kTransparentShadowBit, hits);
  PathState state = path;
  state.kind = kRayShadow;
  for (const Hit& hit : hits) {
    const MaterialData& m = material(material_of(hit.instance, hit.triangle));
    if (!m.transparent_shadows) return Rgb();
    ShadingPoint point = shading_point(ray, hit, state);
    passed *= transparency(point);
    if (is_black(passed)) return Rgb();
    ++state.transparent_depth;
  }
  return passed;
}

// ---------------------------------------------------------------- attributes

int Scene::attribute(const ShadingPoint& point, int slot, float out[4]) const {
  out[0] = out[1] = out[2] = 0.0f, out[3] = 1.0f;
  if (point.instance == kNoId || size_t(slot) >= data_.attribute_names.size()) return 0;
  const Instance& placed = instances_[point.instance];
  const int index = point.inside ? -1 : attribute_index_[placed.mesh][size_t(slot)];
  if (index < 0) {
    for (const InstanceAttribute& a : placed.data->attributes) {
      if (a.name != data_.attribute_names[size_t(slot)]) continue;
      std::copy_n(a.value, 4, out);
      return 4;
    }
    return 0;
  }
  const MeshData& mesh = data_.meshes[placed.mesh];
  const AttributeData& found = mesh.attributes[size_t(index)];
  interpolate(placed.mesh, found, point, out);
  return found.components;
}

bool Scene::active_uv(const ShadingPoint& point, float out[4]) const {
  out[0] = out[1] = out[2] = 0.0f, out[3] = 1.0f;
  const int index = point.mesh == kNoId ? -1 : active_uv_[point.mesh];
  if (index < 0) return false;
  interpolate(point.mesh, data_.meshes[point.mesh].attributes[size_t(index)], point, out);
  return true;
}

void Scene::interpolate(uint32_t m, const AttributeData& a, const ShadingPoint& point, float out[4]) const {
  const MeshData& mesh = data_.meshes[m];
  const size_t n = size_t(a.components);
  if (a.domain == Domain::kFace) {
    std::copy_n(a.data.data + mesh.face(point.triangle) * n, n, out);
    return;
  }
  const size_t first = 3 * size_t(point.triangle);
  const float w[3] = {1.0f - point.b1 - point.b2, point.b1, point.b2};
  float sum[4] = {0, 0, 0, 0};
  for (size_t k = 0; k < 3; ++k) {
    const size_t at = a.domain == Domain::kPoint ? indices_[m][first + k] : mesh.corner(first + k);
    for (size_t c = 0; c < n; ++c) sum[c] += w[k] * a.data[at * n + c];
  }
  std::copy_n(sum, n, out);
}

Vec3 Scene::smooth_object_normal(const ShadingPoint& point) const {
  const Instance& placed = instances_[point.instance];
  const MeshData& mesh = data_.meshes[placed.mesh];
  const Vec3 flat = normalize(placed.to_world.transposed_vector(point.backfacing ? -point.ng : point.ng));
  if (shades_flat(mesh, point.triangle)) return flat;
  const float w[3] = {1.0f - point.b1 - point.b2, point.b1, point.b2};
  Vec3 sum;
  for (int k = 0; k < 3; ++k) sum += w[k] * corner_normal(placed.mesh, point.triangle, k);
  return sum == Vec3{} ? flat : sum;
}

std::optional<CornerTangent> Scene::uv_tangent(const ShadingPoint& point, int slot, bool undisplaced) const {
  if (point.instance == kNoId) return {};
  const bool was_moved = undisplaced && moved_by_[point.mesh] >= 0;
  const std::vector<Tangents>& slots = (was_moved ? undisplaced_tangents_ : tangents_)[point.mesh];
  if (slots.empty() || !slots[size_t(slot)] || slots[size_t(slot)]->empty()) return {};
  const CornerTangent* corner = slots[size_t(slot)]->data() + 3 * size_t(point.triangle);
  const float w[3] = {1.0f - point.b1 - point.b2, point.b1, point.b2};
  CornerTangent sum{Vec3{}, 0.0f};
  for (int k = 0; k < 3; ++k) sum.direction += w[k] * corner[k].direction, sum.side += w[k] * corner[k].side;
  return sum;
}

}  // namespace gi
