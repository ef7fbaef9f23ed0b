// A scene with its lights, which the first session to start works out for all that follow.
#pragma once
#include <memory>
#include <mutex>

#include "lights/lights.h"
#include "scene/scene.h"

namespace gi {

class LitScene {
 public:
  explicit LitScene(std::unique_ptr<const Scene> scene) : scene_(std::move(scene)) {}
  const Scene& scene() const { return *scene_; }
  // `threads` for working them out; 0: one for each core. Any thread.
  const LightSet& lights(int threads) const {
    const std::lock_guard lock(mutex_);
    if (!lights_) lights_ = std::make_unique<const LightSet>(*scene_, threads);
    return *lights_;
  }

 private:
  std::unique_ptr<const Scene> scene_;
  mutable std::mutex mutex_;
  mutable std::unique_ptr<const LightSet> lights_;
};

}  // namespace gi
