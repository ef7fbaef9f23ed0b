// Where photons are wanted: what paths from the eye see, and a guide that sends photons of a kind there. Leaves out how light paths are
// followed (light_path.h) and what is learnt from those that were (emission_guide.h).
#pragma once
#include "film/film.h"
#include "transport/light_path.h"

namespace gi {

// Where an eye path ends on a diffuse surface, and the normal of the side that it came to.
struct PathEnd {
  Vec3 position, normal;
};
// Of `across` x `across` paths, after gathering or without.
constexpr int kLooksAcross = 48;  // what shows where light is wanted
std::vector<PathEnd> find_ends(const RenderContext& context, const Film& film, const BounceLimits& limits, bool gathers, int across);
SeenPoints seen_points(const std::vector<PathEnd>& ends, ThreadPool& pool);

// Learns to send photons of `classes` to what is seen.
EmissionGuide learn_emission(const RenderContext& context, const SubpathSettings& settings, int photons, uint8_t classes,
                             const std::vector<PathEnd>& seen);

}  // namespace gi
