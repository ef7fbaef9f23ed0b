// Light that comes out of a surface near where it went in, by the distance alone: the object's surface is looked for along a ray through a
// disc about the entry, of three axes of which one is drawn. [King et al. 2013, "BSSRDF importance sampling"]
#pragma once
#include "transport/subsurface.h"

namespace gi {

std::optional<SubsurfaceExit> probe_below(const Scene& scene, const ShadingPoint& entry, const Subsurface& surface, Sampler sampler);

}  // namespace gi
