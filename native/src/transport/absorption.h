// What volumes that do nothing but absorb let pass, for integrators that carry no others: asked of each straight way anew, without
// knowing how the path came there. Of closed objects, and the world.
#pragma once
#include "transport/media.h"
#include "transport/render_context.h"

namespace gi {

// Of a ray up to ray.t_max, surfaces left out.
Rgb absorption_along(const RenderContext& context, const Ray& ray, const PathState& path);

// The same, where there may be any.
inline Rgb passed_by_absorbers(const RenderContext& context, Ray ray, float t_max, const PathState& path) {
  if (!context.volumes.any_only_absorbs()) return Rgb(1.0f);
  ray.t_max = t_max;
  return absorption_along(context, ray, path);
}

}  // namespace gi
