// Which absorbing volumes a straight way begins in is asked along the way itself.
#include "transport/absorption.h"

#include <bit>

namespace gi {

Rgb absorption_along(const RenderContext& context, const Ray& ray, const PathState& path) {
  // No two ways of a path are the same, so each may have random numbers of its own.
  uint32_t key = context.seed;
  for (const float x : {ray.origin.x, ray.origin.y, ray.origin.z, ray.direction.x, ray.direction.y, ray.direction.z})
    key = hash_combine(key, std::bit_cast<uint32_t>(x));
  Sampler random(key, 0, 0);
  Media media(context.volumes, /*only_absorbing=*/true);
  media.begin_at(context.scene, ray.origin, ray.direction);
  return media.transmittance_through(context.scene, ray, path, random);
}

}  // namespace gi
