// The camera the other way round: from a point of the scene through the lens to the film, for paths that come from the light.
// Leaves out what lies between.
#pragma once
#include <optional>

#include "scene/camera.h"

namespace gi {

struct LensSample {
  Vec3 wi;         // unit, from the point to the lens
  float distance;  // to the lens; for orthographic cameras to the plane it lies in
  float free;      // part of the way that the camera can see: up to its near clip plane
  Vec2 film;       // (x, y) over the full frame, as Camera::sample takes them; may lie beside it
  float density;   // per square metre across the ray, with which rays that are uniform over the frame come by the point
};

// `u_lens` as for Camera::sample. None where the camera does not see the point.
std::optional<LensSample> sample_lens(const Camera& camera, Vec3 position, Vec2 u_lens);

// The same density, `t` along a ray from Camera::sample. Approximate for panoramas with depth of field.
float lens_density(const Camera& camera, const Ray& ray, float t);

// Panoramas all around meet themselves at their edges: the film's sides, and half a turn on at each pole.
inline bool film_wraps(const Camera& camera) {
  return camera.kind == Camera::Kind::kPanoramic && std::abs(std::abs(camera.longitude[1] - camera.longitude[0]) - 2.0f * kPi) < 1e-4f;
}

}  // namespace gi
