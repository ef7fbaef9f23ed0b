// Accel on Embree: one top-level scene; meshes in world space are attached to it directly, the others as instances of scenes of their own,
// which further Accels may share.
#include "scene/accel.h"

#include <algorithm>
#include <atomic>

#include "core/check.h"
#include "scene/embree_api.h"

namespace gi {
namespace {

using namespace embree;

// Embree passes our Context on, so it comes first.
struct RayContext {
  Context context{{kInvalidId}, {kInvalidId}};
  uint32_t left_instance = kInvalidId, left_strand = kInvalidId;  // read where the ray says kLeavesStrand
};

enum RayId : uint32_t { kLeavesSurface, kLeavesStrand };

// What all_hits hands to Embree's filter callback.
struct CollectContext {
  RayContext ray;
  std::vector<gi::Hit>* hits;
  float back;
};

uint32_t instance_of(const embree::Hit& h) { return h.instance[0] != kInvalidId ? h.instance[0] : h.geometry; }

// What leaves a strand never meets that one again, as in Cycles: there, too, a strand scatters as a whole.
void skip_own_strand(const FilterArguments* a) {
  if (a->ray->id != kLeavesStrand) return;
  const auto* ray = reinterpret_cast<const RayContext*>(a->context);
  const uint32_t* strands = static_cast<const uint32_t*>(a->user);  // null: points
  const uint32_t primitive = a->hit->primitive;
  if (ray->left_instance == instance_of(*a->hit) && ray->left_strand == (strands ? strands[primitive] : primitive)) a->valid[0] = 0;
}

// Spheres and straight tubes, which are closed, are there from outside alone, however Embree was built.
void skip_inside(const FilterArguments* a) {
  const embree::Hit& h = *a->hit;
  const embree::Ray& r = *a->ray;
  if (h.ng_x * r.dx + h.ng_y * r.dy + h.ng_z * r.dz > 0.0f)
    a->valid[0] = 0;
  else
    skip_own_strand(a);
}

void collect_hit(const FilterArguments* a) {
  const auto* collect = reinterpret_cast<const CollectContext*>(a->context);
  const embree::Hit& h = *a->hit;
  collect->hits->push_back({a->ray->t_far - collect->back, instance_of(h), h.primitive, h.u, h.v});
  a->valid[0] = 0;  // go on
}

struct OneContext {
  RayContext ray;
  uint32_t instance;
};

void keep_instance(const FilterArguments* a) {
  const auto* one = reinterpret_cast<const OneContext*>(a->context);
  if (instance_of(*a->hit) != one->instance) a->valid[0] = 0;
}

// Embree itself, for all Accels that share trees.
struct SharedDevice {
  const Api& api;
  Device device = nullptr;
  std::atomic<ptrdiff_t> bytes{0};
  std::atomic<bool> failed{false};
  std::string error, description;

  SharedDevice(const std::string& library, int threads) : api(load_embree(library)) {
    // Never one thread: TBB 2021.12 then leaves a worker that asks for work for ever, from the second device on.
    const std::string config = threads > 0 ? "threads=" + std::to_string(std::max(threads, 2)) : "";
    device = api.NewDevice(config.c_str());
    if (!device) throw DeviceError("Embree could not start (library " + library + ")");
    if (const std::string problem = probe(api, device); !problem.empty()) {
      api.ReleaseDevice(device);
      throw DeviceError("the Embree library " + library + " does not fit: " + problem);
    }
    const auto version = api.GetDeviceProperty(device, kVersion);
    description = library + " (Embree " + std::to_string(version / 10000) + "." + std::to_string(version / 100 % 100) + "." +
                  std::to_string(version % 100) + ")";
    api.SetDeviceErrorFunction(device, &SharedDevice::on_error, this);
    api.SetDeviceMemoryMonitorFunction(device, &SharedDevice::on_memory, this);
  }
  SharedDevice(const SharedDevice&) = delete;
  ~SharedDevice() { api.ReleaseDevice(device); }

  static void on_error(void* self, int code, const char* text) {
    auto* shared = static_cast<SharedDevice*>(self);
    shared->failed = true;
    shared->error = (text ? std::string(text) : std::string()) + " (code " + std::to_string(code) + ")";
  }
  static bool on_memory(void* self, ptrdiff_t bytes, bool) {
    static_cast<SharedDevice*>(self)->bytes += bytes;
    return true;
  }

  Geometry geometry(const AccelMesh& mesh) const { return mesh.strands ? strands(mesh) : triangles(mesh); }

