// One render: runs an integrator's passes in the background until it has enough, and answers what is asked meanwhile.
#pragma once
#include <condition_variable>
#include <map>
#include <mutex>
#include <string>
#include <thread>

#include "integrators/integrator.h"
#include "render/lit_scene.h"

namespace gi {

struct RenderSettings {
  std::string integrator = "path";
  int samples = 128;        // passes; 0: no limit of this kind
  double time_limit = 0;    // seconds of sampling; 0: none
  float noise_target = 0;   // of Film::relative_error; 0: none
  uint32_t seed = 0;
  int threads = 0;          // 0: all
  std::map<std::string, std::string> parameters;
};

struct Progress {
  int passes = 0;        // finished
  double fraction = 0;   // of the work asked for, by whichever limit is nearest
  double seconds = 0;    // of sampling
  double remaining = 0;  // estimate; infinite while unknown
  uint64_t rays = 0;
  float noise = kInf;    // last measured Film::relative_error
  uint64_t bad_samples = 0;
  size_t memory = 0;     // bytes: scene and film
  bool done = false, cancelled = false;
  std::string error;
};

class Session {
 public:
  // The scene must outlive the session. Throws InputError.
  // With a `lightmap` it is a bake: the film lies over a surface.
  Session(const LitScene& scene, const Camera& camera, FilmSpec film, RenderSettings settings,
          const std::optional<LightmapSpec>& lightmap = {});
  ~Session();  // cancels and waits
  // Before start(): what a render by the same integrator kept; where the camera will be in other frames. Throws InputError.
  void take_over(const Kept& kept);
  // What an earlier session that has ended, of the same scene, integrator and parameters, knows of the scene's light.
  void continue_from(Session& earlier);
  void look_along(std::vector<Camera> path);
  void stay_steady() { steady_ = true; }
  void start();
  bool wait(double seconds);  // true once it has ended
  void cancel();
  void pause(bool on);  // once the pass under way has ended; the time that it takes does not count
  Progress progress() const;
  const Film& film() const { return film_; }
  const Log& log() const { return log_; }
  Kept kept() const;  // once it has ended
  const Lightmap* lightmap() const { return lightmap_.get(); }

 private:
  void run();
  bool enough(int passes, double seconds, float noise) const;
  double wait_while_paused();  // seconds

  const LitScene& lit_;
  const Scene& scene_;
  Camera camera_;
  std::vector<Camera> path_;
  bool steady_ = false;
  Film film_;
  std::unique_ptr<const Lightmap> lightmap_;
  RenderSettings settings_;
  std::unique_ptr<Integrator> integrator_;
  std::atomic<bool> cancelled_{false}, paused_{false};
  std::atomic<int> tiles_done_{0};
  Log log_;
  std::thread thread_;
  mutable std::mutex mutex_;
  std::condition_variable ended_, woken_;
  Progress progress_;
  double pass_started_ = 0;
  std::atomic<uint64_t> rays_before_{0};
};

}  // namespace gi
