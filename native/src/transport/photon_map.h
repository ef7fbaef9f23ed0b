// Photons: the power that light left at diffuse surfaces, kept with where it came from, and the density estimates that turn it into
// radiance. [Jensen 1996; Jensen 2001, "Realistic Image Synthesis Using Photon Mapping"]
#pragma once
#include <optional>

#include "core/point_tree.h"
#include "film/film.h"
#include "transport/light_path.h"
#include "transport/photon_aim.h"
#include "transport/subpath.h"
#include "transport/surface_disc.h"

namespace gi {

// A unit vector in 32 bits, folded onto an octahedron; off by 3·10⁻⁵ at most. [Cigolle et al. 2014, "oct"]
struct PackedDirection {
  int16_t u = 0, v = 0;
  PackedDirection() = default;
  explicit PackedDirection(Vec3 w);
  Vec3 unpack() const { return normalize(along()); }
  Vec3 along() const;  // of any length
};

struct PhotonLight {
  float power[3] = {0, 0, 0};  // watts
  PackedDirection wi;          // towards where it came from
  PackedDirection normal;      // of the surface, on that side
  // Bounces that a path from the eye to this surface may have on its way, by kind.
  uint8_t total = 0, diffuse = 0, glossy = 0, transmission = 0;

  bool reaches(const PathState& eye) const {
    return eye.depth <= total && eye.diffuse_depth <= diffuse && eye.glossy_depth <= glossy && eye.transmission_depth <= transmission;
  }
};
struct Photon : PhotonLight {
  Vec3 position;

  // As a row of a table.
  static constexpr size_t kNumbers = 14;
  void write(float* row) const;
  static std::optional<Photon> read(const float* row);  // nothing if it is none
};

enum PhotonClass : uint8_t {
  kDirectPhoton = 1,   // straight from a luminaire: L D
  kCausticPhoton = 2,  // by way of mirrors, glass and glossy surfaces alone: L S+ D
  kGlobalPhoton = 4,   // by way of a diffuse surface
  kAllPhotons = 7,
};

// The part of a vertex's power that is of the wished classes, and not thrown by lobes that diffuse surfaces are told not to see.
Rgb photon_power(const LightVertex& v, const SubpathSettings& settings, uint8_t classes);

// Sends out the `count` light paths of a pass, and appends to `photons` what they leave of the wished classes (bits of PhotonClass). All
// light is that of these over `count`. The order is that of the paths.
void trace_photons(const RenderContext& context, const SubpathSettings& settings, int pass, int count, uint8_t classes,
                   LargeVector<Photon>& photons);

// The squared radius of a pass over the first one's, where each is to keep `alpha` of the photons of a disc: ∏ (i + α) / (i + 1).
// [Knaus & Zwicker 2011, eq. 15]
double shrinking(int pass, double alpha);

// Whether what lies `away` is taken to be of the same surface: of like slope, and not off the plane. Its normal may have any length.
inline bool of_one_surface(Vec3 away, Vec3 its_normal, Vec3 normal, float radius) {
  constexpr float kSlope = 0.8f;  // least cosine between the normals
  const float off = dot(away, normal), distance = std::sqrt(std::max(length_squared(away) - sqr(off), 0.0f));
  return is_on_surface(off, distance, radius) && sqr(dot(its_normal, normal)) > sqr(kSlope) * length_squared(its_normal);
}

// How far estimates by the nearest photons are off on average, relative.
struct PhotonError {
  double noise = 0;  // by chance: falls as more neighbours are averaged
  double blur = 0;   // by the distance of these: falls as there are more photons
  double total() const { return std::hypot(noise, blur); }
};

// How photons are weighed by their distance from the middle of a disc: all alike, by a cone, or by a bell that is cut off.
enum class PhotonFilter { kDisc, kCone, kGauss };

// Photons that can be looked up. Those of other surfaces are refused: of another slope, or off the plane of the point.
class PhotonMap {
 public:
  PhotonMap() = default;
  PhotonMap(const LargeVector<Photon>& photons, double paths, ThreadPool& pool);

  size_t size() const { return lights_.size(); }
  LargeVector<Photon> photons() const;
  // Those of less power than the mean around them become fewer of the mean, by roulette: an estimate by so many neighbours is as noisy as
  // if they were fewer where their powers differ, and those that hardly count only take room. [Jensen 2001, §5.2]
  LargeVector<Photon> equalised(uint32_t seed) const;
  Vec3 position(size_t k) const { return tree_.point(uint32_t(k)); }
  Vec3 normal(size_t k) const { return lights_[k].normal.unpack(); }
  size_t memory_bytes() const { return lights_.capacity() * sizeof(PhotonLight) + tree_.memory_bytes(); }

  // Radiance towards point.wo of the diffuse lobes, by all photons nearer than `radius`: Σ f Φ / π r², or the area of what of the disc is
  // in sight. [Jensen 2001, eq. 7.6]
  Rgb radiance(const Scene& scene, const ShadingPoint& point, const Bsdf& bsdf, float radius) const;
  // By the nearest `count` of those within `radius`, in a disc that ends at the farthest.
  Rgb radiance(const ShadingPoint& point, const Bsdf& bsdf, float radius, size_t count, PhotonFilter filter) const;
  // Power per area on the side of `normal`, by the nearest `count` within `radius` of those that reach `eye`; `farthest`: how far these
  // are.
  Rgb irradiance(Vec3 position, Vec3 normal, float radius, size_t count, const PathState& eye, const Scene* scene,
                 float* farthest = nullptr) const;
  // How many lie within `radius`.
  size_t count(Vec3 position, Vec3 normal, float radius) const;
  // Of irradiance at some of `places` by `count` within `radius`: noise by the photons' powers, blur by the difference that half of them
  // make.
  PhotonError error(const std::vector<PathEnd>& places, float radius, size_t count, const PathState& eye) const;
  // The distance of the `count`-th photon.
  float spread(Vec3 position, size_t count) const;

 private:
  bool is_of(uint32_t k, Vec3 position, Vec3 normal, float radius) const;
  Rgb scattered(const ShadingPoint& point, const Bsdf& bsdf, const PhotonLight& photon) const;
  // Those that irradiance is estimated by.
  const std::vector<PointTree::Found>& around(Vec3 position, Vec3 normal, float radius, size_t count, const PathState& eye) const;

  LargeVector<PhotonLight> lights_;  // in the order of the tree
  PointTree tree_;
  float scale_ = 0;  // 1 / paths
};

}  // namespace gi
