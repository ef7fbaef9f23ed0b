// The part of Embree 4's C interface that we use, declared by hand (docs/decisions/embree.md says why) and loaded at run
// time. Layouts are those of Embree 4.3 and later with one instance level and instance arrays; load_embree probes them.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>

namespace gi::embree {

struct DeviceImpl;
struct SceneImpl;
struct GeometryImpl;
using Device = DeviceImpl*;
using Scene = SceneImpl*;
using Geometry = GeometryImpl*;

inline constexpr uint32_t kInvalidId = 0xffffffffu;
enum Format : int { kUint = 0x5001, kUint3 = 0x5003, kFloat3 = 0x9003, kFloat4 = 0x9004, kFloat3x4RowMajor = 0x9134 };
enum BufferType : int { kIndexBuffer = 0, kVertexBuffer = 1 };
enum GeometryType : int {
  kTriangle = 0,
  kRoundLinearCurve = 16,
  kSpherePoint = 50,
  kRoundCatmullRomCurve = 58,
  kFlatCatmullRomCurve = 59,
  kInstance = 121
};
enum BuildQuality : int { kLow = 0, kMedium = 1 };
enum SceneFlags : int { kNoFlags = 0, kRobust = 4 };
enum QueryFlags : int { kIncoherent = 0, kInvokeArgumentFilter = 1 << 1 };
enum DeviceProperty : int { kVersion = 0 };

struct alignas(16) Ray {
  float ox, oy, oz, t_near, dx, dy, dz, time, t_far;
  uint32_t mask, id, flags;
};
struct alignas(16) Hit {
  float ng_x, ng_y, ng_z, u, v;
  uint32_t primitive, geometry, instance[1], instance_primitive[1];
};
struct RayHit {
  Ray ray;
  Hit hit;
};
struct alignas(16) Bounds {
  float lower[4], upper[4];
};
struct Context {
  uint32_t instance[1], instance_primitive[1];
};
struct FilterArguments {
  int* valid;
  void* user;
  Context* context;
  Ray* ray;
  Hit* hit;
  uint32_t count;
};
using Filter = void (*)(const FilterArguments*);
struct QueryArguments {
  QueryFlags flags = kIncoherent;
  uint32_t features = 0xffffffffu;
  Context* context = nullptr;
  Filter filter = nullptr;
  void* user_geometry = nullptr;
};
using ErrorFunction = void (*)(void*, int, const char*);
using MemoryFunction = bool (*)(void*, ptrdiff_t, bool);

// X(name, result, arguments)
#define GI_EMBREE_FUNCTIONS(X)                                                                          \
  X(NewDevice, Device, (const char*))                                                                   \
  X(ReleaseDevice, void, (Device))                                                                      \
  X(GetDeviceProperty, ptrdiff_t, (Device, int))                                                        \
  X(GetDeviceError, int, (Device))                                                                      \
  X(SetDeviceErrorFunction, void, (Device, ErrorFunction, void*))                                       \
  X(SetDeviceMemoryMonitorFunction, void, (Device, MemoryFunction, void*))                              \
  X(NewScene, Scene, (Device))                                                                          \
  X(ReleaseScene, void, (Scene))                                                                        \
  X(SetSceneFlags, void, (Scene, int))                                                                  \
  X(SetSceneBuildQuality, void, (Scene, int))                                                           \
  X(CommitScene, void, (Scene))                                                                         \
  X(AttachGeometryByID, void, (Scene, Geometry, uint32_t))                                              \
  X(NewGeometry, Geometry, (Device, int))                                                               \
  X(ReleaseGeometry, void, (Geometry))                                                                  \
  X(CommitGeometry, void, (Geometry))                                                                   \
  X(SetGeometryMask, void, (Geometry, uint32_t))                                                        \
  X(SetSharedGeometryBuffer, void, (Geometry, int, uint32_t, int, const void*, size_t, size_t, size_t)) \
  X(SetGeometryTessellationRate, void, (Geometry, float))                                               \
  X(SetGeometryUserData, void, (Geometry, void*))                                                       \
  X(SetGeometryIntersectFilterFunction, void, (Geometry, Filter))                                       \
  X(SetGeometryOccludedFilterFunction, void, (Geometry, Filter))                                        \
  X(SetGeometryInstancedScene, void, (Geometry, Scene))                                                 \
  X(SetGeometryTransform, void, (Geometry, uint32_t, int, const void*))                                 \
  X(Intersect1, void, (Scene, RayHit*, QueryArguments*))                                                \
  X(Occluded1, void, (Scene, Ray*, QueryArguments*))

struct Api {
#define GI_EMBREE_POINTER(name, result, arguments) result(*name) arguments = nullptr;
  GI_EMBREE_FUNCTIONS(GI_EMBREE_POINTER)
#undef GI_EMBREE_POINTER
};

// The library at `path`, opened so that it uses its own TBB even inside a program that has another one. Each path is
// opened once and stays open. Throws DeviceError.
const Api& load_embree(const std::string& path);
// "" if the library lays its structures out as declared here, else what is wrong.
std::string probe(const Api& api, Device device);

}  // namespace gi::embree
