// Light subpaths made ready for merging.
#include "transport/light_merge.h"

#include <bit>

namespace gi {

MergeVertex::MergeVertex(const LightVertex& v)
    : power{v.power.r(), v.power.g(), v.power.b()},
      wi(v.point.wo),
      normal(v.point.ng),
      weights(v.weights),
      seen_by(v.seen_by),
      total(uint16_t(v.bounces.total)),
      diffuse(uint16_t(v.bounces.diffuse)),
      glossy(uint16_t(v.bounces.glossy)),
      transmission(uint16_t(v.bounces.transmission)),
      max_bounces(uint16_t(v.max_bounces)),
      is_first(v.is_first()) {}

void LightMerge::begin_pass(const RenderContext& context, int pass, const Film& film, SubpathSettings& subpaths) {
  radius_ = settings_.radius * float(std::sqrt(shrinking(pass, settings_.alpha)));
  paths_ = std::min(settings_.paths, film.spec().region_width() * film.spec().region_height());
  subpaths.merges = float(paths_) * sqr(radius_) * kPi / subpaths.joined;
  learn(context, pass, film, subpaths);
  send(context, pass, subpaths);
  context.log.set("radius, pixels", double(radius_));
  context.log.set("photons", double(vertices_.size()));
}

// What a path is worth is what of its power merging would bring, against the ways that lie on the light's side.
void LightMerge::learn(const RenderContext& context, int pass, const Film& film, const SubpathSettings& subpaths) {
  constexpr float kWorthLooking = 0.02f;
  if (pass == 0) seen_ = seen_points(find_ends(context, film, subpaths.limits, false, kLooksAcross), context.pool);
  const auto share_of_merging = [&](const LightVertex& v) {
    if (is_alone()) return 1.0f;
    const float merged = subpaths.merged(v.point.position);
    return merged / (merged + v.weights.vcm + subpaths.heuristic(kInvPi) * v.weights.vc);
  };
  const int rounds = pass == 0 ? EmissionLearner::kFirstRounds : std::has_single_bit(unsigned(pass)) ? 1 : 0;
  for (int round = 0; round < rounds && !context.cancelled; ++round)
    aim_.learn(context, subpaths, paths_ / 2, [&](const LightVertices& path, Sampler&) {
      float worth = 0.0f;
      for (size_t k = 0; k < path.count(); ++k) {
        const LightVertex& v = path[k];
        const float share = v.is_first() || v.bsdf.is_delta() ? 0.0f : share_of_merging(v);
        if (share > kWorthLooking && seen_.near(v.point.position)) worth += average(v.power) * share;
      }
      return worth;
    });
}

void LightMerge::send(const RenderContext& context, int pass, const SubpathSettings& subpaths) {
  SubpathSettings light = subpaths;
  light.guide = &aim_.guide();
  struct Found {
    Vec3 position;
    MergeVertex vertex;
  };
  const auto found = joined(trace_light_paths<std::vector<Found>>(context, light, pass, paths_,
                                                                  [](const LightVertices& path, Sampler&, std::vector<Found>& batch) {
                                                                    for (size_t i = 0; i < path.count(); ++i)
                                                                      if (!path[i].bsdf.is_delta())
                                                                        batch.push_back({path[i].point.position, MergeVertex(path[i])});
                                                                  }));
  tree_ = PointTree(found, [](const Found& f) { return f.position; }, context.pool);
  vertices_.clear();
  vertices_.reserve(found.size());
  for (const uint32_t i : tree_.order()) vertices_.push_back(found[i].vertex);
}

}  // namespace gi
