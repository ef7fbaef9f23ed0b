// Accel on Embree: one top-level scene; a mesh that is used once is attached to it directly, the others as instances.
#include "scene/accel.h"

#include <algorithm>
#include <atomic>

#include "core/check.h"
#include "scene/embree_api.h"

namespace gi {
namespace {

using namespace embree;

// What all_hits hands to Embree's filter callback. Embree passes our Context on, so it comes first.
struct CollectContext {
  Context context;
  std::vector<gi::Hit>* hits;
};

void collect_hit(const FilterArguments* a) {
  const auto* collect = reinterpret_cast<const CollectContext*>(a->context);
  const embree::Hit& h = *a->hit;
  const uint32_t instance = h.instance[0] != kInvalidId ? h.instance[0] : h.geometry;
  collect->hits->push_back({a->ray->t_far, instance, h.primitive, h.u, h.v});
  a->valid[0] = 0;  // go on
}

struct OneContext {
  Context context;
  uint32_t instance;
};

void keep_instance(const FilterArguments* a) {
  const auto* one = reinterpret_cast<const OneContext*>(a->context);
  const embree::Hit& h = *a->hit;
  if ((h.instance[0] != kInvalidId ? h.instance[0] : h.geometry) != one->instance) a->valid[0] = 0;
}

class EmbreeAccel final : public Accel {
 public:
  EmbreeAccel(const std::string& library, std::vector<AccelMesh> meshes, std::vector<AccelInstance> instances, int threads)
      : api_(load_embree(library)) {
    // Never one thread: TBB 2021.12 then leaves a worker that asks for work for ever, from the second device on.
    const std::string config = threads > 0 ? "threads=" + std::to_string(std::max(threads, 2)) : "";
    device_ = api_.NewDevice(config.c_str());
    if (!device_) throw DeviceError("Embree could not start (library " + library + ")");
    try {
      if (const std::string problem = probe(api_, device_); !problem.empty())
        throw DeviceError("the Embree library " + library + " does not fit: " + problem);
      const auto version = api_.GetDeviceProperty(device_, kVersion);
      description_ = library + " (Embree " + std::to_string(version / 10000) + "." + std::to_string(version / 100 % 100) + "." +
                     std::to_string(version % 100) + ")";
      api_.SetDeviceErrorFunction(device_, &EmbreeAccel::on_error, this);
      api_.SetDeviceMemoryMonitorFunction(device_, &EmbreeAccel::on_memory, this);
      build(meshes, instances);
      if (failed_) throw DeviceError("Embree could not build the scene: " + error_);
    } catch (...) {
      release();
      throw;
    }
  }
  ~EmbreeAccel() override { release(); }

  std::optional<gi::Hit> intersect(const gi::Ray& ray, uint32_t mask) const override {
    QueryArguments arguments;
    return nearest(ray, mask, arguments);
  }

  std::optional<gi::Hit> intersect_instance(const gi::Ray& ray, uint32_t instance) const override {
    OneContext one{{{kInvalidId}, {kInvalidId}}, instance};
    QueryArguments arguments;
    arguments.flags = kInvokeArgumentFilter;
    arguments.context = &one.context;
    arguments.filter = &keep_instance;
    return nearest(ray, 0xffffffffu, arguments);
  }

  bool occluded(const gi::Ray& ray, uint32_t mask) const override {
    embree::Ray r;
    fill(r, ray, mask);
    QueryArguments arguments;
    api_.Occluded1(top_, &r, &arguments);
    return r.t_far < 0.0f;
  }

