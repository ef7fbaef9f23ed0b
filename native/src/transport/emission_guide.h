// Sends more light where it matters: learns from trial paths which of the random numbers that light starts with lead to what the eye sees,
// and draws those more often: a tree of boxes in their cube. Nothing is lost: weights make up for it. [Peter & Pietrek 1998]
#pragma once
#include <array>
#include <vector>

#include "core/point_tree.h"

namespace gi {

// The random numbers by which light starts, as LightSet::emit takes them: choice, place, direction.
constexpr size_t kEmissionAxes = 5;
using EmissionNumbers = std::array<float, kEmissionAxes>;

class EmissionGuide {
 public:
  struct Trial {
    EmissionNumbers u;
    float worth;  // what the path brings, over the density that it was drawn with
  };

  EmissionGuide() = default;  // changes nothing
  // `even`: the share that is drawn evenly all the same.
  explicit EmissionGuide(std::vector<Trial> trials, float even = kEven);

  // Turns even numbers into ones of the learnt density, and returns 1 / density. That is never below `even`: nothing is ruled out.
  float warp(EmissionNumbers& u) const;
  static constexpr float kEven = 0.15f;

 private:
  struct Node {
    uint32_t first = 0;  // of two children; 0: none
    uint32_t axis = 0;   // that they halve
    float lower = 0.5f;  // the first child's share
    float over[2] = {2, 2};  // 1 over each one's share
  };
  struct Builder;
  std::vector<Node> nodes_;
};

// What the eye sees by way of anything but diffuse surfaces: points on diffuse ones, and how far apart they are.
class SeenPoints {
 public:
  SeenPoints() = default;
  SeenPoints(const std::vector<Vec3>& points, ThreadPool& pool);
  bool near(Vec3 position) const { return density(position) > 0.0f; }
  float density(Vec3 position) const;  // 1/m², of points, but for a factor; 0 where none is near

 private:
  PointTree tree_;
  std::vector<float> reach_;  // squared, by the tree's order
};

}  // namespace gi
