// Distances are drawn for one channel and weighed for all (balance heuristic).
#include "transport/media.h"

#include "transport/path_state.h"

namespace gi {
namespace {

// Whether a ray along `direction` goes into the object where it hits it.
bool goes_in(const Scene& scene, const Hit& hit, Vec3 direction) {
  return !scene.surface_point(hit.instance, hit.triangle, hit.b1, hit.b2, -direction, {}).backfacing;
}

}  // namespace

void Media::set(const Scene& scene, uint32_t instance, uint32_t triangle, bool inside) {
  const int material = scene.material_of(instance, triangle);
  if (scene.material(material).volume < 0) return;
  for (int i = 0; i < count_; ++i) {
    if (inside_[i].instance != instance || inside_[i].material != material) continue;
    if (!inside) inside_[i] = inside_[--count_];
    return;
  }
  if (inside && count_ < kMost) inside_[count_++] = {instance, material};
}

void Media::begin_at(const Scene& scene, Vec3 position) {
  count_ = 0;
  // What a ray comes out of without having gone into is where it began; the last surface of each object decides.
  static thread_local std::vector<Hit> hits;
  const Vec3 up{0, 0, 1};
  scene.volume_hits({position, up, 0.0f, kInf}, hits);
  for (size_t i = hits.size(); i-- > 0;) set(scene, hits[i].instance, hits[i].triangle, !goes_in(scene, hits[i], up));
}

void Media::cross(const Scene& scene, const ShadingPoint& point, Vec3 direction) {
  const bool inwards = (dot(point.ng, direction) < 0.0f) != point.backfacing;
  set(scene, point.instance, point.triangle, inwards);
}

Medium Media::at(const Scene& scene, Vec3 position, Vec3 wo, const PathState& path) const {
  Medium medium;
  for (int i = 0; i < count_; ++i) {
    const Instance& instance = scene.instances()[inside_[i].instance];
    ShadingPoint point;
    point.position = position, point.object_position = instance.to_object.point(position);
    point.wo = point.ng = point.ns = wo;
    point.instance = inside_[i].instance, point.mesh = instance.mesh, point.triangle = 0;
    point.path = path;
    scene.add_medium(inside_[i].material, point, medium);
  }
  return medium;
}

Rgb Media::transmittance(const Scene& scene, const Ray& ray, const PathState& path) const {
  static thread_local std::vector<Hit> hits;
  scene.volume_hits(ray, hits);
  if (hits.empty() && empty()) return Rgb(1.0f);
  Media media = *this;
  PathState state = path;
  state.kind = kRayShadow;
  Rgb passed(1.0f);
  float from = 0.0f;
  for (size_t i = 0; i <= hits.size(); ++i) {
    const float to = i < hits.size() ? hits[i].t : ray.t_max;
    if (!media.empty()) passed *= media.at(scene, ray.origin + ray.direction * from, -ray.direction, state).transmittance(to - from);
    if (i == hits.size() || is_black(passed)) break;
    media.set(scene, hits[i].instance, hits[i].triangle, goes_in(scene, hits[i], ray.direction));
    from = to;
  }
  return passed;
}

MediumEvent sample_distance(const Medium& medium, float t_max, Rgb throughput, Vec2 u) {
  MediumEvent e;
  const Rgb sigma = medium.sigma_t, share = abs(throughput);
  if (!medium.scatters()) {
    e.t = t_max, e.weight = medium.transmittance(t_max);
    return e;
  }
  const float sum = share.r() + share.g() + share.b();
  const Rgb pick = sum > 0.0f ? share / sum : Rgb(1.0f / 3.0f);
  const int channel = u.x < pick.r() ? 0 : u.x < pick.r() + pick.g() ? 1 : 2;
  const float t = sigma[channel] > 0.0f ? -std::log(1.0f - u.y) / sigma[channel] : kInf;
  e.scattered = t < t_max;
  e.t = std::min(t, t_max);
  const Rgb passed = medium.transmittance(e.t), density = pick * (e.scattered ? sigma * passed : passed);
  const float pdf = density.r() + density.g() + density.b();
  e.weight = pdf > 0.0f ? passed / pdf : Rgb();
  return e;
}

}  // namespace gi
