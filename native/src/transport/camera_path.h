// What every path from the camera does: it begins at each pixel, and at each ray it leaves the scene or arrives at a surface,
// of which the first that is not see-through fills the data passes.
#pragma once
#include "core/sampler.h"
#include "film/film.h"
#include "transport/direct_light.h"

namespace gi {

// Calls f(camera ray, sampler, sample to fill) for every pixel of the film, tile by tile in threads. Row by row within: all its
// rays are made at once, which hides how long each takes.
template <class F>
void for_each_pixel(const RenderContext& context, int pass, Film& film, const F& f) {
  const FilmSpec& spec = film.spec();
  const Vec2 pixel{1.0f / float(spec.width), 1.0f / float(spec.height)};
  context.pool.for_each(int(film.tiles().size()), context.cancelled, [&](int index) {
    const Tile& tile = film.tiles()[size_t(index)];
    for (int y = tile.y0; y < tile.y1; ++y) {
      Sampler samplers[Film::kTileSize];
      CameraRay rays[Film::kTileSize];
      PixelSample samples[Film::kTileSize];
      const int width = tile.x1 - tile.x0;
      for (int i = 0; i < width; ++i) {
        // Keyed by the place in the full frame: a region shows what the whole picture would.
        const int px = spec.x0 + tile.x0 + i, py = spec.y0 + y;
        Sampler& sampler = samplers[i] = Sampler(context.seed, uint32_t(py) * uint32_t(spec.width) + uint32_t(px), uint32_t(pass));
        const Vec2 offset = film.filter().sample(sampler.next_2d());
        const Vec2 lens = sampler.next_2d();
        const Vec2 at{(float(px) + 0.5f + offset.x) * pixel.x, (float(py) + 0.5f + offset.y) * pixel.y};
        if (!context.lightmap)
          rays[i] = context.camera.sample(at, pixel, lens);
        else if (context.lightmap->covers(px, py))
          rays[i] = context.lightmap->sample(px, py, lens, sampler.next_2d());
      }
      for (int i = 0; i < width; ++i) {
        if (!context.lightmap || context.lightmap->covers(spec.x0 + tile.x0 + i, spec.y0 + y)) f(rays[i], samplers[i], samples[i]);
      }
      film.add_row(index, y, pass, samples);
    }
    ++context.tiles_done;
  });
}

// The data passes. Blender's rule: a surface counts from half opacity on.
inline void record_surface(const RenderContext& context, const ShadingPoint& point, const Bsdf& bsdf, PixelSample& sample) {
  if (sample.has_surface || average(bsdf.transparency) > 0.5f) return;
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

  // The ray leaves the scene: suns and the world, or a hole in the picture where the film is transparent. Returns radiance.
  Rgb leave(const RenderContext& context, const Film& film, LightSampling mode, PixelSample& sample) const {
    if (seen_from_camera && film.spec().transparent) {
      sample.alpha -= average(throughput);
      return Rgb();
    }
    const Rgb beyond = light_beyond(context, ray, origin, mode, state);
    if (seen_from_camera) sample.environment += throughput * beyond;
    return beyond;
  }

  // The ray arrives at a surface: shades it, for the data passes too, and cuts out what is held out.
  ShadingPoint arrive(const RenderContext& context, const Film& film, const CameraRay& camera, const Hit& hit, Bsdf& bsdf,
                      PixelSample& sample) const {
    ShadingPoint point = context.scene.shading_point(ray, hit, state, camera.footprint + camera.spread * (travelled + hit.t));
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
