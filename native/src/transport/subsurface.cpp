// Distances are drawn for one channel and weighed for all (balance heuristic). After some scatterings anisotropy is traded for a longer
// mean free path, which looks the same and takes fewer steps [Wyman et al. 1989, "Similarity relations for anisotropic scattering"].
#include "transport/subsurface.h"

#include "core/warp.h"
#include "shading/lobes/microfacet_distribution.h"
#include "shading/phase.h"
#include "transport/path_state.h"
#include "transport/subsurface_probe.h"

namespace gi {
namespace {

constexpr int kMostSteps = 256;
constexpr int kExactSteps = 9;  // with the medium's own anisotropy
constexpr float kLeastThroughput = 1e-6f;

// Through a rough refractive surface, or (skin, half of the time) diffusely.
std::optional<Vec3> enter(const ShadingPoint& entry, const Subsurface& s, Vec2 u) {
  const Frame frame = Frame::from_normal(s.normal);
  if (s.method == SubsurfaceMethod::kSkin) {
    if (u.x < 0.5f) return -frame.to_world(sample_cosine_hemisphere({2.0f * u.x, u.y}));
    u.x = 2.0f * u.x - 1.0f;
  }
  const Vec3 wo = frame.to_local(entry.wo);
  if (wo.z <= 0.0f) return {};
  const Vec3 h = Ggx{s.alpha, s.alpha}.sample_visible(wo, u);
  const float eta = 1.0f / s.ior, cos_h = dot(h, wo), cos_t = safe_sqrt(1.0f - sqr(eta) * (1.0f - sqr(cos_h)));
  return frame.to_world(h * (eta * cos_h - cos_t) - wo * eta);
}

int draw_channel(Rgb weight, float u, Rgb& pdf) {
  const Rgb w = abs(weight);
  const float sum = w.r() + w.g() + w.b();
  pdf = sum > 0.0f ? w / sum : Rgb(1.0f / 3.0f);
  return u < pdf.r() ? 0 : u < pdf.r() + pdf.g() ? 1 : 2;
}

Rgb attenuated(Rgb sigma_t, float t) { return {std::exp(-sigma_t.r() * t), std::exp(-sigma_t.g() * t), std::exp(-sigma_t.b() * t)}; }

// The mean normal of what the material at `point` lets light below.
Vec3 bent_normal(const Scene& scene, ShadingPoint point) {
  Bsdf bsdf;
  bsdf.carry_subsurface(true);
  scene.shade(point, bsdf);
  Vec3 sum;
  for (int i = 0; i < bsdf.subsurface_count(); ++i) sum += bsdf.subsurface(i).normal * average(bsdf.subsurface(i).weight);
  return normalize_or(sum, point.ns);
}

// A surface that faces the way out, whichever side it was entered by.
SubsurfaceExit leave(const Scene& scene, const ShadingPoint& entry, const Subsurface& surface, const Hit& hit, Vec3 direction, Rgb weight) {
  PathState state = entry.path;
  state.ray_length = hit.t;
  const ShadingPoint point = scene.surface_point(hit.instance, hit.triangle, hit.b1, hit.b2, direction, state, entry.footprint);
  return {point, exit_normal(scene, entry, surface, point), weight};
}

std::optional<SubsurfaceExit> walk_below(const Scene& scene, const ShadingPoint& entry, const Subsurface& surface, Sampler sampler) {
  if (entry.strand != kNoId) return {};  // as Cycles has it, nothing comes out of a curve
  const auto entered = enter(entry, surface, sampler.next_2d());
  if (!entered || dot(entry.ng, *entered) >= 0.0f) return {};
  const SubsurfaceMedium medium = medium_of(surface);
  Vec3 direction = *entered, position = offset_point(entry.position, entry.ng, direction);
  Rgb throughput = medium.entry, sigma_t = medium.sigma_t, sigma_s = medium.sigma_t * medium.albedo;
  float g = medium.anisotropy;
  for (int step = 0; step < kMostSteps; ++step) {
    if (step == kExactSteps + 1) sigma_t = sigma_t - sigma_s * g, sigma_s = sigma_s * (1.0f - g), g = 0.0f;
    if (step > 0) direction = sample_henyey_greenstein(direction, g, sampler.next_2d());

    // Draw a distance; the surface may be nearer.
    Rgb channel_pdf;
    const Vec2 u = sampler.next_2d();
    const int channel = draw_channel(throughput * medium.albedo, u.x, channel_pdf);
    const float reach = -std::log(1.0f - u.y) / sigma_t[channel];
    const auto hit = scene.intersect_instance({position, direction, 0.0f, reach}, entry.instance);
    const Rgb passed = attenuated(sigma_t, hit ? hit->t : reach), pdf = channel_pdf * (hit ? passed : sigma_t * passed);
    const float sum = pdf.r() + pdf.g() + pdf.b();
    if (!(sum > 0.0f)) return {};
    throughput *= (hit ? passed : sigma_s * passed) / sum;
    if (hit) return leave(scene, entry, surface, *hit, direction, throughput);
    if (max_component(throughput) < kLeastThroughput) return {};
    position += direction * reach;
  }
  return {};
}

}  // namespace

Vec3 exit_normal(const Scene& scene, const ShadingPoint& entry, const Subsurface& surface, const ShadingPoint& exit) {
  return surface.normal == entry.ns ? exit.ns : bent_normal(scene, exit);
}

std::optional<SubsurfaceExit> scatter_below(const Scene& scene, const ShadingPoint& entry, const Subsurface& surface, Sampler sampler) {
  const bool by_profile = surface.method == SubsurfaceMethod::kProfile;
  return by_profile ? probe_below(scene, entry, surface, sampler) : walk_below(scene, entry, surface, sampler);
}

}  // namespace gi
