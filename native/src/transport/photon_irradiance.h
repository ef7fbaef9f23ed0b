// What photons say of places that gathering rays end at.
#pragma once
#include "transport/photon_aim.h"
#include "transport/photon_map.h"

namespace gi {

// What eye rays are when they come from gathering.
PathState gathering();

// Irradiance where gathering rays end, looked up by the nearest. [Christensen 1999, "Faster photon map global illumination"] has it at
// photons, but these lie where it is bright: what is dark would be read as what is bright beside it.
class IrradianceMap {
 public:
  // Adds those of `places` whose neighbourhood is not known yet. Takes at most `time_share` of a time limit.
  void cover(const std::vector<PathEnd>& places, const PhotonMap& map, size_t count, float radius, const RenderContext& context,
             double time_share);
  // What no record is near is looked up among the nearest `count` photons within `radius`.
  void look_up_by(size_t count, float radius) { count_ = count, radius_ = radius; }

  // Power per square metre on the side of `normal`; nothing if photons are from farther about than `distance`, which is how far it is
  // seen from: from there it would show as a blot. [Jensen 2001, §9.3.4]
  std::optional<Rgb> at(const PhotonMap& map, const Scene& scene, Vec3 position, Vec3 normal, float distance) const;
  size_t memory_bytes() const { return records_.size() * sizeof(Record) + tree_.memory_bytes(); }

 private:
  struct Record {
    Vec3 normal;
    Rgb irradiance;
    float reach = 0;  // its photons are in this radius; 0: not worked out
  };
  const Record* nearest(Vec3 position, Vec3 normal) const;  // that a place is read from; null: none is near enough

  std::vector<Record> records_;  // in the order of the tree
  PointTree tree_;
  size_t count_ = 0;
  float radius_ = 0;
};

}  // namespace gi
