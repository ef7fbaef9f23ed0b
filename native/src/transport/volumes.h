// The volumes of a scene, and within what bounds their programs keep: what tracking goes by (transport/media.h). Leaves out which of
// them a ray is in.
#pragma once
#include <optional>

#include "core/parallel.h"
#include "scene/scene.h"
#include "shading/medium.h"

namespace gi {

// For a part of space: the least that light meets there per metre, how much more there may be in any channel, and the most. Guesses from
// samples, which only noise depends on: tracking stays right where they are exceeded.
struct VolumeBounds {
  Rgb least;
  float spread = 0, most = 0;
};

// Bounds by cells in nested boxes, each twice as large as the one before; in the space of the volume's object. What lies beyond the last
// has the bounds of its border.
class VolumeGrid {
 public:
  // `medium(position, out)` gives what is there. One box for objects, more for the world.
  using Look = std::function<void(Vec3, const std::function<void(const Medium&)>&)>;
  VolumeGrid(const Bounds& innermost, int boxes, int cells, float metres_per_unit, const Look& look, ThreadPool& pool);

  // The bounds at `origin` + `direction` * t, and up to which t they hold.
  const VolumeBounds& at(Vec3 origin, Vec3 direction, float t, float& until) const;
  // Where a ray leaves the last box.
  float end(Vec3 origin, Vec3 direction) const;

 private:
  struct Box {
    Vec3 lo, hi, cell;  // metres, or what an object's space has
    std::vector<VolumeBounds> bounds;
  };
  int cells_;
  std::vector<Box> boxes_;
};

// What fills one object by one of its materials, or the world.
struct Volume {
  uint32_t instance = kNoId;  // kNoId: the world
  int material = -1;
  bool only_absorbs = false;
  std::optional<VolumeGrid> grid;  // nothing: alike all over
  bool is_uniform() const { return !grid; }
};

class Volumes {
 public:
  Volumes() : first_{} {}  // none
  Volumes(const Scene& scene, ThreadPool& pool);
  bool empty() const { return volumes_.empty(); }
  const Volume& operator[](int i) const { return volumes_[size_t(i)]; }
  bool any_only_absorbs() const { return any_only_absorbs_; }
  int world() const { return world_; }  // -1: the world is empty
  // The volume of `material` in an object; -1: none.
  int find(uint32_t instance, int material) const;
  // Rays that ended because it would have taken too long to find out how far they get.
  uint32_t rays_given_up() const { return given_up_; }
  void give_up() const { given_up_.fetch_add(1, std::memory_order_relaxed); }

 private:
  std::vector<Volume> volumes_;
  std::vector<int> first_;  // of each instance; one more at the end
  int world_ = -1;
  bool any_only_absorbs_ = false;
  mutable std::atomic<uint32_t> given_up_{0};
};

// Adds what fills `volume` at `position`, seen from `wo`.
void add_medium(const Scene& scene, const Volume& volume, Vec3 position, Vec3 wo, const PathState& path, Medium& medium);

}  // namespace gi
