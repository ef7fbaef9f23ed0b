// Session: the pass loop and its limits.
#include "render/session.h"

#include <chrono>

#include "core/check.h"

namespace gi {
namespace {

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

}  // namespace

Session::Session(const LitScene& scene, const Camera& camera, FilmSpec film, RenderSettings settings,
                 const std::optional<LightmapSpec>& lightmap)
    : lit_(scene), scene_(scene.scene()), camera_(camera), film_(std::move(film)), settings_(std::move(settings)) {
  require(settings_.samples >= 0 && settings_.time_limit >= 0 && settings_.noise_target >= 0,
          "samples, time limit and noise target must not be negative");
  require(settings_.samples > 0 || settings_.time_limit > 0 || settings_.noise_target > 0,
          "0 samples and neither a time limit nor a noise target: there is nothing to render");
  const Descriptor& d = find_integrator(settings_.integrator);
  if (lightmap) {
    require(d.bakes, "integrator '" + settings_.integrator + "' cannot bake lightmaps");
    lightmap_ = std::make_unique<const Lightmap>(scene_, *lightmap, film_.spec().width, film_.spec().height);
  }
  integrator_ = d.create(Parameters(d.parameters, settings_.parameters, d.id));
}

Session::~Session() {
  cancel();
  if (thread_.joinable()) thread_.join();
}

void Session::start() {
  require(!thread_.joinable(), "the session was started already");
  thread_ = std::thread([this] { run(); });
}

void Session::take_over(const Kept& kept) {
  require(!thread_.joinable(), "the session was started already");
  integrator_->take_over(kept);
}

void Session::continue_from(Session& earlier) {
  require(!thread_.joinable(), "the session was started already");
  require(earlier.progress().done, "the earlier session has not ended");
  require(&earlier.scene_ == &scene_ && earlier.settings_.integrator == settings_.integrator &&
              earlier.settings_.parameters == settings_.parameters,
          "the earlier session was of another scene, integrator or parameters");
  integrator_->continue_from(*earlier.integrator_);
}

void Session::look_along(std::vector<Camera> path) {
  require(!thread_.joinable(), "the session was started already");
  path_ = std::move(path);
}

Kept Session::kept() const {
  require(progress().done, "the session has not ended");
  return integrator_->keep();
}

void Session::cancel() {
  const std::lock_guard lock(mutex_);
  cancelled_ = true;
  woken_.notify_all();
}

void Session::pause(bool on) {
  const std::lock_guard lock(mutex_);
  paused_ = on;
  woken_.notify_all();
}

double Session::wait_while_paused() {
  const double since = now();
  std::unique_lock lock(mutex_);
  woken_.wait(lock, [this] { return !paused_ || cancelled_; });
  return now() - since;
}

bool Session::wait(double seconds) {
  std::unique_lock lock(mutex_);
  return ended_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return progress_.done; });
}

bool Session::enough(int passes, double seconds, float noise) const {
  return (settings_.samples > 0 && passes >= settings_.samples) || (settings_.time_limit > 0 && seconds >= settings_.time_limit) ||
         (settings_.noise_target > 0 && noise <= settings_.noise_target);
}

void Session::run() {
  std::string error;
  try {
    ThreadPool pool(settings_.threads);
    scene_.resources().camera = &camera_;
    const Volumes volumes(scene_, pool);
    const RenderContext context{scene_,
                                lit_.lights(settings_.threads),
                                volumes,
                                camera_,
                                pool,
                                settings_.seed,
                                cancelled_,
                                tiles_done_,
                                log_,
                                lightmap_.get(),
                                std::chrono::steady_clock::now(),
                                settings_.time_limit,
                                settings_.samples,
                                path_,
                                steady_};
    double start = now();
    integrator_->prepare(context);
    float noise = kInf;
    int next_check = 16;  // passes; fewer say nothing of noise
    for (int pass = 0; !cancelled_; ++pass) {
      if (paused_) start += wait_while_paused();
      if (cancelled_) break;
      {
        const std::lock_guard lock(mutex_);
        tiles_done_ = 0;
        pass_started_ = now();
        progress_.seconds = pass_started_ - start;
      }
      integrator_->render_pass(context, pass, film_);
      if (cancelled_) break;
      integrator_->finish_pass(context, pass);
      const double seconds = now() - start;
      if (settings_.noise_target > 0 && pass + 1 >= next_check) {
        noise = film_.relative_error();
        next_check = pass + 1 + std::max(8, (pass + 1) / 16);
      }
      {
        const std::lock_guard lock(mutex_);
        progress_.passes = pass + 1;
        progress_.seconds = seconds;
        progress_.noise = noise;
        pass_started_ = 0;
      }
      if (enough(pass + 1, seconds, noise)) break;
    }
    if (volumes.rays_given_up() > 0)
      log_.say(std::to_string(volumes.rays_given_up()) +
               " rays through volumes took too long to follow and went on in even steps, which is less exact: somewhere a "
               "volume is very thick beside where it is thin");
  } catch (const std::bad_alloc&) {
    error = "out of memory while rendering";
  } catch (const std::exception& e) {
    error = e.what();
  }
  const std::lock_guard lock(mutex_);
  progress_.done = true;
  progress_.cancelled = cancelled_;
  progress_.error = error;
  ended_.notify_all();
}

Progress Session::progress() const {
  const std::lock_guard lock(mutex_);
  Progress p = progress_;
  const double part = p.done || pass_started_ == 0 ? 0 : double(tiles_done_) / double(film_.tiles().size());
  if (!p.done && pass_started_ != 0) p.seconds += now() - pass_started_;
  const double passes = p.passes + part;
  p.rays = scene_.rays_traced();
  p.bad_samples = film_.bad_samples();
  p.memory = scene_.memory_bytes() + film_.memory_bytes();
  // Noise falls with the square root of the number of passes.
  if (settings_.samples > 0) p.fraction = passes / settings_.samples;
  if (settings_.time_limit > 0) p.fraction = std::max(p.fraction, p.seconds / settings_.time_limit);
  if (settings_.noise_target > 0 && std::isfinite(p.noise))
    p.fraction = std::max(p.fraction, double(sqr(settings_.noise_target / std::max(p.noise, 1e-6f))));
  p.fraction = p.done && !p.cancelled ? 1.0 : std::min(p.fraction, 1.0);
  p.remaining = p.done ? 0.0 : p.fraction > 0 ? p.seconds * (1 / p.fraction - 1) : double(kInf);
  return p;
}

}  // namespace gi
