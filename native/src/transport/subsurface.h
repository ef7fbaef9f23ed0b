// Light that enters an object here leaves it somewhere else: by a random walk through a homogeneous medium, of which the object's own
// surface is the only border [Kulla & Conty 2017, "Revisiting physically based shading"], or by a profile (subsurface_probe.h).
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

// The normal there, bent where the material bends it where light enters.
Vec3 exit_normal(const Scene& scene, const ShadingPoint& entry, const Subsurface& surface, const ShadingPoint& exit);

// As the surface's method says. Nothing where light is absorbed, or leaves through a hole.
std::optional<SubsurfaceExit> scatter_below(const Scene& scene, const ShadingPoint& entry, const Subsurface& surface, Sampler sampler);

}  // namespace gi
