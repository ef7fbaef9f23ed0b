// Every meeting of the ray with the object counts; one of them, drawn by its weight, stands for all. The axes are weighed against each
// other by the power heuristic. Leaves out the way between, so thin parts let light through to the extent that they are near. As in Cycles,
// weights are of densities by distance, not by area: the same on a plane, up to a few percent more where the surface is as curved as the
// profile is long.
#include "transport/subsurface_probe.h"

#include "shading/diffusion_profile.h"
#include "transport/path_state.h"

namespace gi {
namespace {

constexpr int kMostHits = 64;

// A disc's frame, how likely each of its axes was to be the one that is looked along, and what is left of the random number.
struct ProbeAxes {
  Vec3 across, along, axis;
  float pick_across, pick_along, pick_axis;
  float u;
};
ProbeAxes draw_axes(Vec3 ng, float u) {
  const Frame f = Frame::from_normal(ng);
  if (u < 0.5f) return {f.x, f.y, f.z, 0.25f, 0.25f, 0.5f, u * 2.0f};
  if (u < 0.75f) return {f.z, f.y, f.x, 0.5f, 0.25f, 0.25f, (u - 0.5f) * 4.0f};
  return {f.x, f.z, f.y, 0.25f, 0.5f, 0.25f, (u - 0.75f) * 4.0f};
}

// The profiles of all channels, one of which is drawn. A length of 0 is of a channel that does not go below.
struct Profiles {
  Rgb d;
  Rgb density(float r) const {
    Rgb e;
    for (int i = 0; i < 3; ++i) e[i] = DiffusionProfile{d[i]}.density(r);
    return e;
  }
  int count() const { return (d.r() > 0.0f) + (d.g() > 0.0f) + (d.b() > 0.0f); }
  float pdf(float r) const { return 3.0f * average(density(r)) / float(count()); }
  DiffusionProfile draw(float& u) const {
    u *= float(count());
    for (int i = 0; i < 3; ++i) {
      if (!(d[i] > 0.0f)) continue;
      if (u < 1.0f) return {d[i]};
      u -= 1.0f;
    }
    return {0.0f};
  }
};

}  // namespace

std::optional<SubsurfaceExit> probe_below(const Scene& scene, const ShadingPoint& entry, const Subsurface& surface, Sampler sampler) {
  const Profiles profiles{profile_lengths(surface)};
  if (entry.strand != kNoId || profiles.count() == 0) return {};
  Vec2 u = sampler.next_2d();
  const ProbeAxes axes = draw_axes(entry.ng, u.y);
  const DiffusionProfile drawn = profiles.draw(u.x);
  const float r = drawn.sample(u.x), pdf = profiles.pdf(r);
  if (!(pdf > 0.0f)) return {};
  const float height = safe_sqrt(sqr(DiffusionProfile::kReach * drawn.d) - r * r), phi = 2.0f * kPi * axes.u;
  const Vec3 start = entry.position + axes.axis * height + (axes.across * std::cos(phi) + axes.along * std::sin(phi)) * r;

  // Keep one hit by its weight among those before.
  Ray ray{start, -axes.axis, 0.0f, 2.0f * height};
  float sum = 0.0f, u_keep = sampler.next_1d();
  std::optional<SubsurfaceExit> kept;
  for (int hits = 0; hits < kMostHits; ++hits) {
    const auto hit = scene.intersect_instance(ray, entry.instance);
    if (!hit) break;
    ray.t_min = std::nextafter(hit->t, kInf);
    const ShadingPoint met = scene.surface_point(hit->instance, hit->triangle, hit->b1, hit->b2, axes.axis, entry.path, entry.footprint);
    const float across = axes.pick_across * std::abs(dot(axes.across, met.ng)), along = axes.pick_along * std::abs(dot(axes.along, met.ng)),
                axis = axes.pick_axis * std::abs(dot(axes.axis, met.ng));
    const float apart = length(met.position - entry.position);
    const Rgb weight = profiles.density(apart) * (axis / (sqr(across) + sqr(along) + sqr(axis)) / pdf);
    const float share = average(weight);
    if (!(share > 0.0f)) continue;
    sum += share;
    const float p = share / sum;
    if (u_keep >= p) {
      u_keep = (u_keep - p) / (1.0f - p);
      continue;
    }
    u_keep /= p;
    // Light leaves by the side that it went in by.
    const Vec3 out = met.backfacing == entry.backfacing ? met.ng : -met.ng;
    const ShadingPoint point = scene.surface_point(hit->instance, hit->triangle, hit->b1, hit->b2, out, entry.path, entry.footprint);
    kept = SubsurfaceExit{point, {}, weight / share};
  }
  if (!kept) return {};
  kept->weight *= sum;
  kept->normal = exit_normal(scene, entry, surface, kept->point);
  return kept;
}

}  // namespace gi
