// Random walks below a surface: light that enters an object here leaves it somewhere else. The medium is homogeneous and the object's
// own surface its only border. [Kulla & Conty 2017, "Revisiting physically based shading"]
#pragma once
#include "core/sampler.h"
#include "scene/scene.h"
#include "shading/subsurface.h"

namespace gi {

struct SubsurfaceExit {
  ShadingPoint point;  // where light leaves, seen from outside along the way out
  Vec3 normal;         // bent there as the material bends it
  Rgb weight;
};

// A white diffuse surface, which is how light leaves.
inline void set_exit(const SubsurfaceExit& exit, Bsdf& bsdf) {
  bsdf.clear(exit.point.ng, exit.point.ns);
  const Rgb white(1.0f);
  bsdf.add(white, Lambert{}, Frame::from_normal(exit.normal), &white);
  bsdf.finish(exit.point.wo);
}

// Nothing where the walk is absorbed, or leaves through a hole.
std::optional<SubsurfaceExit> walk_below(const Scene& scene, const ShadingPoint& entry, const Subsurface& surface, Sampler sampler);

}  // namespace gi
