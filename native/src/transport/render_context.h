// What everything that follows light is given: the scene, its lights, the camera, threads. Leaves out the film.
#pragma once
#include <atomic>

#include "core/parallel.h"
#include "lights/lights.h"
#include "scene/camera.h"
#include "scene/scene.h"

namespace gi {

struct RenderContext {
  const Scene& scene;
  const LightSet& lights;
  const Camera& camera;
  ThreadPool& pool;
  uint32_t seed = 0;
  const std::atomic<bool>& cancelled;
  std::atomic<int>& tiles_done;  // of the pass under way
};

}  // namespace gi
