// Where the light of a record comes from, as far as rays of the records around it have met it: directions for more rays, most of them
// towards what is bright or unsteady. [Jensen 1995] Leaves out whose rays these are.
#pragma once
#include <array>

#include "core/vec.h"

namespace gi {

// What a ray of a record met, small enough to be kept of all rays.
class Sighting {
 public:
  // `local`: unit direction, z along the record's normal. Distances may be infinite.
  Sighting(Vec3 local, float distance, float luminance);
  Vec3 local() const;
  float distance() const;
  float luminance() const;

 private:
  int8_t x_, y_;
  uint16_t distance_, luminance_;  // halves of floats
};

// By eighths of a turn about a normal.
using Around = std::array<float, 8>;

// A density over the hemisphere, constant over cells that are equal in projected solid angle: rings of sectors.
class IrradianceGuide {
 public:
  void add(Vec3 local, float luminance);
  // Once all is added. With nothing added directions follow the cosine.
  void settle();

  struct Direction {
    Vec3 local;
    float weight;   // density of directions that follow the cosine, over its own
    float tangent;  // of the angle to the normal: its cell's mean
  };
  // `u` chooses the cell; cells in a row are neighbours, so that numbers that are spread out give directions that are.
  Direction sample(float u, Vec2 within) const;

  static constexpr int kRings = 8, kSectors = 25, kCells = kRings * kSectors;

 private:
  std::array<float, kCells> seen_{}, squares_{};  // rays, and their luminances squared
  std::array<float, kCells + 1> below_{};         // probability of the cells before each
};

// Mean of tan θ over ring `ring` of `rings` that are equal in sin² θ.
float mean_tangent(int ring, int rings);

}  // namespace gi
