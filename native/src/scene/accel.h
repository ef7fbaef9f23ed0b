// Ray tracing against triangles, curves and spheres: the only place that knows Embree.
#pragma once
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "scene/strands.h"

namespace gi {

struct Hit {
  float t = kInf;
  uint32_t instance = 0xffffffffu, triangle = 0xffffffffu;
  float b1 = 0, b2 = 0;
};

// A mesh as Embree sees it: buffers are shared, the owners keep them alive; `positions` readable 4 bytes past its end.
struct AccelMesh {
  const float* positions = nullptr;
  size_t vertex_count = 0;
  const uint32_t* indices = nullptr;
  size_t triangle_count = 0;
  std::shared_ptr<void> positions_owner, indices_owner;
  std::shared_ptr<const Strands> strands;  // instead of triangles; such meshes stay in object space
  int subdivisions = 0;
  bool empty() const { return strands ? strands->count() == 0 : triangle_count == 0; }
};

struct AccelInstance {
  uint32_t mesh = 0;
  const Affine* matrix = nullptr;  // null: the mesh is in world space and goes into the top level itself
  uint32_t mask = 0xffffffffu;     // a ray sees the instance if (mask & ray mask) != 0
};

class Accel {
 public:
  virtual ~Accel() = default;
  virtual std::optional<Hit> intersect(const Ray& ray, uint32_t mask) const = 0;
  virtual bool occluded(const Ray& ray, uint32_t mask) const = 0;
  // Every hit along the ray, nearest first, each once.
  virtual void all_hits(const Ray& ray, uint32_t mask, std::vector<Hit>& hits) const = 0;
  // As intersect, but of one instance alone, whoever sees it.
  virtual std::optional<Hit> intersect_instance(const Ray& ray, uint32_t instance) const = 0;
  virtual size_t memory_bytes() const = 0;
  virtual std::string description() const = 0;  // file and version of Embree
};

// Loads Embree from `library`, checks that it is laid out as we think, builds in `threads` threads (0: all cores).
// `mesh_before`: which mesh of `before` each mesh is, buffers and all, so that its tree serves again where there is one; -1: none.
// Throws DeviceError.
std::unique_ptr<Accel> build_accel(const std::string& library, std::vector<AccelMesh> meshes, std::vector<AccelInstance> instances,
                                   int threads, const Accel* before = nullptr, std::span<const int32_t> mesh_before = {});

}  // namespace gi
