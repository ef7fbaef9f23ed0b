// Records of irradiance by photons: worked out in threads, and found again.
#include "transport/photon_irradiance.h"

namespace gi {

PathState gathering() {
  PathState eye;
  eye.depth = eye.diffuse_depth = 1;
  return eye;
}

void IrradianceMap::cover(const std::vector<PathEnd>& places, const PhotonMap& map, size_t count, float radius,
                          const RenderContext& context, double time_share) {
  look_up_by(count, radius);
  const double began = context.seconds();
  std::vector<Record> records = records_;
  std::vector<Vec3> positions;
  for (size_t k = 0; k < records.size(); ++k) positions.push_back(tree_.point(uint32_t(k)));
  for (const PathEnd& p : places) {
    if (nearest(p.position, p.normal)) continue;
    positions.push_back(p.position), records.push_back({p.normal, Rgb(), 0.0f});
  }
  tree_ = PointTree(positions, context.pool);
  records_.clear();
  for (const uint32_t k : tree_.order()) records_.push_back(records[k]);
  constexpr size_t kBatch = 256;
  context.pool.for_each(int((records_.size() + kBatch - 1) / kBatch), context.cancelled, [&](int b) {
    for (size_t k = size_t(b) * kBatch; k < std::min((size_t(b) + 1) * kBatch, records_.size()); ++k) {
      Record& r = records_[k];
      if (r.reach > 0.0f || context.has_had(time_share, began)) continue;
      r.irradiance = map.irradiance(tree_.point(uint32_t(k)), r.normal, radius_, count, gathering(), &context.scene, &r.reach);
    }
  });
}

std::optional<Rgb> IrradianceMap::at(const PhotonMap& map, const Scene& scene, Vec3 position, Vec3 normal, float distance) const {
  float reach = 0.0f;
  Rgb found;
  if (const Record* r = nearest(position, normal))
    found = r->irradiance, reach = r->reach;
  else
    found = map.irradiance(position, normal, radius_, count_, gathering(), &scene, &reach);
  return reach > distance ? std::nullopt : std::optional(found);
}

const IrradianceMap::Record* IrradianceMap::nearest(Vec3 position, Vec3 normal) const {
  constexpr float kSlope = 0.9f, kThickness = 0.5f;
  float best = sqr(radius_);
  uint32_t nearest = kNoId;
  tree_.within(position, best, [&](uint32_t k, float d2) {
    if (dot(records_[k].normal, normal) < kSlope || sqr(dot(tree_.point(k) - position, normal)) > sqr(kThickness) * d2) return;
    if (d2 < best || k < nearest) best = d2, nearest = k;
  });
  return nearest != kNoId && best <= sqr(records_[nearest].reach) && records_[nearest].reach > 0.0f ? &records_[nearest] : nullptr;
}

}  // namespace gi
