// Which media, and the ways through them. Where one varies: delta tracking for distances, residual ratio tracking for what passes.
#include "transport/media.h"

#include "transport/path_state.h"

namespace gi {
namespace {

// Whether a ray along `direction` goes into the object where it hits it.
bool goes_in(const Scene& scene, const Hit& hit, Vec3 direction) {
  return !scene.surface_point(hit.instance, hit.triangle, hit.b1, hit.b2, -direction, {}).backfacing;
}

// In closed form: a distance is drawn for one channel and weighed for all (balance heuristic).
MediumEvent sample_uniform(const Medium& medium, float t_max, Rgb throughput, bool may_scatter, Vec2 u) {
  MediumEvent e;
  e.emitted = medium.emitted(std::min(t_max, 1e30f));
  if (!may_scatter || !medium.scatters()) {
    e.t = t_max, e.weight = medium.transmittance(t_max);
    return e;
  }
  const Rgb sigma = medium.sigma_t, share = abs(throughput);
  const float sum = share.r() + share.g() + share.b();
  const Rgb pick = sum > 0.0f ? share / sum : Rgb(1.0f / 3.0f);
  const int channel = u.x < pick.r() ? 0 : u.x < pick.r() + pick.g() ? 1 : 2;
  const float t = sigma[channel] > 0.0f ? -std::log(1.0f - u.y) / sigma[channel] : kInf;
  e.scattered = t < t_max;
  e.t = std::min(t, t_max);
  if (e.scattered) e.medium = medium;
  const Rgb passed = medium.transmittance(e.t), density = pick * (e.scattered ? sigma * passed : passed);
  const float pdf = density.r() + density.g() + density.b();
  e.weight = pdf > 0.0f ? passed / pdf : Rgb();
  return e;
}

// Goes along `way` from collision to collision with anything that there may be: each comes after an optical depth drawn anew, of the rate
// that `rate` makes of bounds. pass(bounds, length) is called for each stretch between, collide(t, rate) at each collision; false ends it.
// Where that was given up for so many collisions, for marched() to go on: a cell with very much in one place, and nothing in another.
template <class Way, class Rate, class Pass, class Collide>
std::optional<float> track(const Way& way, float from, float t_max, Sampler& random, const Rate& rate, const Pass& pass,
                           const Collide& collide) {
  constexpr int kMostLooks = 1 << 15;
  t_max = std::min(t_max, way.end());
  int looks = 0;
  const auto draw = [&] { return -std::log(1.0f - random.next_1d()); };
  float depth = draw();
  for (float t = from; t < t_max;) {
    float until;
    const VolumeBounds b = way.bounds(t, until);
    until = std::min(until, t_max);
    const float r = rate(b);
    while (true) {
      const float next = t + depth / r;
      if (!(next < until)) break;
      pass(b, next - t);
      t = next, depth = draw();
      if (!collide(t, b, r)) return {};
      if (++looks == kMostLooks) return t;
    }
    pass(b, until - t);
    depth = std::max(depth - r * (until - t), 0.0f), t = until;
  }
  return {};
}

// Goes on along `way` in even steps: march(from, length, medium) for each, with what there is somewhere in it; false ends it. Biased, but
// in bounded time.
template <class Way, class March>
void marched(const Way& way, float from, float t_max, Sampler& random, const March& march) {
  constexpr int kSteps = 1 << 10;
  const float length = (std::min(t_max, way.end()) - from) / float(kSteps);
  for (int i = 0; i < kSteps && length > 0.0f; ++i) {
    const float begin = from + float(i) * length;
    if (!march(begin, length, way.at(begin + random.next_1d() * length))) return;
  }
}

}  // namespace

// ---------------------------------------------------------------- which

void Media::reset() {
  count_ = 0;
  const int world = volumes_->world();
  if (world >= 0 && (!only_absorbing_ || (*volumes_)[world].only_absorbs)) inside_[count_++] = world;
}

void Media::set(const Scene& scene, uint32_t instance, uint32_t triangle, bool inside) {
  const int volume = volumes_->find(instance, scene.material_of(instance, triangle));
  if (volume < 0 || (only_absorbing_ && !(*volumes_)[volume].only_absorbs)) return;
  for (int i = 0; i < count_; ++i) {
    if (inside_[i] != volume) continue;
    if (!inside) inside_[i] = inside_[--count_];
    return;
  }
  if (inside && count_ < kMost) inside_[count_++] = volume;
}

void Media::begin_at(const Scene& scene, Vec3 position, Vec3 direction) {
  reset();
  // What a ray comes out of without having gone into is where it began; the last surface of each object decides.
  static thread_local std::vector<Hit> hits;
  scene.volume_hits({position, direction, 0.0f, kInf}, hits);
  for (size_t i = hits.size(); i-- > 0;) set(scene, hits[i].instance, hits[i].triangle, !goes_in(scene, hits[i], direction));
}

void Media::cross(const Scene& scene, const ShadingPoint& point, Vec3 direction) {
  if (point.strand != kNoId) return;  // holds nothing
  const bool inwards = (dot(point.ng, direction) < 0.0f) != point.backfacing;
  set(scene, point.instance, point.triangle, inwards);
}

// ---------------------------------------------------------------- what

// A ray within media that it does not leave before t_max: what they are, and bounds of it.
class Media::Way {
 public:
  Way(const Media& media, const Scene& scene, const Ray& ray, float from, const PathState& path);
  const Medium& uniform() const { return uniform_; }  // that part of what is there
  bool is_uniform() const { return varying_count_ == 0; }
  // All that is there.
  Medium at(float t) const;
  // Bounds at t, and up to where they hold.
  VolumeBounds bounds(float t, float& until) const;
  float end() const { return end_; }  // of all that is not alike all over

