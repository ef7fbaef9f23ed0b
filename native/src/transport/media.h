// The media that a ray goes through: which volumes it is in, how far it gets, what of a light arrives. Where all are alike all over, in
// closed form; else by tracking, whose random numbers are the caller's.
#pragma once
#include "core/sampler.h"
#include "shading/medium.h"
#include "transport/volumes.h"

namespace gi {

// Where a ray through media comes to.
struct MediumEvent {
  float t = kInf;
  bool scattered = false;
  Medium medium;     // where it is scattered
  Rgb weight{1.0f};  // of the path; where it is scattered σs is left out
  Rgb emitted;       // on the way, as it arrives at the ray's origin
};

class Media {
 public:
  // `only_absorbing`: of those that scatter or glow nothing is seen.
  explicit Media(const Volumes& volumes, bool only_absorbing = false) : volumes_(&volumes), only_absorbing_(only_absorbing) { reset(); }
  // Those that `position` lies in, as seen along `direction`.
  void begin_at(const Scene& scene, Vec3 position, Vec3 direction = {0, 0, 1});
  // The ray passes the surface at `point` (which faces where it came from) and goes on along `direction`.
  void cross(const Scene& scene, const ShadingPoint& point, Vec3 direction);
  bool empty() const { return count_ == 0; }

  // A ray up to t_max: scattered on the way or not. `throughput` decides between the channels.
  MediumEvent sample(const Scene& scene, const Ray& ray, float t_max, Rgb throughput, bool may_scatter, const PathState& path,
                     Sampler& random) const;
  // What passes along a ray that meets no surface up to t_max.
  Rgb transmittance(const Scene& scene, const Ray& ray, float t_max, const PathState& path, Sampler& random) const;
  // What passes along a ray, surfaces left out.
  Rgb transmittance_through(const Scene& scene, const Ray& ray, const PathState& path, Sampler& random) const;

 private:
  // One ray, while it stays in these media.
  class Way;
  void reset();
  void set(const Scene& scene, uint32_t instance, uint32_t triangle, bool inside);
  static constexpr int kMost = 8;
  const Volumes* volumes_;
  bool only_absorbing_;
  int inside_[kMost];  // of Volumes
  int count_ = 0;
};

}  // namespace gi