  Geometry triangles(const AccelMesh& mesh) const {
    Geometry g = api.NewGeometry(device, kTriangle);
    api.SetSharedGeometryBuffer(g, kVertexBuffer, 0, kFloat3, mesh.positions, 0, 12, mesh.vertex_count);
    api.SetSharedGeometryBuffer(g, kIndexBuffer, 0, kUint3, mesh.indices, 0, 12, mesh.triangle_count);
    return g;
  }
  Geometry strands(const AccelMesh& mesh) const {
    const Strands& all = *mesh.strands;
    static constexpr GeometryType kTypes[] = {kTriangle, kFlatCatmullRomCurve, kRoundCatmullRomCurve, kRoundLinearCurve, kSpherePoint};
    Geometry g = api.NewGeometry(device, kTypes[int(all.primitive())]);
    api.SetSharedGeometryBuffer(g, kVertexBuffer, 0, kFloat4, all.vertices().data(), 0, 16, all.vertices().size() / 4);
    if (!all.are_points()) {
      api.SetSharedGeometryBuffer(g, kIndexBuffer, 0, kUint, all.segments().data(), 0, 4, all.segments().size());
      // As Cycles has them cut.
      api.SetGeometryTessellationRate(g, float(std::min(1 << mesh.subdivisions, 16) + 1));
      api.SetGeometryUserData(g, const_cast<uint32_t*>(all.strand_of_segments().data()));
    }
    const bool is_spline = all.is_ribbon() || all.primitive() == Primitive::kThick;
    const Filter filter = is_spline ? &skip_own_strand : &skip_inside;
    api.SetGeometryIntersectFilterFunction(g, filter);
    api.SetGeometryOccludedFilterFunction(g, filter);
    return g;
  }
  void attach(Scene scene, Geometry geometry, uint32_t mask, uint32_t id) const {
    api.SetGeometryMask(geometry, mask);
    api.CommitGeometry(geometry);
    api.AttachGeometryByID(scene, geometry, id);
    api.ReleaseGeometry(geometry);
  }
};

// The tree over one mesh in object space.
struct MeshTree {
  std::shared_ptr<const SharedDevice> shared;
  AccelMesh mesh;
  Scene scene = nullptr;

  MeshTree(std::shared_ptr<const SharedDevice> device, const AccelMesh& m) : shared(std::move(device)), mesh(m) {
    scene = shared->api.NewScene(shared->device);
    shared->attach(scene, shared->geometry(mesh), 0xffffffffu, 0);
    shared->api.CommitScene(scene);
  }
  MeshTree(const MeshTree&) = delete;
  ~MeshTree() { shared->api.ReleaseScene(scene); }
};

// Embree misses ribbons that are nearer to a ray's origin than twice their radius, which may swing between the points of a spline. So does
// Cycles, but not where a ray goes straight on: there it is still the same ray.
constexpr float kRibbonsBegin = 2.0f * 1.3f;

// No less than what the matrix makes of any unit vector.
float largest_scale(const Affine& a) {
  float sum = 0;
  for (const auto& row : a.m) sum += row[0] * row[0] + row[1] * row[1] + row[2] * row[2];
  return std::sqrt(sum);
}

class EmbreeAccel final : public Accel {
 public:
  EmbreeAccel(const std::string& library, std::vector<AccelMesh> meshes, std::vector<AccelInstance> instances, int threads,
              const EmbreeAccel* before, std::span<const int32_t> mesh_before)
      : shared_(before ? before->shared_ : std::make_shared<SharedDevice>(library, threads)),
        api_(shared_->api),
        meshes_(std::move(meshes)) {
    shared_->failed = false;
    trees_.resize(meshes_.size());
    for (size_t m = 0; before && m < mesh_before.size(); ++m)
      if (mesh_before[m] >= 0) trees_[m] = before->trees_[size_t(mesh_before[m])];
    build(instances);
    if (shared_->failed) {
      api_.ReleaseScene(top_);
      throw DeviceError("Embree could not build the scene: " + shared_->error);
    }
  }
  ~EmbreeAccel() override { api_.ReleaseScene(top_); }

  std::optional<gi::Hit> intersect(const gi::Ray& ray, uint32_t mask) const override {
    QueryArguments arguments;
    RayContext leaves;
    say_what_it_leaves(ray, leaves, arguments);
    return nearest(ray, mask, arguments);
  }

  std::optional<gi::Hit> intersect_instance(const gi::Ray& ray, uint32_t instance) const override {
    OneContext one{{}, instance};
    QueryArguments arguments;
    say_what_it_leaves(ray, one.ray, arguments);
    arguments.flags = kInvokeArgumentFilter;
    arguments.context = &one.ray.context;
    arguments.filter = &keep_instance;
    return nearest(ray, 0xffffffffu, arguments);
  }

  bool occluded(const gi::Ray& ray, uint32_t mask) const override {
    embree::Ray r;
    fill(r, ray, mask);
    QueryArguments arguments;
    RayContext leaves;
    say_what_it_leaves(ray, leaves, arguments);
    api_.Occluded1(top_, &r, &arguments);
    return r.t_far < 0.0f;
  }

