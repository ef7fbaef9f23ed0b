// Opening Embree at run time and checking that its binary interface is the one declared in embree_api.h.
#include <cstring>
#include <map>
#include <mutex>

#include "core/check.h"
#include "scene/embree_api.h"
#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#define NOMINMAX
#include <windows.h>

#include <filesystem>
#else
#include <dlfcn.h>
#endif

namespace gi::embree {
namespace {

#ifdef _WIN32
void* open_library(const std::string& path) {
  // The library's own folder comes first, so that its sibling tbb12.dll is the one that is found.
  const std::wstring wide = std::filesystem::u8path(path).wstring();
  HMODULE handle = LoadLibraryExW(wide.c_str(), nullptr, LOAD_LIBRARY_SEARCH_DLL_LOAD_DIR | LOAD_LIBRARY_SEARCH_DEFAULT_DIRS);
  if (!handle) throw DeviceError("cannot load Embree from " + path + ": error " + std::to_string(GetLastError()));
  return reinterpret_cast<void*>(handle);
}
void* find_symbol(void* handle, const char* name) {
  return reinterpret_cast<void*>(GetProcAddress(reinterpret_cast<HMODULE>(handle), name));
}
#else
void* open_library(const std::string& path) {
  int flags = RTLD_NOW | RTLD_LOCAL;
#ifdef RTLD_DEEPBIND
  flags |= RTLD_DEEPBIND;  // its own rtc* and TBB symbols before those of the program that hosts us
#endif
  void* handle = dlopen(path.c_str(), flags);
  if (!handle) throw DeviceError("cannot load Embree from " + path + ": " + dlerror());
  return handle;
}
void* find_symbol(void* handle, const char* name) { return dlsym(handle, name); }
#endif

}  // namespace

const Api& load_embree(const std::string& path) {
  static std::mutex mutex;
  static std::map<std::string, Api> opened;
  const std::lock_guard lock(mutex);
  if (const auto it = opened.find(path); it != opened.end()) return it->second;
  void* handle = open_library(path);
  Api api;
#define GI_EMBREE_RESOLVE(name, result, arguments)                                     \
  {                                                                                    \
    void* symbol = find_symbol(handle, "rtc" #name);                                   \
    if (!symbol) throw DeviceError("the Embree library " + path + " lacks rtc" #name); \
    std::memcpy(&api.name, &symbol, sizeof symbol);                                    \
  }
  GI_EMBREE_FUNCTIONS(GI_EMBREE_RESOLVE)
#undef GI_EMBREE_RESOLVE
  return opened.emplace(path, api).first->second;
}

std::string probe(const Api& api, Device device) {
  const ptrdiff_t version = api.GetDeviceProperty(device, kVersion);
  if (version < 40300 || version >= 50000) return "version " + std::to_string(version) + " is not 4.3 to 4.x";
  // One triangle in the z = 0 plane, by itself and as instance 7; one ray at each, with guard words behind the record.
  static const float vertices[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0};
  static const uint32_t indices[3] = {0, 1, 2};
  const float identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  Scene base = api.NewScene(device), top = api.NewScene(device);
  Geometry triangle = api.NewGeometry(device, kTriangle), instance = api.NewGeometry(device, kInstance);
  api.SetSharedGeometryBuffer(triangle, kVertexBuffer, 0, kFloat3, vertices, 0, 12, 3);
  api.SetSharedGeometryBuffer(triangle, kIndexBuffer, 0, kUint3, indices, 0, 12, 1);
  api.CommitGeometry(triangle);
  api.AttachGeometryByID(base, triangle, 0);
  api.CommitScene(base);
  api.SetGeometryInstancedScene(instance, base);
  api.SetGeometryTransform(instance, 0, kFloat3x4RowMajor, identity);
  api.CommitGeometry(instance);
  api.AttachGeometryByID(top, instance, 7);
  api.CommitScene(top);

  std::string problem;
  const auto shoot = [&](Scene scene, uint32_t want_instance, uint32_t want_primitive) {
    struct {
      RayHit record;
      uint32_t guard[8];
    } b;
    std::memset(&b, 0xa5, sizeof b);
    b.record.ray = Ray{0.25f, 0.25f, 1, 0, 0, 0, -1, 0, 10, 0xffffffffu, 0, 0};
    b.record.hit.geometry = kInvalidId, b.record.hit.instance[0] = kInvalidId;
    api.Intersect1(scene, &b.record, nullptr);
    const Hit& hit = b.record.hit;
    if (hit.geometry != 0 || hit.primitive != 0 || !(b.record.ray.t_far > 0.9999f && b.record.ray.t_far < 1.0001f))
      problem = "the probe ray missed its triangle";
    else if (hit.instance[0] != want_instance || hit.instance_primitive[0] != want_primitive)
      problem = "hit records are laid out otherwise (instance levels or instance arrays)";
    for (const uint32_t word : b.guard)
      if (word != 0xa5a5a5a5u) problem = "hit records are longer than declared";
  };
  shoot(base, kInvalidId, kInvalidId);
  shoot(top, 7, 0);
  api.ReleaseGeometry(triangle), api.ReleaseGeometry(instance);
  api.ReleaseScene(top), api.ReleaseScene(base);
  return problem;
}

}  // namespace gi::embree
