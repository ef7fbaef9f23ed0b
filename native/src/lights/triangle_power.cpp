// Runs the emission programs at a few points of every candidate, on both sides; triangles that show nothing are no lights
// (rays still find them, with full weight).
#include "lights/triangle_power.h"

#include <atomic>

#include "core/parallel.h"

namespace gi {

namespace {

constexpr size_t kPointBudget = 50'000;  // evaluations, about; at least kLeastPoints a side
constexpr int kLeastPoints = 4, kMostPoints = 64;

struct Candidate {
  uint32_t instance, triangle;
};

float magnitude(Rgb c) {
  const float m = luminance(abs(c));
  return std::isfinite(m) ? m : 0.0f;
}

bool shines(const MaterialData& m) { return m.emission_sampling != EmissionSampling::kNone && m.program.has_emission(); }

std::vector<Candidate> candidates(const Scene& scene) {
  std::vector<Candidate> all;
  for (uint32_t i = 0; i < scene.instances().size(); ++i) {
    const Instance& instance = scene.instances()[i];
    if (!(instance.data->visibility & (kRayDiffuse | kRayGlossy | kRayTransmission | kRayVolume))) continue;
    bool any = false;
    for (int32_t m : instance.data->materials) any = any || (m >= 0 && shines(scene.material(m)));
    if (!any) continue;
    const size_t n = scene.mesh(instance.mesh).triangle_count();
    for (uint32_t t = 0; t < n; ++t) {
      if (shines(scene.material(scene.material_of(i, t)))) all.push_back({i, t});
    }
  }
  return all;
}

// Mean |luminance| that the side facing `wo` emits straight up.
float side_radiance(const Scene& scene, Candidate c, Vec3 wo, int points, bool& backfacing) {
  float sum = 0, first = 0;
  bool varies = false;
  PathState path;
  path.kind = 0, path.depth = 1;
  for (int k = 0; k < points; ++k) {
    // R2 sequence. [Roberts 2018]
    const float x = 0.5f + 0.75487766f * float(k), y = 0.5f + 0.56984029f * float(k);
    const Vec2 b = sample_triangle({x - std::floor(x), y - std::floor(y)});
    ShadingPoint p = scene.surface_point(c.instance, c.triangle, b.x, b.y, wo, path);
    backfacing = p.backfacing;
    const float one = magnitude(scene.emission(p));
    sum += one;
    // Most programs that might vary over a triangle do not.
    if (k == 0) first = one;
    varies = varies || one != first;
    if (k + 1 == kLeastPoints && !varies && first > 0.0f) return first;
  }
  return sum / float(points);
}

MeasuredTriangle measure(const Scene& scene, Candidate c, int points) {
  MeasuredTriangle m;
  Vec3 v[3];
  scene.triangle_vertices(c.instance, c.triangle, v);
  m.light = TriangleLight(v);
  m.light.instance = c.instance, m.light.triangle = c.triangle;
  m.light.material = uint32_t(scene.material_of(c.instance, c.triangle));
  const Vec3 n = m.light.normal();
  if (!(m.light.area() > 0.0f) || !std::isfinite(m.light.area())) return m;

  const EmissionSampling mode = scene.material(int(m.light.material)).emission_sampling;
  const bool constant = scene.material(int(m.light.material)).program.constant_emission().has_value();
  float side[2];
  for (int k = 0; k < 2; ++k) {
    bool backfacing = k == 1;
    const Vec3 wo = k == 0 ? n : -n;
    side[k] = side_radiance(scene, c, wo, constant ? 1 : points, backfacing);
    if (mode == EmissionSampling::kFront && backfacing) side[k] = 0;
    if (mode == EmissionSampling::kBack && !backfacing) side[k] = 0;
  }
  m.light.front = side[0] > 0, m.light.back = side[1] > 0;
  m.radiance = std::max(side[0], side[1]);
  return m;
}

}  // namespace

std::vector<MeasuredTriangle> measure_triangles(const Scene& scene, int threads) {
  std::vector<MeasuredTriangle> lights;
  const std::vector<Candidate> all = candidates(scene);
  if (all.empty()) return lights;
  const int points = int(std::clamp<size_t>(kPointBudget / (2 * all.size()), kLeastPoints, kMostPoints));
  std::vector<MeasuredTriangle> measured(all.size());
  constexpr size_t kBlock = 1024;
  ThreadPool pool(all.size() > kBlock ? threads : 1);
  const std::atomic<bool> go_on{false};
  pool.for_each(int((all.size() + kBlock - 1) / kBlock), go_on, [&](int block) {
    const size_t end = std::min(all.size(), (size_t(block) + 1) * kBlock);
    for (size_t i = size_t(block) * kBlock; i < end; ++i) measured[i] = measure(scene, all[i], points);
  });
  for (const MeasuredTriangle& m : measured) {
    if (m.radiance > 0.0f) lights.push_back(m);
  }
  return lights;
}

}  // namespace gi
