// What the film's data passes want to know of the first surface that is not see-through.
#pragma once
#include "film/film.h"
#include "transport/render_context.h"

namespace gi {

// Fills the sample's data passes unless that was done already. Blender's rule: a surface counts from half opacity on.
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

}  // namespace gi
