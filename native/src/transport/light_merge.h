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

// Which vertices are merged: those of a pass's own light paths, within a radius that shrinks from pass to pass.
struct MergeSettings {
  int paths = 0;  // at most, and no more than pixels; 0: none
  float radius = 0;  // in the first pass, pixels
  double alpha = 1;
  bool alone = false;  // nothing else: photon mapping
};

class LightMerge {
 public:
  explicit LightMerge(const MergeSettings& settings) : settings_(settings) {}
  bool is_on() const { return settings_.paths > 0; }
  bool is_alone() const { return settings_.alone; }
  float radius() const { return radius_; }  // of this pass, pixels

  // Sets the radius, and what merging weighs by it (`subpaths.merges`), and sends out what eye vertices of this pass will be merged with.
  // These paths are not those that are joined, so there may be as many as wished; they aim at what is seen and other ways leave to them.
  void begin_pass(const RenderContext& context, int pass, const Film& film, SubpathSettings& subpaths);

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
  void learn(const RenderContext& context, int pass, const Film& film, const SubpathSettings& subpaths);
  void send(const RenderContext& context, int pass, const SubpathSettings& subpaths);

  MergeSettings settings_;
  float radius_ = 0;
  int paths_ = 0;
  EmissionLearner aim_;
  SeenPoints seen_;
  std::vector<MergeVertex> vertices_;  // of this pass, in the order of the tree
  PointTree tree_;
};

}  // namespace gi
