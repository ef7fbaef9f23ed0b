// Light subpaths' vertices of a whole pass, found by where they are: what eye vertices are merged with [Georgiev et al. 2012]. Smaller than
// those that are joined, since the eye's surface stands for theirs.
#pragma once
#include "transport/photon_map.h"

namespace gi {

struct MergeVertex {
  float power[3] = {0, 0, 0};  // watts
  PackedDirection wi, normal;  // towards where it came from; of the surface, on that side
  PartialWeights weights;
  uint32_t seen_by = 0;  // RayKind bits: what of the surface sees where the light comes from
  uint16_t total = 0, diffuse = 0, glossy = 0, transmission = 0, max_bounces = 0;  // on the way here; of the luminaire
  bool is_first = false;  // lit by the luminaire itself

  MergeVertex() = default;
  explicit MergeVertex(const LightVertex& v);
  BounceCount bounces() const { return {total, diffuse, glossy, transmission}; }
};

class LightMerge {
 public:
  LightMerge() = default;
  LightMerge(const RenderContext& context, const SubpathSettings& settings, int pass, int paths);

  size_t size() const { return vertices_.size(); }
  size_t memory_bytes() const { return vertices_.capacity() * sizeof(MergeVertex) + tree_.memory_bytes(); }
  int paths() const { return paths_; }

  // Calls f(vertex, its place, irradiance of that vertex if it is spread over the disc) for those on the surface around `position`.
  template <class F>
  void near(Vec3 position, Vec3 normal, float radius, const F& f) const {
    float radius_squared = sqr(radius);
    const float per_area = 1.0f / (float(paths_) * kPi * radius_squared);
    tree_.within(position, radius_squared, [&](uint32_t k, float) {
      const MergeVertex& v = vertices_[k];
      if (!of_one_surface(tree_.point(k) - position, v.normal.along(), normal, radius)) return;
      f(v, tree_.point(k), Rgb(v.power[0], v.power[1], v.power[2]) * per_area);
    });
  }

 private:
  std::vector<MergeVertex> vertices_;  // in the order of the tree
  PointTree tree_;
  int paths_ = 0;
};

}  // namespace gi