  void all_hits(const gi::Ray& ray, uint32_t mask, std::vector<gi::Hit>& hits) const override {
    hits.clear();
    embree::Ray r;
    fill(r, ray, mask);
    CollectContext collect{{}, &hits, back_of(ray)};
    QueryArguments arguments;
    say_what_it_leaves(ray, collect.ray, arguments);
    arguments.flags = kInvokeArgumentFilter;
    arguments.context = &collect.ray.context;
    arguments.filter = &collect_hit;
    api_.Occluded1(top_, &r, &arguments);
    // Order and uniqueness must not depend on how the tree happens to be walked.
    const auto before = [](const gi::Hit& a, const gi::Hit& b) {
      return a.t != b.t ? a.t < b.t : a.instance != b.instance ? a.instance < b.instance : a.triangle < b.triangle;
    };
    const auto same = [](const gi::Hit& a, const gi::Hit& b) { return a.instance == b.instance && a.triangle == b.triangle; };
    std::sort(hits.begin(), hits.end(), before);
    hits.erase(std::unique(hits.begin(), hits.end(), same), hits.end());
  }

  size_t memory_bytes() const override { return size_t(std::max<ptrdiff_t>(shared_->bytes, 0)); }
  std::string description() const override { return shared_->description; }

 private:
  std::optional<gi::Hit> nearest(const gi::Ray& ray, uint32_t mask, QueryArguments& arguments) const {
    RayHit rh;
    fill(rh.ray, ray, mask);
    rh.hit.geometry = kInvalidId, rh.hit.instance[0] = kInvalidId;
    api_.Intersect1(top_, &rh, &arguments);
    if (rh.hit.geometry == kInvalidId) return {};
    return gi::Hit{rh.ray.t_far - back_of(ray), instance_of(rh.hit), rh.hit.primitive, rh.hit.u, rh.hit.v};
  }

  static void say_what_it_leaves(const gi::Ray& ray, RayContext& leaves, QueryArguments& arguments) {
    if (ray.left_strand == kInvalidId) return;
    leaves.left_instance = ray.left_instance, leaves.left_strand = ray.left_strand;
    arguments.context = &leaves.context;
  }

  void fill(embree::Ray& r, const gi::Ray& ray, uint32_t mask) const {
    const float back = back_of(ray);
    const Vec3 origin = back > 0.0f ? ray.origin - ray.direction * back : ray.origin;
    r = {origin.x,
         origin.y,
         origin.z,
         ray.t_min + back,
         ray.direction.x,
         ray.direction.y,
         ray.direction.z,
         0.0f,
         ray.t_max + back,
         mask,
         ray.left_strand == kInvalidId ? kLeavesSurface : kLeavesStrand,
         0};
  }

  float back_of(const gi::Ray& ray) const { return ray.goes_on ? back_ : 0.0f; }

  void build(const std::vector<AccelInstance>& instances) {
    top_ = api_.NewScene(shared_->device);
    for (uint32_t i = 0; i < instances.size(); ++i) {
      const AccelInstance& instance = instances[i];
      const AccelMesh& mesh = meshes_[instance.mesh];
      if (mesh.empty()) continue;
      if (mesh.strands && mesh.strands->is_ribbon())
        back_ =
            std::max(back_, kRibbonsBegin * mesh.strands->largest_radius() * (instance.matrix ? largest_scale(*instance.matrix) : 1.0f));
      if (!instance.matrix) {
        shared_->attach(top_, shared_->triangles(mesh), instance.mask, i);
        continue;
      }
      std::shared_ptr<const MeshTree>& tree = trees_[instance.mesh];
      if (!tree) tree = std::make_shared<const MeshTree>(shared_, mesh);
      Geometry g = api_.NewGeometry(shared_->device, kInstance);
      api_.SetGeometryInstancedScene(g, tree->scene);
      api_.SetGeometryTransform(g, 0, kFloat3x4RowMajor, &instance.matrix->m[0][0]);
      shared_->attach(top_, g, instance.mask, i);
    }
    api_.CommitScene(top_);
  }

  std::shared_ptr<SharedDevice> shared_;
  const Api& api_;
  std::vector<AccelMesh> meshes_;
  std::vector<std::shared_ptr<const MeshTree>> trees_;  // by mesh; null where none was needed
  Scene top_ = nullptr;
  float back_ = 0;  // metres: where rays that go on begin, before their origin
};

}  // namespace

std::unique_ptr<Accel> build_accel(const std::string& library, std::vector<AccelMesh> meshes, std::vector<AccelInstance> instances,
                                   int threads, const Accel* before, std::span<const int32_t> mesh_before) {
  return std::make_unique<EmbreeAccel>(library, std::move(meshes), std::move(instances), threads, static_cast<const EmbreeAccel*>(before),
                                       mesh_before);
}

}  // namespace gi
