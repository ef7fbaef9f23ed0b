// Building the world's importance map from its program.
#include "lights/world_light.h"

#include "core/parallel.h"
#include "shading/images.h"

namespace gi {

namespace {

constexpr int kProbeWidth = 64;         // is there anything, and does it vary?
constexpr int kLeastWidth = 512, kMostWidth = 2048;  // of the automatic map
constexpr int kFine = 16;               // texels across a bright texel's own map
constexpr float kBright = 32.0f;        // times the mean
constexpr size_t kMostFine = 4096;      // bright texels
constexpr float kFloor = 0.02f;         // of the mean, everywhere: what lies between the map's samples is not ruled out

float strength(const Scene& scene, Vec3 direction) {
  PathState path;
  path.kind = 0, path.depth = 1;
  const Rgb l = scene.world_radiance(direction, path);
  const float value = std::abs(luminance(l));
  return std::isfinite(value) ? value : 0.0f;
}

Vec2 circle(float angle) { return {std::cos(angle), std::sin(angle)}; }

float strength(const Scene& scene, float x, float y) {
  const Vec2 theta = circle(kPi * y), phi = circle(2.0f * kPi * x - kPi);
  return strength(scene, {theta.y * phi.x, theta.y * phi.y, -theta.x});
}

// |luminance| of width × width/2 texels, `subsamples`² samples in each.
std::vector<float> radiance_map(const Scene& scene, int width, int subsamples, ThreadPool& pool) {
  const int height = width / 2, n = subsamples;
  std::vector<float> map(size_t(width) * size_t(height));
  std::vector<Vec2> phi(size_t(width * n));
  for (size_t i = 0; i < phi.size(); ++i) phi[i] = circle(kPi * (2.0f * (float(i) + 0.5f) / float(phi.size()) - 1.0f));
  const std::atomic<bool> go_on{false};
  pool.for_each(height, go_on, [&](int y) {
    for (int j = y * n; j < (y + 1) * n; ++j) {
      const Vec2 theta = circle(kPi * (float(j) + 0.5f) / float(height * n));
      for (int i = 0; i < width * n; ++i) {
        const Vec3 direction{theta.y * phi[size_t(i)].x, theta.y * phi[size_t(i)].y, -theta.x};
        map[size_t(y) * size_t(width) + size_t(i / n)] += strength(scene, direction) / float(n * n);
      }
    }
  });
  return map;
}

// Width of the widest image that the world shows; 0: none.
int image_width(const Scene& scene, const Program& program) {
  int width = 0;
  const ImageSet* images = scene.resources().images.get();
  for (const char* op : {"environment", "image", "image_box"})
    for (const int32_t i : program.immediates(op, 0))
      if (images && size_t(i) < images->size() && !(*images)[size_t(i)].tiles.empty())
        width = std::max(width, (*images)[size_t(i)].tiles[0].width);
  return width;
}

float mean_over_sphere(const std::vector<float>& map, int width) {
  const int height = width / 2;
  double sum = 0, weights = 0;
  for (int y = 0; y < height; ++y) {
    const double s = std::sin(double(kPi) * (y + 0.5) / height);
    for (int x = 0; x < width; ++x) sum += s * double(map[size_t(y) * size_t(width) + size_t(x)]);
    weights += s * width;
  }
  return float(sum / weights);
}

}  // namespace

WorldLight::WorldLight(const Scene& scene, int threads) {
  const WorldData& world = scene.data().world;
  if (world.program < 0 || !world.sampled) return;
  const Program& program = scene.material(world.program).program;
  if (!program.has_emission()) return;
  if (program.constant_emission()) {
    mean_ = strength(scene, 0.5f, 0.5f);
    return;
  }

  ThreadPool pool(threads);
  int width = kProbeWidth;
  std::vector<float> map = radiance_map(scene, width, 2, pool);
  const auto [least, most] = std::minmax_element(map.begin(), map.end());
  if (world.map_resolution > 0 || *least != *most || *most == 0.0f) {
    // Fine enough for the sun in a panorama; half its width, as each texel is sampled twice across.
    const int image = image_width(scene, program.emission_program());
    const int automatic = std::clamp(image / 2, kLeastWidth, kMostWidth);
    width = std::clamp(world.map_resolution > 0 ? world.map_resolution : automatic, 4, 8192) & ~1;
    map = radiance_map(scene, width, image == 0 && width >= 2 * kLeastWidth ? 1 : 2, pool);
  } else {
    mean_ = *most;
    return;  // depends on the point in name only
  }
  mean_ = mean_over_sphere(map, width);
  if (!(mean_ > 0.0f)) return;

  // A little blur and a floor: light between the map's samples stays possible.
  const int height = width / 2;
  std::vector<float> density(map.size());
  for (int y = 0; y < height; ++y) {
    const float s = std::sin(kPi * (float(y) + 0.5f) / float(height));
    for (int x = 0; x < width; ++x) {
      const auto at = [&](int dx, int dy) {
        return map[size_t(std::clamp(y + dy, 0, height - 1)) * size_t(width) + size_t((x + dx + width) % width)];
      };
      const float sides = at(-1, 0) + at(1, 0) + at(0, -1) + at(0, 1), corners = at(-1, -1) + at(-1, 1) + at(1, -1) + at(1, 1);
      const float blurred = (8.0f * at(0, 0) + 1.5f * sides + 0.5f * corners) * (1.0f / 16.0f);
      density[size_t(y) * size_t(width) + size_t(x)] = s * (blurred + kFloor * mean_);
    }
  }
  refine(scene, density, width, pool);
  map_ = Distribution2D(density, width, height);
}

float WorldLight::share_above(float radiance) const {
  if (map_.empty()) return mean_ > radiance ? 1.0f - radiance / mean_ : 0.0f;
  const int width = map_.width(), height = map_.height();
  const float all = mean_ * (1.0f + kFloor);  // the map's radiance where its density is that of the whole sphere
  double above = 0, sum = 0;
  const auto add = [&](float value, double solid_angle) {
    above += solid_angle * double(std::max(value - kFloor * mean_ - radiance, 0.0f)), sum += solid_angle * double(value);
  };
  for (int y = 0; y < height; ++y) {
    const float s = std::sin(kPi * (float(y) + 0.5f) / float(height));
    for (int x = 0; x < width; ++x) {
      const Texel t{x, y};
      const float value = all * map_.pdf(t.place({0.5f, 0.5f}, map_)) * (2.0f / kPi) / s;
      const Distribution2D* fine = refinement(t);
      if (!fine) {
        add(value, s);
        continue;
      }
      for (int i = 0; i < kFine * kFine; ++i)
        add(value * fine->pdf({(float(i % kFine) + 0.5f) / kFine, (float(i / kFine) + 0.5f) / kFine}), s / (kFine * kFine));
    }
  }
  return float(above / sum);
}

// The brightest texels get maps of their own, and by them a better estimate of what they are worth.
void WorldLight::refine(const Scene& scene, std::vector<float>& density, int width, ThreadPool& pool) {
  const int height = width / 2;
  double total = 0;
  for (const float d : density) total += double(d);
  const float bright = float(kBright * total / double(density.size()));
  std::vector<size_t> hot;
  for (size_t i = 0; i < density.size(); ++i)
    if (density[i] > bright) hot.push_back(i);
  if (hot.size() > kMostFine) {
    std::nth_element(hot.begin(), hot.begin() + kMostFine, hot.end(), [&](size_t a, size_t b) { return density[a] > density[b]; });
    hot.resize(kMostFine);
  }
  // Their neighbours too: a disc may just reach into a texel.
  std::vector<char> near(density.size(), 0);
  for (const size_t i : hot)
    for (int k = 0; k < 9; ++k) {
      const int x = (int(i % size_t(width)) + k % 3 - 1 + width) % width, y = std::clamp(int(i / size_t(width)) + k / 3 - 1, 0, height - 1);
      near[size_t(y) * size_t(width) + size_t(x)] = 1;
    }
  hot.clear();
  for (size_t i = 0; i < near.size(); ++i)
    if (near[i]) hot.push_back(i);
  fine_of_.assign(density.size(), -1);
  fine_.resize(hot.size());
  row_is_fine_.assign(size_t(height), 0);
  for (const size_t texel : hot) row_is_fine_[texel / size_t(width)] = 1;
  const std::atomic<bool> go_on{false};
  pool.for_each(int(hot.size()), go_on, [&](int k) {
    const size_t texel = hot[size_t(k)];
    const float s = std::sin(kPi * (float(texel / size_t(width)) + 0.5f) / float(height)), x0 = float(texel % size_t(width)),
                y0 = float(texel / size_t(width));
    // One row more on each side, so that every value knows its neighbours.
    constexpr int kRing = kFine + 2;
    float values[kRing * kRing], sum = 0;
    for (int i = 0; i < kRing * kRing; ++i) {
      const float x = x0 + (float(i % kRing) - 0.5f) / kFine, y = y0 + (float(i / kRing) - 0.5f) / kFine;
      values[i] = strength(scene, x / float(width), std::clamp(y / float(height), 0.0f, 1.0f));
    }
    std::vector<float> inside(kFine * kFine);
    for (int i = 0; i < kFine * kFine; ++i) {
      const float* at = values + (i / kFine + 1) * kRing + i % kFine + 1;
      float brightest = 0;
      for (const int row : {-kRing, 0, kRing}) brightest = std::max({brightest, at[row - 1], at[row], at[row + 1]});
      inside[size_t(i)] = 0.5f * (*at + brightest) + kFloor * mean_;  // the edge of a disc lies between samples
      sum += inside[size_t(i)];
    }
    density[texel] = s * sum / (kFine * kFine);
    fine_[size_t(k)] = Distribution2D(inside, kFine, kFine);
    fine_of_[texel] = int32_t(k);
  });
}

}  // namespace gi
