// What everything that follows light is given: the scene, its lights, the camera, threads. Leaves out the film.
#pragma once
#include <atomic>
#include <chrono>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "core/parallel.h"
#include "lights/lights.h"
#include "scene/camera.h"
#include "scene/scene.h"
#include "transport/lightmap.h"
#include "transport/volumes.h"

namespace gi {

// What the user should be told of a render: texts, and figures by name. Any thread.
class Log {
 public:
  void say(std::string text) {
    const std::lock_guard lock(mutex_);
    texts_.push_back(std::move(text));
  }
  void set(const std::string& figure, double value) {
    const std::lock_guard lock(mutex_);
    for (auto& [name, old] : figures_)
      if (name == figure) return void(old = value);
    figures_.emplace_back(figure, value);
  }
  // In a few words, for the line over the picture.
  void note(std::string text) {
    const std::lock_guard lock(mutex_);
    note_ = std::move(text);
  }
  std::string note() const {
    const std::lock_guard lock(mutex_);
    return note_;
  }
  // What is being done while no pass is under way yet; empty: nothing of the kind.
  void stage(std::string text) {
    const std::lock_guard lock(mutex_);
    stage_ = std::move(text);
  }
  std::string stage() const {
    const std::lock_guard lock(mutex_);
    return stage_;
  }
  std::vector<std::string> texts() const {
    const std::lock_guard lock(mutex_);
    return texts_;
  }
  std::vector<std::pair<std::string, double>> figures() const {
    const std::lock_guard lock(mutex_);
    return figures_;
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::string> texts_;
  std::string stage_, note_;
  std::vector<std::pair<std::string, double>> figures_;
};

struct RenderContext {
  const Scene& scene;
  const LightSet& lights;
  const Volumes& volumes;
  const Camera& camera;
  ThreadPool& pool;
  uint32_t seed = 0;
  const std::atomic<bool>& cancelled;
  std::atomic<int>& tiles_done;  // of the pass under way
  Log& log;
  const Lightmap* lightmap = nullptr;  // in a bake: takes the camera's place
  std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  double time_limit = 0;               // seconds from `start`; 0: none
  int passes = 0;                      // that are wanted; 0: as many as there is time for
  std::span<const Camera> path = {};   // where the camera will be in other frames, which what is kept may serve as well

  bool steady = false;                 // a frame among others: what it takes over stays as it is

  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(); }
  // Whether what has gone on since `began` has had this share of a time limit.
  bool has_had(double share, double began) const { return time_limit > 0.0 && seconds() - began > share * time_limit; }
};

}  // namespace gi
