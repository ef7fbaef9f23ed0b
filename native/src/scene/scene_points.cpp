// Scene: what is known of a point that a ray meets.
#include <algorithm>

#include "scene/scene.h"

namespace gi {

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
  if (!mesh.shades_flat(triangle)) {
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
  ShadingPoint p = strands_[instances_[hit.instance].mesh]
                       ? strand_point(hit, ray.origin + ray.direction * hit.t, -ray.direction, path, footprint)
                       : surface_point(hit.instance, hit.triangle, hit.b1, hit.b2, -ray.direction, path, footprint);
  p.path.ray_length = hit.t;
  return p;
}

Vec3 Scene::shadow_origin(const ShadingPoint& point, Vec3 wi) const {
  const Instance& placed = instances_[point.instance];
  const MeshData& mesh = data_.meshes[placed.mesh];
  const float cutoff = placed.data->shadow_terminator_geometry_offset;
  if (!(cutoff > 0.0f) || point.strand != kNoId || mesh.shades_flat(point.triangle)) return point.position;
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

namespace {

// On curves, along their segments: what is of a face belongs to the whole strand.
void interpolate_strand(const Strands& strands, const AttributeData& a, const ShadingPoint& point, float out[4]) {
  const size_t n = size_t(a.components);
  const bool of_whole = a.domain == Domain::kFace;
  const float* first = a.data.data + n * size_t(of_whole ? point.strand : strands.first_vertex(point.triangle));
  for (size_t c = 0; c < n; ++c) out[c] = of_whole || strands.are_points() ? first[c] : lerp(first[c], first[c + n], point.b1);
}

}  // namespace

void Scene::interpolate(uint32_t m, const AttributeData& a, const ShadingPoint& point, float out[4]) const {
  const MeshData& mesh = data_.meshes[m];
  const size_t n = size_t(a.components);
  if (const Strands* strands = strands_[m].get()) return interpolate_strand(*strands, a, point, out);
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
  if (point.strand != kNoId) return normalize(placed.to_world.transposed_vector(point.ns));
  const Vec3 flat = normalize(placed.to_world.transposed_vector(point.backfacing ? -point.ng : point.ng));
  if (mesh.shades_flat(point.triangle)) return flat;
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
