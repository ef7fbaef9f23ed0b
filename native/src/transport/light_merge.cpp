// Light subpaths made ready for merging.
#include "transport/light_merge.h"

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

LightMerge::LightMerge(const RenderContext& context, const SubpathSettings& settings, int pass, int paths) : paths_(paths) {
  struct Found {
    Vec3 position;
    MergeVertex vertex;
  };
  const auto found = joined(trace_light_paths<std::vector<Found>>(context, settings, pass, paths,
                                                                  [](const LightVertices& path, Sampler&, std::vector<Found>& batch) {
                                                                    for (size_t i = 0; i < path.count(); ++i)
                                                                      if (!path[i].bsdf.is_delta())
                                                                        batch.push_back({path[i].point.position, MergeVertex(path[i])});
                                                                  }));
  std::vector<Vec3> positions;
  positions.reserve(found.size());
  for (const Found& f : found) positions.push_back(f.position);
  tree_ = PointTree(positions, context.pool);
  vertices_.reserve(found.size());
  for (const uint32_t i : tree_.order()) vertices_.push_back(found[i].vertex);
}

}  // namespace gi