 private:
  struct Varying {
    const Volume* volume;
    Vec3 origin, direction;  // in the space of its grid
    float end;               // there is nothing beyond its boxes
  };
  const Scene& scene_;
  const Ray& ray_;
  const PathState& path_;
  Medium uniform_;
  Varying varying_[kMost];
  int varying_count_ = 0;
  float end_ = 0;
};

Media::Way::Way(const Media& media, const Scene& scene, const Ray& ray, float from, const PathState& path)
    : scene_(scene), ray_(ray), path_(path) {
  for (int i = 0; i < media.count_; ++i) {
    const Volume& v = (*media.volumes_)[media.inside_[i]];
    if (v.is_uniform()) {
      add_medium(scene, v, ray.origin + ray.direction * from, -ray.direction, path, uniform_);
      continue;
    }
    Varying& varying = varying_[varying_count_++];
    const Affine to_object = v.instance == kNoId ? Affine{} : scene.instances()[v.instance].to_object;
    varying = {&v, to_object.point(ray.origin), to_object.vector(ray.direction), 0.0f};
    varying.end = v.grid->end(varying.origin, varying.direction), end_ = std::max(end_, varying.end);
  }
}

Medium Media::Way::at(float t) const {
  Medium medium = uniform_;
  for (int i = 0; i < varying_count_; ++i)
    if (t < varying_[i].end) add_medium(scene_, *varying_[i].volume, ray_.origin + ray_.direction * t, -ray_.direction, path_, medium);
  return medium;
}

VolumeBounds Media::Way::bounds(float t, float& until) const {
  const float most = max_component(uniform_.sigma_t);
  VolumeBounds sum{uniform_.sigma_t, 0.0f, most};
  until = kInf;
  for (int i = 0; i < varying_count_; ++i) {
    const Varying& v = varying_[i];
    if (!(t < v.end)) continue;
    float end;
    const VolumeBounds& b = v.volume->grid->at(v.origin, v.direction, t, end);
    sum.least += b.least, sum.spread += b.spread, sum.most += b.most;
    until = std::min({until, end, v.end});
  }
  return sum;
}

// ---------------------------------------------------------------- what passes

// Residual ratio tracking [Novák et al. 2014, "Residual ratio tracking for estimating attenuation in participating media"].
Rgb Media::transmittance(const Scene& scene, const Ray& ray, float t_max, const PathState& path, Sampler& random) const {
  if (empty()) return Rgb(1.0f);
  const Way way(*this, scene, ray, ray.t_min, path);
  if (way.is_uniform()) return way.uniform().transmittance(t_max - ray.t_min);
  constexpr float kRoulette = 0.1f;  // from which what passes is left to chance
  Rgb passed(1.0f);
  const auto rate = [](const VolumeBounds& b) { return b.spread; };
  const auto pass = [&](const VolumeBounds& b, float length) {
    for (int c = 0; c < 3; ++c)
      if (b.least[c] > 0.0f) passed[c] *= std::exp(-b.least[c] * length);
  };
  const auto collide = [&](float t, const VolumeBounds& b, float spread) {
    passed *= Rgb(1.0f) - (way.at(t).sigma_t - b.least) * (1.0f / spread);
    const float left = max_component(abs(passed));
    if (left >= kRoulette) return true;
    if (!(random.next_1d() * kRoulette < left)) return passed = Rgb(), false;
    passed *= kRoulette / left;
    return true;
  };
  if (const auto t = track(way, ray.t_min, t_max, random, rate, pass, collide)) {
    volumes_->give_up();
    marched(way, *t, t_max, random, [&](float, float length, const Medium& medium) {
      passed *= medium.transmittance(length);
      return !is_black(passed);
    });
  }
  const float rest = t_max - std::max(way.end(), ray.t_min);
  return rest > 0.0f && !is_black(passed) ? passed * way.uniform().transmittance(rest) : passed;
}

Rgb Media::transmittance_through(const Scene& scene, const Ray& ray, const PathState& path, Sampler& random) const {
  if (volumes_->empty()) return Rgb(1.0f);
  static thread_local std::vector<Hit> hits;
  scene.volume_hits(ray, hits);
  if (hits.empty() && empty()) return Rgb(1.0f);
  Media media = *this;
  Rgb passed(1.0f);
  Ray stretch = ray;
  for (size_t i = 0; i <= hits.size(); ++i) {
    const float to = i < hits.size() ? hits[i].t : ray.t_max;
    passed *= media.transmittance(scene, stretch, to, path, random);
    if (i == hits.size() || is_black(passed)) break;
    media.set(scene, hits[i].instance, hits[i].triangle, goes_in(scene, hits[i], ray.direction));
    stretch.t_min = to;
  }
  return passed;
}

// ---------------------------------------------------------------- how far

// Delta tracking with a bound for all channels: at each collision light is scattered, or nothing happens, by what either would leave of
// the path [Kutz et al. 2017, "Spectral and decomposition tracking", which is single-sample MIS over the channels as in Miller et al. 2019,
// "A null-scattering path integral formulation of light transport"]. What is absorbed is weighed. A bound that is exceeded makes
// weights negative, not wrong [Galtier et al. 2013, "Integral formulation of null-collision Monte Carlo algorithms"].
MediumEvent Media::sample(const Scene& scene, const Ray& ray, float t_max, Rgb throughput, bool may_scatter, const PathState& path,
                          Sampler& random) const {
  const Way way(*this, scene, ray, ray.t_min, path);
  MediumEvent event;
  event.t = t_max;
  if (way.is_uniform()) {
    const Medium& medium = way.uniform();
    return medium.empty() ? event : sample_uniform(medium, t_max, throughput, may_scatter, random.next_2d());
  }
  constexpr float kRoulette = 0.1f;  // of the throughput that the ray began with, from which it is left to chance
  const float start = max_component(abs(throughput));
  const auto rate = [](const VolumeBounds& b) { return b.most; };
  const auto collide = [&](float t, const VolumeBounds&, float most) {
    Medium medium = way.at(t);
    event.emitted += event.weight * medium.emission / most;
    const Rgb sigma_s = may_scatter ? medium.scattering() : Rgb(), sigma_n = Rgb(most) - medium.sigma_t;
    const Rgb carried = abs(throughput * event.weight);
    const float by_scattering = average(carried * sigma_s), by_nothing = average(carried * abs(sigma_n)), sum = by_scattering + by_nothing;
    if (!(sum > 0.0f)) return event.weight = Rgb(), false;
    if (by_scattering > 0.0f && random.next_1d() * sum < by_scattering) {
      event.weight *= sum / (most * by_scattering);
      event.t = t, event.scattered = true, event.medium = medium;
      return false;
    }
    event.weight *= sigma_n * (sum / (most * by_nothing));
    const float left = max_component(abs(throughput * event.weight));
    if (left >= kRoulette * start) return true;
    if (!(random.next_1d() * kRoulette * start < left)) return event.weight = Rgb(), false;
    event.weight *= kRoulette * start / left;
    return true;
  };
  const auto unseen = [](const VolumeBounds&, float) {};
  if (const auto t = track(way, ray.t_min, t_max, random, rate, unseen, collide)) {
    volumes_->give_up();
    marched(way, *t, t_max, random, [&](float begin, float length, const Medium& medium) {
      const MediumEvent step = sample_uniform(medium, length, throughput * event.weight, may_scatter, random.next_2d());
      event.emitted += event.weight * step.emitted, event.weight *= step.weight;
      if (step.scattered) event.t = begin + step.t, event.scattered = true, event.medium = medium;
      return !step.scattered && !is_black(event.weight);
    });
  }
  const float rest = t_max - std::max(way.end(), ray.t_min);
  if (event.scattered || !(rest > 0.0f) || way.uniform().empty()) return event;
  MediumEvent beyond = sample_uniform(way.uniform(), rest, throughput * event.weight, may_scatter, random.next_2d());
  beyond.t += t_max - rest, beyond.emitted = event.emitted + event.weight * beyond.emitted, beyond.weight *= event.weight;
  return beyond;
}

}  // namespace gi
