// Sends more light where it matters: learns from trial paths which of the random numbers that light starts with lead to what the eye sees,
// and draws those more often. Nothing is lost: weights make up for it. [Lepage 1978; Peter & Pietrek 1998]
#pragma once
#include <array>
#include <memory>
#include <vector>

#include "core/distribution.h"
#include "core/point_tree.h"

namespace gi {

// The random numbers by which light starts, as LightSet::emit takes them: choice, place, direction.
using EmissionNumbers = std::array<float, 5>;

class EmissionGuide {
 public:
  EmissionGuide() = default;  // changes nothing
  explicit EmissionGuide(int lights);

  // Turns even numbers into ones of the learnt density, and returns 1 / density.
  float warp(EmissionNumbers& u) const;
  // What a trial path was worth: an estimate divided by the density it was drawn with.
  struct Trial {
    EmissionNumbers u;
    float worth;
  };
  void learn(const std::vector<Trial>& trials);

 private:
  static constexpr int kBins = 32;
  static constexpr float kEven = 0.2f;  // share of paths that start as if nothing had been learnt

  int choices_ = 0;
  std::vector<float> worth_;  // per choice: kBins for each of the other four numbers, and in front its sum
  std::vector<float> hits_;   // per choice: trials that were worth anything
  Distribution1D choice_;
  std::vector<Distribution1D> numbers_;  // four per choice
};

// What the eye sees by way of anything but diffuse surfaces: points on diffuse ones, and how far apart they are.
class SeenPoints {
 public:
  SeenPoints() = default;
  SeenPoints(const std::vector<Vec3>& points, ThreadPool& pool);
  bool near(Vec3 position) const;

 private:
  PointTree tree_;
  std::vector<float> reach_;  // squared, by the tree's order
};

}  // namespace gi
