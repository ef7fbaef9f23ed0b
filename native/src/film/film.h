// The film: sums of samples per pixel for every pass asked for, and the moments that noise is judged by.
// A pixel's samples are added in the order of the passes, so the image does not depend on threads.
#pragma once
#include <atomic>
#include <deque>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "core/vec.h"
#include "film/filter.h"
#include "film/splats.h"

namespace gi {

// A pass that node trees fill by AOV outputs.
struct Aov {
  std::string name;
  int channels = 4;  // or 1
};

struct FilmSpec {
  int width = 0, height = 0;                // the full frame
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;       // what is rendered of it; row 0 is the bottom
  FilterKind filter = FilterKind::kBlackmanHarris;
  float filter_width = 1.5f;
  float exposure = 1;
  bool transparent = false, transparent_glass = false;
  float transparent_roughness = 0.1f;
  std::vector<std::string> passes{"Combined"};
  std::vector<Aov> aovs;
  int region_width() const { return x1 - x0; }
  int region_height() const { return y1 - y0; }
};

// The terms that photon mapping's radiance is the sum of: straight from luminaires (or to the diffuse surface that is seen), by way of
// mirrors and gloss that the eye sees, thrown by these onto the diffuse surface that is seen, and by way of other diffuse surfaces.
enum LightTerm { kDirectTerm, kSpecularTerm, kCausticTerm, kGlobalTerm, kLightTerms };

// What one sample says of its pixel. Positions and normals are of the first surface that is not see-through.
struct PixelSample {
  Rgb radiance;
  float alpha = 1;
  Rgb emission, environment, albedo, terms[kLightTerms];
  bool has_surface = false;
  float depth = 1e10f;
  Vec3 position, normal;
  Vec2 uv;
  bool has_uv = false;
  float object_index = 0, material_index = 0;
  float cache_record = 0;  // 1 where a record of an irradiance cache lies
  std::span<float> aovs = {};  // four for each of the film's; none: not asked for
  float photons = 0, photon_density = 0, photon_radius = 0;  // in the pixel; per m²; m within which they are averaged
};

// Averaged over the samples whose light is a finite number, over all samples, or of the first sample (indices and depth
// do not average).
enum class Keep { kLight, kMean, kFirst };

// What a pass holds.
struct PassRule {
  const char* name;
  int channels;
  Keep keep;
  void (*add)(const PixelSample&, float exposure, float* sum);  // null: an AOV
};

struct Tile {
  int x0, y0, x1, y1;  // within the region
};

class Film {
 public:
  explicit Film(FilmSpec spec);

  const FilmSpec& spec() const { return spec_; }
  const PixelFilter& filter() const { return filter_; }
  const std::vector<Tile>& tiles() const { return tiles_; }

  static constexpr int kTileSize = 16;
  bool wants(const std::string& pass) const;
  // Whether anything but light is asked for.
  bool has_data_passes() const { return has_data_passes_; }
  size_t aov_floats() const { return 4 * spec_.aovs.size(); }  // of one sample
  // Adds one sample to each pixel of a row of the tile; `y` within the region.
  void add_row(int tile, int y, int pass, const PixelSample* samples);

  // Light that falls on the film at `at`, over the full frame as Camera::sample takes it, from any thread: `value` times the filter is a
  // pixel's estimate. Belongs to one pixel, drawn by the filter with `u`. `wraps`: film_wraps of the camera. Returns
  // whether there is such a pixel.
  bool splat(Vec2 at, bool wraps, Rgb value, Vec2 u);
  // Before the first splat. `unit`: see Splats.
  void start_splats(double unit);
  void end_splats(bool finished);  // of each pass

  // Mean of a pass, (region height × region width × channels); "Sample Count" is the number itself.
  int channels(const std::string& pass) const;  // 0 if there is no such pass
  void read(const std::string& pass, float* out) const;

  // The 95th percentile over pixels of the standard error of luminance relative to the pixel (but no less than to a
  // tenth of the image's mean, so that black pixels can come to an end). Infinite before two samples.
  float relative_error() const;
  uint64_t bad_samples() const { return bad_samples_; }  // not finite, left out
  size_t memory_bytes() const;

 private:
  struct Layer {
    const PassRule* rule;
    size_t aov;  // first of its floats in a sample; of an AOV
    std::vector<float> sum;
  };
  // Of a pixel: how many samples, how many whose light is a finite number, and the moments of these.
  struct Moments {
    uint32_t count = 0, light_count = 0;
    float luminance = 0, luminance_square = 0;
  };
  bool add_moments(Moments& moments, const PixelSample& sample);  // whether its light is a finite number
  void add_splats(float* out) const;

  FilmSpec spec_;
  PixelFilter filter_;
  std::vector<Tile> tiles_;
  std::deque<PassRule> aov_rules_;
  std::vector<Layer> layers_;
  bool has_data_passes_ = false;
  std::vector<Moments> moments_;
  std::unique_ptr<std::mutex[]> tile_mutex_;
  std::atomic<uint64_t> bad_samples_{0};
  std::unique_ptr<Splats> splats_;
  mutable std::mutex splats_mutex_;  // of the pointer
};

}  // namespace gi
