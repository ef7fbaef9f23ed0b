// The media that a ray goes through: which objects it is inside of, how far it gets, what of a light arrives. Every object is filled
// alike all over. Leaves out the world's volume.
#pragma once
#include "shading/medium.h"
#include "transport/render_context.h"

namespace gi {

class Media {
 public:
  // The objects that `position` lies in.
  void begin_at(const Scene& scene, Vec3 position);
  // The ray passes the surface at `point` (which faces where it came from) and goes on along `direction`.
  void cross(const Scene& scene, const ShadingPoint& point, Vec3 direction);
  bool empty() const { return count_ == 0; }
  // All that fills the place, seen from `wo`.
  Medium at(const Scene& scene, Vec3 position, Vec3 wo, const PathState& path) const;
  // What passes along a shadow ray, surfaces left out.
  Rgb transmittance(const Scene& scene, const Ray& ray, const PathState& path) const;

 private:
  struct Inside {
    uint32_t instance;
    int material;
  };
  void set(const Scene& scene, uint32_t instance, uint32_t triangle, bool inside);
  static constexpr int kMost = 8;
  Inside inside_[kMost];
  int count_ = 0;
};

// How far a ray gets in a medium before it is scattered.
struct MediumEvent {
  float t = kInf;
  Rgb weight{1.0f};        // transmittance over density; where it is scattered σs is left out
  bool scattered = false;
};
MediumEvent sample_distance(const Medium& medium, float t_max, Rgb throughput, Vec2 u);

}  // namespace gi