  void all_hits(const gi::Ray& ray, uint32_t mask, std::vector<gi::Hit>& hits) const override {
    hits.clear();
    embree::Ray r;
    fill(r, ray, mask);
    CollectContext collect{{{kInvalidId}, {kInvalidId}}, &hits};
    QueryArguments arguments;
    arguments.flags = kInvokeArgumentFilter;
    arguments.context = &collect.context;
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

  size_t memory_bytes() const override { return size_t(std::max<ptrdiff_t>(bytes_, 0)); }
  std::string description() const override { return description_; }

 private:
  std::optional<gi::Hit> nearest(const gi::Ray& ray, uint32_t mask, QueryArguments& arguments) const {
    RayHit rh;
    fill(rh.ray, ray, mask);
    rh.hit.geometry = kInvalidId, rh.hit.instance[0] = kInvalidId;
    api_.Intersect1(top_, &rh, &arguments);
    if (rh.hit.geometry == kInvalidId) return {};
    const uint32_t instance = rh.hit.instance[0] != kInvalidId ? rh.hit.instance[0] : rh.hit.geometry;
    return gi::Hit{rh.ray.t_far, instance, rh.hit.primitive, rh.hit.u, rh.hit.v};
  }

  static void on_error(void* self, int code, const char* text) {
    auto* accel = static_cast<EmbreeAccel*>(self);
    accel->failed_ = true;
    accel->error_ = (text ? std::string(text) : std::string()) + " (code " + std::to_string(code) + ")";
  }
  static bool on_memory(void* self, ptrdiff_t bytes, bool) {
    static_cast<EmbreeAccel*>(self)->bytes_ += bytes;
    return true;
  }

  static void fill(embree::Ray& r, const gi::Ray& ray, uint32_t mask) {
    r = {ray.origin.x,
         ray.origin.y,
         ray.origin.z,
         ray.t_min,
         ray.direction.x,
         ray.direction.y,
         ray.direction.z,
         0.0f,
         ray.t_max,
         mask,
         0,
         0};
  }

  Geometry triangles(const AccelMesh& mesh) {
    Geometry g = api_.NewGeometry(device_, kTriangle);
    api_.SetSharedGeometryBuffer(g, kVertexBuffer, 0, kFloat3, mesh.positions, 0, 12, mesh.vertex_count);
    api_.SetSharedGeometryBuffer(g, kIndexBuffer, 0, kUint3, mesh.indices, 0, 12, mesh.triangle_count);
    return g;
  }
  void attach(Scene scene, Geometry geometry, uint32_t mask, uint32_t id) {
    api_.SetGeometryMask(geometry, mask);
    api_.CommitGeometry(geometry);
    api_.AttachGeometryByID(scene, geometry, id);
    api_.ReleaseGeometry(geometry);
  }

  void build(const std::vector<AccelMesh>& meshes, const std::vector<AccelInstance>& instances) {
    top_ = api_.NewScene(device_);
    bases_.resize(meshes.size(), nullptr);
    for (uint32_t i = 0; i < instances.size(); ++i) {
      const AccelInstance& instance = instances[i];
      const AccelMesh& mesh = meshes[instance.mesh];
      if (mesh.triangle_count == 0) continue;
      if (!instance.matrix) {
        attach(top_, triangles(mesh), instance.mask, i);
        continue;
      }
      Scene& base = bases_[instance.mesh];
      if (!base) {
        base = api_.NewScene(device_);
        attach(base, triangles(mesh), 0xffffffffu, 0);
        api_.CommitScene(base);
      }
      Geometry g = api_.NewGeometry(device_, kInstance);
      api_.SetGeometryInstancedScene(g, base);
      api_.SetGeometryTransform(g, 0, kFloat3x4RowMajor, &instance.matrix->m[0][0]);
      attach(top_, g, instance.mask, i);
    }
    api_.CommitScene(top_);
  }

  void release() {
    if (top_) api_.ReleaseScene(top_);
    for (Scene base : bases_)
      if (base) api_.ReleaseScene(base);
    if (device_) api_.ReleaseDevice(device_);
    top_ = nullptr, device_ = nullptr, bases_.clear();
  }

  const Api& api_;
  Device device_ = nullptr;
  Scene top_ = nullptr;
  std::vector<Scene> bases_;
  std::atomic<ptrdiff_t> bytes_{0};
  std::atomic<bool> failed_{false};
  std::string error_, description_;
};

}  // namespace

std::unique_ptr<Accel> build_accel(const std::string& library, std::vector<AccelMesh> meshes, std::vector<AccelInstance> instances,
                                   int threads) {
  return std::make_unique<EmbreeAccel>(library, std::move(meshes), std::move(instances), threads);
}

}  // namespace gi
