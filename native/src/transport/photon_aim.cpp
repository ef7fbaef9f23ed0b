// Looking from the eye, and learning from trial paths.
#include "transport/photon_aim.h"

#include <atomic>

#include "transport/diffuse_end.h"
#include "transport/photon_map.h"

namespace gi {

std::vector<PathEnd> find_ends(const RenderContext& context, const Film& film, const BounceLimits& limits, bool gathers, int across) {
  constexpr uint32_t kStream = 0x7365656eu;
  DiffuseEndSettings end;
  end.limits = limits, end.direct_known = end.direct_gathered = end.caustics_known = true;
  const FilmSpec& spec = film.spec();
  const Vec2 pixel{1.0f / float(spec.width), 1.0f / float(spec.height)};
  const size_t eyes = 1 + context.path.size();
  std::vector<std::vector<PathEnd>> rows{size_t(across)};
  context.pool.for_each(across, context.cancelled, [&](int y) {
    for (int x = 0; x < across; ++x) {
      Sampler sampler(hash_combine(context.seed, kStream), uint32_t(y), uint32_t(x));
      const Vec2 place = sampler.next_2d(), lens = sampler.next_2d();
      const size_t eye = size_t(y * across + x) % eyes;
      const Camera& camera = eye == 0 ? context.camera : context.path[eye - 1];
      const float u = (float(x) + place.x) / float(across), v = (float(y) + place.y) / float(across);
      const CameraRay ray = camera.sample(
          {(float(spec.x0) + u * float(spec.region_width())) * pixel.x, (float(spec.y0) + v * float(spec.region_height())) * pixel.y},
          pixel, lens);
      PixelSample nothing;
      EndingPath ending{CameraPath(ray)};
      const auto note = [&](const ShadingPoint& point, const Bsdf&, bool gathered) -> std::optional<KnownLight> {
        if (gathers && !gathered) return {};
        return rows[size_t(y)].push_back({point.position, point.ng}), KnownLight();
      };
      trace_to_diffuse(context, film, end, ray, ending, sampler, nothing, [](const ShadingPoint&, const Bsdf&) { return Rgb(); }, note);
    }
  });
  return joined(std::move(rows));
}

SeenPoints seen_points(const std::vector<PathEnd>& ends, ThreadPool& pool) {
  std::vector<Vec3> points;
  for (const PathEnd& end : ends) points.push_back(end.position);
  return SeenPoints(points, pool);
}

namespace {

// Sends first rays alone, which cost little, until enough of them have met what diffuse surfaces do not scatter light of: a glass that one
// path of ten thousand meets is found so, and each that is found leads to the next. Sends `most` at most; returns how many.
int scout(const RenderContext& context, SubpathSettings settings, int most, size_t enough, EmissionLearner& learner) {
  constexpr int kRounds = 12;
  settings.limits.total = 0;
  int sent = 0;
  for (int round = 0; round < kRounds && learner.size() <= enough && !context.cancelled; ++round, sent += most / kRounds)
    learner.learn(context, settings, most / kRounds, [](const LightVertices& path, Sampler&) {
      if (path.count() == 0) return 0.0f;
      const LightVertex& v = path[path.count() - 1];
      const bool throws_caustics = (v.bsdf.flags() & (kGlossy | kSpecular)) && !(v.bsdf.flags() & kDiffuse);
      return throws_caustics ? average(v.power) : 0.0f;
    });
  return sent;
}

}  // namespace

EmissionGuide learn_emission(const RenderContext& context, const SubpathSettings& settings, int photons, uint8_t classes,
                             const std::vector<PathEnd>& ends) {
  constexpr size_t kEnough = 30000, kFew = 300, kSome = 30;  // paths that brought something
  constexpr double kTimeShare = 0.05;  // of a time limit
  constexpr float kOnTheWay = 0.05f;  // what light of other classes is worth, which at least comes near what is seen
  constexpr int kFirstRayShare = 4;  // paths cost about as many times what their first rays do
  constexpr int kMostRounds = 16, kFirstRound = 5000;  // each round is twice the one before, up to an eighth of the photons
  const SeenPoints seen = seen_points(ends, context.pool);
  EmissionLearner learner;
  // Once there is some of the wished light, the other kind does not count any longer: of a glass on a wide floor that would be nearly all.
  std::atomic<size_t> arrived = 0;  // paths that brought wished light
  bool shows_way = true;
  int tried = 0;  // at most half as many as there will be photons, where there is nothing of the wished kind
  const double began = context.seconds();
  for (int round = 0; round < kMostRounds && !context.cancelled; ++round) {
    if (round == EmissionLearner::kFirstRounds && arrived < kSome && classes == kCausticPhoton) {
      learner.forget();
      tried += scout(context, settings, photons / 2, kFew, learner) / kFirstRayShare;
      shows_way = learner.size() < kSome;
      learner.forget();  // sent by what was learnt, but weighed by what they bring
    }
    if (round >= EmissionLearner::kFirstRounds && learner.size() > kEnough && (!shows_way || tried >= photons / 2)) break;
    if (arrived == 0 && tried >= photons / 2) break;
    if (context.has_had(kTimeShare, began)) break;
    const int trials = std::min(photons / 8, kFirstRound << round);
    tried += trials;
    learner.learn(context, settings, trials, [&](const LightVertices& path, Sampler&) {
      float wished = 0.0f, other = 0.0f;
      for (int i = 0; i < int(path.count()); ++i) {
        const LightVertex& v = path[size_t(i)];
        const float all = average(photon_power(v, settings, kAllPhotons)), part = average(photon_power(v, settings, classes));
        if (!(all > 0.0f)) continue;
        const float density = seen.density(v.point.position);
        wished += part * density, other += (all - part) * density;
      }
      if (wished > 0.0f) ++arrived;
      return wished + (shows_way ? kOnTheWay * other : 0.0f);
    });
    if (shows_way && arrived > kFew) {
      shows_way = false;
      if (arrived < learner.size()) learner.forget();
    }
  }
  return learner.guide();
}

}  // namespace gi
