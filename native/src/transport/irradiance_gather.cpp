// Irradiance and its gradients from one stratified hemisphere of rays.
#include "transport/irradiance_gather.h"

#include <algorithm>

namespace gi {
namespace {

constexpr int kOfAll = 10;  // rays, of which one may meet something nearer than the wall

// Polar angle of the boundary between ring j − 1 and ring j: rings are equal in sin² θ.
struct Boundary {
  float sin, cos, theta;
  Boundary(int j, int rings)
      : sin(std::sqrt(float(j) / float(rings))), cos(safe_sqrt(1.0f - float(j) / float(rings))), theta(std::asin(sin)) {}
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
      GatheredRay& r = at(j, k) = ray(index, frame.to_world({s * std::cos(phi), s * std::sin(phi), safe_sqrt(1.0f - sin2)}));
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
      const float tangent = float(rings) * ((outer.theta - outer.sin * outer.cos) - (inner.theta - inner.sin * inner.cos));
      lateral += at(j, k).radiance * (tangent * kPi / float(strata.count()));
    }
    add(record.translation, u, along_u);
    add(record.translation, v, along_v);
    add(record.lateral, u, lateral);
  }
  return result;
}

}  // namespace gi
