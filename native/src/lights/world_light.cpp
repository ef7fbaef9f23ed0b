// Building the world's importance map from its program.
#include "lights/world_light.h"

#include "core/parallel.h"
#include "shading/images.h"

namespace gi {

namespace {

constexpr int kProbeWidth = 64;         // is there anything, and does it vary?
constexpr int kLeastWidth = 512, kMostWidth = 2048;  // of the automatic map
constexpr float kFloor = 0.02f;         // of the mean, everywhere: what lies between the map's samples is not ruled out

float strength(const Scene& scene, float x, float y) {
  const float theta = kPi * y, phi = 2.0f * kPi * x - kPi, s = std::sin(theta);
  PathState path;
  path.kind = 0, path.depth = 1;
  const Rgb l = scene.world_radiance({s * std::cos(phi), s * std::sin(phi), -std::cos(theta)}, path);
  const float value = std::abs(luminance(l));
  return std::isfinite(value) ? value : 0.0f;
}

// |luminance| of width × width/2 texels, `subsamples`² samples in each.
std::vector<float> radiance_map(const Scene& scene, int width, int subsamples, ThreadPool& pool) {
  const int height = width / 2, n = subsamples;
  std::vector<float> map(size_t(width) * size_t(height));
  const std::atomic<bool> go_on{false};
  pool.for_each(height, go_on, [&](int y) {
    for (int x = 0; x < width; ++x) {
      float sum = 0;
      for (int k = 0; k < n * n; ++k) {
        sum += strength(scene, (float(x) + (float(k % n) + 0.5f) / float(n)) / float(width),
                        (float(y) + (float(k / n) + 0.5f) / float(n)) / float(height));
      }
      map[size_t(y) * size_t(width) + size_t(x)] = sum / float(n * n);
    }
  });
  return map;
}

// Fine enough for the sun in a panorama, if the scene has one; half its width, as each texel is sampled twice across.
int automatic_width(const Scene& scene) {
  int width = kLeastWidth;
  const ImageSet* images = scene.resources().images.get();
  for (size_t i = 0; images && i < images->size(); ++i)
    width = std::max(width, (*images)[i].tiles.empty() ? 0 : (*images)[i].tiles[0].width / 2);
  return std::min(width, kMostWidth);
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
  if (program.emission_program().is_constant()) {
    mean_ = strength(scene, 0.5f, 0.5f);
    return;
  }

  ThreadPool pool(threads);
  int width = kProbeWidth;
  std::vector<float> map = radiance_map(scene, width, 2, pool);
  const auto [least, most] = std::minmax_element(map.begin(), map.end());
  if (world.map_resolution > 0 || *least != *most || *most == 0.0f) {
    width = std::clamp(world.map_resolution > 0 ? world.map_resolution : automatic_width(scene), 4, 8192) & ~1;
    map = radiance_map(scene, width, 2, pool);
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
  map_ = Distribution2D(density, width, height);
}

}  // namespace gi
