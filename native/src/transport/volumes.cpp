// Which objects are filled, and the bounds of those that are not alike all over.
#include "transport/volumes.h"

namespace gi {
namespace {

constexpr int kMostCells = 1 << 20;       // of all objects together
constexpr int kWorldBoxes = 12;  // the last is four thousand times the scene: rays along a layer of mist are long ones
constexpr int kWorldCells = 16;

// The rays by which a program may be asked, as far as it looks at them.
struct Views {
  std::vector<Vec3> towards{{0, 0, 1}};
  std::vector<PathState> paths{PathState{}};
  explicit Views(const Program& program) {
    if (program.sees_view()) towards = {{0, 0, 1}, {0, 0, -1}, {0, 1, 0}, {0, -1, 0}, {1, 0, 0}, {-1, 0, 0}};
    if (!program.sees_path()) return;
    for (const uint32_t kind : {kRayShadow, kRayDiffuse, kRayGlossy, kRayTransmission, kRayVolume}) {
      paths.push_back({});
      paths.back().kind = kind | (kind & (kRayDiffuse | kRayGlossy) ? kRayReflection : 0u);
      if (kind != kRayShadow) paths.back().depth = 1;
    }
  }
};

VolumeGrid make_grid(const Scene& scene, const Volume& volume, const Views& views, int cells, ThreadPool& pool) {
  const bool is_world = volume.instance == kNoId;
  const Instance* instance = is_world ? nullptr : &scene.instances()[volume.instance];
  Bounds bounds;
  float metres = 1.0f;
  if (is_world) {
    bounds = scene.bounds();
    if (bounds.empty()) bounds.add(Vec3{});
    const float half = std::max(0.5f * length(bounds.extent()), 1.0f);
    const Vec3 center = bounds.center(), h{half, half, half};
    bounds.add(center - h), bounds.add(center + h);
  } else {
    const MeshData& mesh = scene.mesh(instance->mesh);
    for (size_t v = 0; v < mesh.positions.size; v += 3) {
      const Vec3 p{mesh.positions[v], mesh.positions[v + 1], mesh.positions[v + 2]};
      if (is_finite(p)) bounds.add(instance->world_space ? instance->to_object.point(p) : p);
    }
    if (bounds.empty()) bounds.add(Vec3{});
    metres = std::cbrt(std::abs(instance->to_world.determinant()));
  }
  const auto look = [&](Vec3 p, const std::function<void(const Medium&)>& see) {
    const Vec3 position = instance ? instance->to_world.point(p) : p;
    for (const Vec3 wo : views.towards)
      for (const PathState& path : views.paths) {
        Medium medium;
        add_medium(scene, volume, position, wo, path, medium);
        see(medium);
      }
  };
  return VolumeGrid(bounds, is_world ? kWorldBoxes : 1, cells, metres, look, pool);
}

}  // namespace

Volumes::Volumes(const Scene& scene, ThreadPool& pool) {
  const auto program_of = [&](const Volume& v) -> const Program& { return scene.material(scene.material(v.material).volume).program; };
  const auto add = [&](uint32_t instance, int material) {
    Volume& v = volumes_.emplace_back();
    v.instance = instance, v.material = material;
  };
  for (uint32_t i = 0; i < scene.instances().size(); ++i) {
    first_.push_back(int(volumes_.size()));
    for (const int32_t material : scene.instances()[i].data->materials)
      if (scene.material(material).volume >= 0 &&
          std::none_of(volumes_.begin() + first_.back(), volumes_.end(), [&](const Volume& v) { return v.material == material; }))
        add(i, material);
  }
  first_.push_back(int(volumes_.size()));
  const int world = scene.data().world.program;
  if (world >= 0 && scene.material(world).volume >= 0) world_ = int(volumes_.size()), add(kNoId, world);

  for (Volume& v : volumes_) {
    v.only_absorbs = program_of(v).only_absorbs();
    any_only_absorbs_ = any_only_absorbs_ || v.only_absorbs;
  }
  const auto varies = [&](const Volume& v) { return program_of(v).varies_in_space(); };
  const auto count = std::count_if(volumes_.begin(), volumes_.end(), varies);
  if (count == 0) return;
  const int cells = std::clamp(int(std::cbrt(double(kMostCells) / double(count))), 2, 32);
  for (Volume& v : volumes_)
    if (varies(v)) v.grid = make_grid(scene, v, Views(program_of(v)), v.instance == kNoId ? kWorldCells : cells, pool);
}

int Volumes::find(uint32_t instance, int material) const {
  if (volumes_.empty()) return -1;
  for (int i = first_[instance]; i < first_[instance + 1]; ++i)
    if (volumes_[size_t(i)].material == material) return i;
  return -1;
}

void add_medium(const Scene& scene, const Volume& volume, Vec3 position, Vec3 wo, const PathState& path, Medium& medium) {
  ShadingPoint point;
  point.position = point.object_position = position;
  point.wo = point.ng = point.ns = wo;
  if (volume.instance != kNoId) {
    const Instance& instance = scene.instances()[volume.instance];
    point.object_position = instance.to_object.point(position);
    point.instance = volume.instance, point.mesh = instance.mesh, point.triangle = 0;
  }
  point.inside = true;
  point.path = path, point.path.ray_length = 0.0f;  // as in Cycles
  scene.add_medium(volume.material, point, medium);
}

}  // namespace gi
