// Irradiance worked out at some places and interpolated between them: the records, where each of them holds, and an octree over these.
// [Ward 1988; Ward & Heckbert 1992; Křivánek 2006] Leaves out how light gets there (irradiance_gather.h, the integrator).
#pragma once
#include <optional>
#include <vector>

#include "core/vec.h"

namespace gi {

struct IrradianceRecord {
  Vec3 position, normal;
  float radius = 0;     // metres over which irradiance changes by as much as itself: mean distance of what is seen, clamped
  float least = 0;      // neighbours may not clamp it further
  float reach = kInf;   // metres beyond which it is of no use at all, or light would come through thin walls
  Rgb irradiance;       // W/m²
  Rgb translation[3];   // ∂E/∂x, ∂E/∂y, ∂E/∂z for moves in the tangent plane
  Rgb lateral[3];       // the part of vector irradiance in the tangent plane: how E changes as the normal turns

  // As a row of a table; `reach` may be infinite.
  static constexpr size_t kNumbers = 30;
  void write(float* row) const;
  static IrradianceRecord read(const float* row);

  // What it says of another place, and of the normal `bumped`; `turned` is the cosine between that and the surface's own there. Below
  // zero only by as much as the record itself, as colours beyond the gamut are.
  Rgb at(Vec3 place, Vec3 bumped, float turned) const {
    const Vec3 d = place - position;
    const Rgb moved = translation[0] * d.x + translation[1] * d.y + translation[2] * d.z;
    const Rgb there = irradiance * turned + moved + lateral[0] * bumped.x + lateral[1] * bumped.y + lateral[2] * bumped.z;
    return max(there, min(irradiance, Rgb()));
  }
};

struct CachedIrradiance {
  Rgb irradiance;
  float nearest = kInf;  // metres to the nearest record used
  int records = 0;       // used
};

class IrradianceCache {
 public:
  // `error`: Ward's α, the greatest error of a record that makes another one needless.
  IrradianceCache(Bounds bounds, float error);

  // Clamps the radius by those of its neighbours, and theirs by it.
  void insert(IrradianceRecord record);
  // Whether a record of an error below `slack` α holds here; radii beyond `most` are taken for that.
  bool covers(Vec3 position, Vec3 normal, float most = kInf, float slack = 1.0f) const;
  // The weighted mean of all that hold to an error of kOverlap α; where none does, of those that are near enough but on a surface bent
  // otherwise. `bumped`: the normal that irradiance is for, `normal` the surface's.
  std::optional<CachedIrradiance> find(Vec3 position, Vec3 normal, Vec3 bumped) const;
  // Once nothing more is inserted: a copy in the order of the tree, which is faster to read.
  void freeze();

  // Other light for a record that holds as far as before.
  void set_light(size_t record, const IrradianceRecord& light) { records_[record] = light; }

  const std::vector<IrradianceRecord>& records() const { return records_; }
  float error() const { return error_; }
  size_t memory_bytes() const;

  static constexpr float kOverlap = 1.8f;  // so that everywhere several records have a say, and none begins with a jump

 private:
  static constexpr uint32_t kNone = 0xffffffffu;
  struct Hot {  // what decides whether a record holds
    Vec3 position;
    float radius;  // by which it counts
    Vec3 normal;
    uint32_t record;
    float cover;  // radius by which it makes others needless
  };
  struct Node {
    uint32_t child[8] = {};  // 0: none
    uint32_t first = kNone;       // of the chain of links
    uint32_t begin = 0, end = 0;  // of its blocks, once frozen
  };
  struct Link {
    uint32_t record, next;
  };

  // Some records of a node, so laid out that they are tested at once.
  struct Block {
    static constexpr uint32_t kSize = 8;
    float x[kSize] = {}, y[kSize] = {}, z[kSize] = {}, reach_squared[kSize] = {};  // beyond which a record does not count; 0: none
    uint32_t record[kSize] = {};
  };

  Hot hot_of(uint32_t record) const;
  static std::optional<float> error_of(const Hot& hot, float radius, Vec3 position, Vec3 normal, float most);
  void refer(uint32_t node, Vec3 low, float side, uint32_t record, float reach);
  float weight_of(float error) const;
  template <class F>
  void for_each_at(Vec3 position, const F& f) const;
  template <class F>
  void for_each_within(uint32_t node, Vec3 low, float side, Vec3 centre, float radius, const F& f) const;
  void clamp_by_neighbours(IrradianceRecord& record) const;
  void clamp_neighbours(uint32_t record);
  uint32_t child_towards(Vec3 position, Vec3& low, float& side, const Node& node) const;

  float error_;
  Vec3 low_;
  float side_;
  std::vector<IrradianceRecord> records_;
  std::vector<Node> nodes_{1};
  std::vector<Link> links_;
  std::vector<Hot> hot_;
  std::vector<Block> blocks_;
  bool is_frozen_ = false;
};

}  // namespace gi
