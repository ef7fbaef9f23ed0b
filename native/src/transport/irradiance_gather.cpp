// Irradiance and its gradients from one stratified hemisphere of rays.
#include "transport/irradiance_gather.h"

#include <algorithm>

namespace gi {
namespace {

constexpr int kOfAll = 10;  // rays, of which one may meet something nearer than the wall

// Polar angle of the boundary between ring j − 1 and ring j: rings are equal in sin² θ.
struct Boundary {
  float sin, cos;
  Boundary(int j, int rings) : sin(std::sqrt(float(j) / float(rings))), cos(safe_sqrt(1.0f - float(j) / float(rings))) {}
};

void add(Rgb out[3], Vec3 direction, Rgb amount) {
  for (int axis = 0; axis < 3; ++axis) out[axis] += amount * direction[axis];
}

// What the boundary between two strata sweeps as the point moves, by the nearer of what they see.
Rgb across(const GatheredRay& to, const GatheredRay& from) {
  const float distance = std::min(to.distance, from.distance);
  return std::isfinite(distance) ? (to.radiance - from.radiance) / std::max(distance, 1e-6f) : Rgb();
}

}  // namespace

GatheredIrradiance gather_irradiance(Vec3 position, Vec3 normal, int samples, const std::function<Vec2(int)>& jitter,
                                     const std::function<GatheredRay(int, Vec3)>& ray) {
  const HemisphereStrata strata(samples);
  const int rings = strata.rings, sectors = strata.sectors;
  const Frame frame = Frame::from_normal(normal);
  std::vector<GatheredRay> rays(static_cast<size_t>(strata.count()));
  const auto at = [&](int ring, int sector) -> GatheredRay& { return rays[size_t(ring * sectors + (sector + sectors) % sectors)]; };

  GatheredIrradiance result;
  Rgb sum;
  float inverse_distances = 0.0f;
  std::vector<float> distances;
  for (int j = 0; j < rings; ++j) {
    for (int k = 0; k < sectors; ++k) {
      const int index = j * sectors + k;
      const Vec2 u = jitter(index);
      const float sin2 = (float(j) + u.x) / float(rings), phi = 2.0f * kPi * (float(k) + u.y) / float(sectors);
      const float s = std::sqrt(sin2);
      const Vec3 local{s * std::cos(phi), s * std::sin(phi), safe_sqrt(1.0f - sin2)};
      GatheredRay& r = at(j, k) = ray(index, frame.to_world(local));
      result.seen.emplace_back(local, r.distance, luminance(r.radiance));
      sum += r.radiance;
      inverse_distances += 1.0f / std::max(r.distance, 1e-6f);
      distances.push_back(r.distance);
    }
  }

  IrradianceRecord& record = result.record;
  record.position = position, record.normal = normal;
  record.irradiance = sum * (kPi / float(strata.count()));
  record.radius = inverse_distances > 0.0f ? float(strata.count()) / inverse_distances : kInf;
  const auto near = distances.begin() + strata.count() / kOfAll;
  std::nth_element(distances.begin(), near, distances.end());
  result.wall = *near;
  result.nearest = *std::min_element(distances.begin(), near + 1) * strata.least_aim();

  std::array<std::vector<float>, std::tuple_size_v<Around>> that_way;
  for (int k = 0; k < sectors; ++k)
    for (int j = 0; j < rings; ++j) that_way[that_way.size() * size_t(2 * k + 1) / size_t(2 * sectors)].push_back(at(j, k).distance);
  for (size_t turn = 0; turn < that_way.size(); ++turn) {
    std::vector<float>& seen = that_way[turn];
    const auto quarter = seen.begin() + std::ptrdiff_t(seen.size() / 4);
    std::nth_element(seen.begin(), quarter, seen.end());
    result.around[turn] = seen.empty() ? result.around[turn - 1] : *quarter;  // of six sectors or seven some serve two
  }

  for (int j = 0; j < rings; ++j)
    for (int k = 0; k < sectors; ++k) result.variance += 0.5f * sqr(luminance(at(j, k).radiance) - luminance(at(j, k - 1).radiance));
  result.variance *= sqr(kPi / float(strata.count()));

  const float wedge = 2.0f * kPi / float(sectors);
  for (int k = 0; k < sectors; ++k) {
    const float phi = wedge * (float(k) + 0.5f), phi_before = wedge * float(k);
    const Vec3 u = frame.to_world({std::cos(phi), std::sin(phi), 0.0f});                    // the sector's middle
    const Vec3 v = frame.to_world({-std::sin(phi_before), std::cos(phi_before), 0.0f});     // across its first boundary
    Rgb along_u, along_v, lateral;
    for (int j = 0; j < rings; ++j) {
      const Boundary inner(j, rings), outer(j + 1, rings);
      // [Ward & Heckbert 1992, eq. 3]: boundaries of rings, then of sectors.
      if (j > 0) along_u += across(at(j, k), at(j - 1, k)) * (inner.sin * sqr(inner.cos) * wedge);
      along_v += across(at(j, k), at(j, k - 1)) * (outer.sin - inner.sin);
      // [Ward & Heckbert 1992, eq. 2]; of tan θ the stratum's mean, since the outermost differ much from their middle's.
      lateral += at(j, k).radiance * (mean_tangent(j, rings) * kPi / float(strata.count()));
    }
    add(record.translation, u, along_u);
    add(record.translation, v, along_v);
    add(record.lateral, u, lateral);
  }
  return result;
}

GatheredIrradiance gather_guided(Vec3 normal, int samples, const IrradianceGuide& guide, const std::function<Vec3(int)>& jitter,
                                 const std::function<GatheredRay(int, Vec3)>& ray) {
  const Frame frame = Frame::from_normal(normal);
  const float share = kPi / float(samples);
  GatheredIrradiance result;
  float first = 0, before = 0;
  for (int i = 0; i < samples; ++i) {
    const Vec3 u = jitter(i);
    const IrradianceGuide::Direction d = guide.sample((float(i) + u.z) / float(samples), {u.x, u.y});
    const Vec3 direction = frame.to_world(d.local);
    const Rgb light = ray(i, direction).radiance * (d.weight * share);
    result.record.irradiance += light;
    const Vec3 flat = d.local.x * frame.x + d.local.y * frame.y;
    const float across = length(flat);
    if (across > 0.0f) add(result.record.lateral, flat / across, light * d.tangent);
    const float now = luminance(light);
    if (i > 0) result.variance += 0.5f * sqr(now - before);
    (i > 0 ? before : first) = now, before = now;
  }
  result.variance += 0.5f * sqr(first - before);
  return result;
}

}  // namespace gi
