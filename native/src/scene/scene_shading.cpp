// Scene: running programs at points, and what passes along shadow rays.
#include "scene/scene.h"

namespace gi {

void Scene::shade(ShadingPoint& point, Bsdf& bsdf) const {
  bsdf.clear(point.ng, point.ns, point.path.without);
  if (point.strand != kNoId) strands_[point.mesh]->are_points() ? bsdf.set_on_point() : bsdf.set_on_curve();
  bsdf.set_terminator_frequency(1.0f / (1.0f - 0.5f * instances_[point.instance].data->shadow_terminator_offset));
  const MaterialData& m = material(material_of(point.instance, point.triangle));
  bsdf.set_bump_correction(m.bump_correction);
  m.program.run(point, *resources_, &bsdf);
  bsdf.finish(point.wo);
}

void Scene::add_aovs(const ShadingPoint& point, std::span<float> aovs) const {
  const int program = point.instance == kNoId ? data_.world.program : material_of(point.instance, point.triangle);
  if (program >= 0 && material(program).program.has_aovs()) material(program).program.add_aovs(point, *resources_, aovs);
}

Rgb Scene::emission(ShadingPoint& point) const { return run_emission(material_of(point.instance, point.triangle), point); }

Rgb Scene::run_emission(int program, ShadingPoint& point) const {
  const Program& p = material(program).program;
  if (const auto& constant = p.constant_emission()) return *constant;
  Bsdf bsdf;
  bsdf.clear(point.ng, point.ns);
  p.emission_program().run(point, *resources_, &bsdf);
  return bsdf.emission;
}

Rgb Scene::transparency(ShadingPoint& point) const {
  const Program& p = material(material_of(point.instance, point.triangle)).program;
  if (!p.has_transparency()) return Rgb();
  Bsdf bsdf;
  bsdf.clear(point.ng, point.ns);
  p.transparency_program().run(point, *resources_, &bsdf);
  return bsdf.transparency;
}

void Scene::add_medium(int m, ShadingPoint& point, Medium& medium) const {
  const int volume = material(m).volume;
  if (volume >= 0) material(volume).program.run(point, *resources_, nullptr, &medium);
}

Rgb Scene::world_radiance(Vec3 direction, const PathState& path) const {
  if (data_.world.program < 0) return Rgb();
  ShadingPoint point = world_point(direction, path);
  return run_emission(data_.world.program, point);
}

namespace {
std::atomic<size_t> threads_seen{0};
constinit thread_local size_t my_counter = 0;  // from 1 on; 0: not yet given
}  // namespace

void Scene::count_ray() const {
  if (my_counter == 0) my_counter = 1 + threads_seen++ % kRayCounters;
  std::atomic<uint64_t>& counter = rays_[my_counter - 1].value;
  counter.store(counter.load(std::memory_order_relaxed) + 1, std::memory_order_relaxed);
}

uint64_t Scene::rays_traced() const {
  uint64_t sum = 0;
  for (const RayCounter& c : rays_) sum += c.value.load(std::memory_order_relaxed);
  return sum;
}

Rgb Scene::transmittance(const Ray& ray, const PathState& path) const {
  count_ray();
  if (accel_->occluded(ray, kRayShadow)) return Rgb();
  Rgb passed(1.0f);
  if (!any_transparent_) return passed;
  static thread_local std::vector<Hit> hits;
  accel_->all_hits(ray, kTransparentShadowBit, hits);
  PathState state = path;
  state.kind = kRayShadow;
  for (const Hit& hit : hits) {
    const MaterialData& m = material(material_of(hit.instance, hit.triangle));
    if (!m.transparent_shadows) return Rgb();
    ShadingPoint point = shading_point(ray, hit, state);
    passed *= transparency(point);
    if (is_black(passed)) return Rgb();
    ++state.transparent_depth;
  }
  return passed;
}

}  // namespace gi
