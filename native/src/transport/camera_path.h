// What every path from the camera does: it begins at each pixel, and at each ray it leaves the scene or arrives at a surface,
// of which the first that is not see-through fills the data passes.
#pragma once
#include "core/sampler.h"
#include "film/film.h"
#include "transport/direct_light.h"

namespace gi {

// The camera rays of a row of a tile, made at once: a row has as many lanes as it has pixels, whatever the tile's width.
struct CameraRow {
  static constexpr int kWidth = Film::kTileSize;
  SamplerRow<kWidth> samplers;
  CameraRay rays[kWidth];

  // From pixel (x, y) of the full frame on, which is also what random numbers are keyed by: a region shows what the whole would.
  CameraRow(const RenderContext& context, const Film& film, int x, int y, int pass)
      : samplers(context.seed, uint32_t(y) * uint32_t(film.spec().width) + uint32_t(x), uint32_t(pass)) {
    const Vec2 pixel{1.0f / float(film.spec().width), 1.0f / float(film.spec().height)};
    float at_x[kWidth], at_y[kWidth], lens_x[kWidth], lens_y[kWidth];
    samplers.pairs(0, at_x, at_y);
    for (int i = 0; i < kWidth; ++i) {
      const Vec2 offset = film.filter().sample({at_x[i], at_y[i]});
      at_x[i] = (float(x + i) + 0.5f + offset.x) * pixel.x, at_y[i] = (float(y) + 0.5f + offset.y) * pixel.y;
    }
    const Camera& camera = context.camera;
    if (camera.is_pinhole() && !context.lightmap) {
      camera.sample_pinhole<kWidth>(at_x, at_y, pixel, rays);
      return;
    }
    samplers.pairs(1, lens_x, lens_y);
    if (!context.lightmap) {
      for (int i = 0; i < kWidth; ++i) rays[i] = camera.sample({at_x[i], at_y[i]}, pixel, {lens_x[i], lens_y[i]});
      return;
    }
    samplers.pairs(2, at_x, at_y);
    for (int i = 0; i < kWidth; ++i)
      if (context.lightmap->covers(x + i, y)) rays[i] = context.lightmap->sample(x + i, y, {lens_x[i], lens_y[i]}, {at_x[i], at_y[i]});
  }
};

// Calls begin(tile) for every tile of the film, in threads, and then f(camera ray, sampler, sample to fill, x, y) for each of its pixels
// (x, y) within the region.
template <class Begin, class F>
void for_each_tile(const RenderContext& context, int pass, Film& film, const Begin& begin, const F& f) {
  const FilmSpec& spec = film.spec();
  context.pool.for_each(int(film.tiles().size()), context.cancelled, [&](int index) {
    const Tile& tile = film.tiles()[size_t(index)];
    begin(tile);
    for (int y = tile.y0; y < tile.y1; ++y) {
      const CameraRow row(context, film, spec.x0 + tile.x0, spec.y0 + y, pass);
      PixelSample samples[CameraRow::kWidth];
      std::vector<float> aovs(CameraRow::kWidth * film.aov_floats());
      for (size_t i = 0; i < CameraRow::kWidth; ++i) samples[i].aovs = std::span(aovs).subspan(i * film.aov_floats(), film.aov_floats());
      for (int i = 0; i < tile.x1 - tile.x0; ++i) {
        if (context.lightmap && !context.lightmap->covers(spec.x0 + tile.x0 + i, spec.y0 + y)) continue;
        Sampler sampler = row.samplers.sampler(i);
        f(row.rays[i], sampler, samples[i], tile.x0 + i, y);
      }
      film.add_row(index, y, pass, samples);
    }
    ++context.tiles_done;
  });
}

// Calls f(camera ray, sampler, sample to fill) for every pixel of the film, tile by tile in threads.
template <class F>
void for_each_pixel(const RenderContext& context, int pass, Film& film, const F& f) {
  const auto pixel = [&](const CameraRay& ray, Sampler& sampler, PixelSample& sample, int, int) { f(ray, sampler, sample); };
  for_each_tile(context, pass, film, [](const Tile&) {}, pixel);
}

// The data passes. Blender's rule: a surface counts from half opacity on.
inline void record_surface(const RenderContext& context, const ShadingPoint& point, const Bsdf& bsdf, PixelSample& sample) {
  if (sample.has_surface || average(bsdf.passed()) > 0.5f) return;
  sample.has_surface = true;
  sample.depth = context.camera.depth(point.position);
  sample.position = point.position;
  sample.normal = bsdf.mean_normal();
  sample.albedo = bsdf.albedo(point.wo);
  sample.object_index = float(context.scene.instances()[point.instance].data->object_index);
  sample.material_index = float(context.scene.material(context.scene.material_of(point.instance, point.triangle)).pass_index);
  float uv[4];
  sample.has_uv = context.scene.active_uv(point, uv);
  sample.uv = {uv[0], uv[1]};
}

// One ray of such a path, and what it carries.
struct CameraPath {
  Ray ray;
  PathState state;
  RayOrigin origin;
  Rgb throughput{1.0f};
  float travelled = 0;           // metres, for the footprint
  bool seen_from_camera = true;  // nothing but transparent surfaces so far: what is not covered makes holes in alpha

  explicit CameraPath(const CameraRay& camera) : ray(camera.ray) { origin.query.path = state; }

  float footprint(const CameraRay& camera, const Hit& hit) const { return camera.footprint + camera.spread * (travelled + hit.t); }

  // The way to a surface at t, or to nowhere: what volumes that only absorb take. For integrators that carry no others.
  void absorb(const RenderContext& context, float t) { throughput *= passed_by_absorbers(context, ray, t, state); }

  // The ray leaves the scene: suns and the world, or a hole in the picture where the film is transparent. Returns radiance.
  LightBeyond leave(const RenderContext& context, const Film& film, LightSampling mode, PixelSample& sample) const {
    if (seen_from_camera && film.spec().transparent) {
      sample.alpha -= average(throughput);
      return {};
    }
    record_world(context, sample);
    const LightBeyond beyond = light_beyond(context, ray, origin, mode, state);
    if (seen_from_camera) sample.environment += throughput * Rgb(beyond);
    return beyond;
  }

  // AOVs of the world, where the camera sees it.
  void record_world(const RenderContext& context, PixelSample& sample) const {
    if (seen_from_camera && !sample.has_surface && !sample.aovs.empty())
      context.scene.add_aovs(context.scene.world_point(ray.direction, state), sample.aovs);
  }

  // Past its last bounce the path only looks for luminaires. What it finds on the surface that it met; nothing if that lets
  // light through, or may cut a hole into the picture: then `arrive` has to be asked.
  std::optional<Rgb> end(const RenderContext& context, const CameraRay& camera, const Hit& hit, LightSampling mode) const {
    const Scene& scene = context.scene;
    const Program& program = scene.material(scene.material_of(hit.instance, hit.triangle)).program;
    if (seen_from_camera || program.has_transparency()) return {};
    if (!program.has_emission()) return Rgb();
    ShadingPoint point = scene.shading_point(ray, hit, state, footprint(camera, hit));
    return surface_emission(context, point, scene.emission(point), origin, mode);
  }

  // The ray goes on past a surface at `distance` that did not scatter it: straight, or from where a portal leads to. No light is chosen
  // for what lies behind portals: the ray has to meet it.
  void pass(const ShadingPoint& point, const Bsdf& bsdf, const BsdfSample& next, float distance) {
    travelled += distance;
    if (next.which < 0) {
      ray = ray_from(point, ray.direction, ray.t_max - distance);
    } else {
      constexpr float kMoved2 = 1e-9f;  // square metres; Blender's own
      const Portal& p = bsdf.portal(next.which);
      const bool is_elsewhere = length_squared(p.position - point.position) > kMoved2;
      ray = {is_elsewhere ? p.position : offset_point(p.position, point.ng, p.direction), p.direction};
    }
    if (next.flags & kPortal) origin.pdf_dir = kInf;
    origin.query.path = state;
  }

  // The ray arrives at a surface: shades it, for the data passes too, and cuts out what is held out.
  ShadingPoint arrive(const RenderContext& context, const Film& film, const CameraRay& camera, const Hit& hit, Bsdf& bsdf,
                      PixelSample& sample) const {
    ShadingPoint point = context.scene.shading_point(ray, hit, state, footprint(camera, hit));
    if (state.depth == 0 && !sample.has_surface && !sample.aovs.empty()) context.scene.add_aovs(point, sample.aovs);
    context.scene.shade(point, bsdf);
    if (context.lightmap && state.depth == 0) context.lightmap->adapt(bsdf, point.wo, point.ng, point.ns);
    if (state.depth == 0 && film.has_data_passes()) record_surface(context, point, bsdf, sample);
    if (seen_from_camera) {
      if (context.scene.instances()[point.instance].data->holdout) bsdf.hold_out();
      sample.alpha -= average(throughput * bsdf.holdout);
    }
    return point;
  }
};

}  // namespace gi
