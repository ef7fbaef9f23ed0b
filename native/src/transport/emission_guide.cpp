// Learning where light should start.
#include "transport/emission_guide.h"

namespace gi {

EmissionGuide::EmissionGuide(int lights)
    : choices_(std::clamp(lights, 1, 16)), worth_(size_t(choices_) * (1 + 4 * kBins)), hits_(size_t(choices_)) {}

float EmissionGuide::warp(EmissionNumbers& u) const {
  if (numbers_.empty()) return 1.0f;
  const bool even = u[0] < kEven;
  u[0] = std::min(even ? u[0] / kEven : (u[0] - kEven) / (1.0f - kEven), kOneMinusEpsilon);
  size_t choice;
  if (even) {
    choice = size_t(u[0] * float(choices_));
  } else {
    choice = choice_.sample(u[0]);
    u[0] = std::min((float(choice) + u[0]) / float(choices_), kOneMinusEpsilon);
  }
  float density = choice_.probability(choice) * float(choices_);
  for (size_t k = 0; k < 4; ++k) {
    const Distribution1D& d = numbers_[4 * choice + k];
    size_t bin;
    if (even) {
      bin = size_t(u[k + 1] * kBins);
    } else {
      bin = d.sample(u[k + 1]);
      u[k + 1] = std::min((float(bin) + u[k + 1]) / kBins, kOneMinusEpsilon);
    }
    density *= d.probability(bin) * kBins;
  }
  return 1.0f / (kEven + (1.0f - kEven) * density);
}

void EmissionGuide::learn(const std::vector<Trial>& trials) {
  for (const Trial& t : trials) {
    if (!(t.worth > 0.0f) || !std::isfinite(t.worth)) continue;
    const size_t choice = size_t(t.u[0] * float(choices_));
    float* row = worth_.data() + choice * (1 + 4 * kBins);
    row[0] += t.worth, hits_[choice] += 1.0f;
    for (size_t k = 0; k < 4; ++k) row[1 + k * kBins + size_t(t.u[k + 1] * kBins)] += t.worth;
  }
  std::vector<float> choice;
  numbers_.clear();
  for (size_t c = 0; c < size_t(choices_); ++c) {
    const float* row = worth_.data() + c * (1 + 4 * kBins);
    // What few trials say is believed the less.
    constexpr float kBelieved = 64.0f;
    const float even = row[0] * std::max(0.05f, kBelieved / std::max(hits_[c], 1.0f));
    choice.push_back(row[0]);
    for (size_t k = 0; k < 4; ++k) {
      const float* bins = row + 1 + k * kBins;
      std::vector<float> smooth(kBins);
      for (int i = 0; i < kBins; ++i)
        smooth[size_t(i)] = 0.5f * bins[i] + 0.25f * (bins[std::max(i - 1, 0)] + bins[std::min(i + 1, kBins - 1)]) + even / kBins;
      numbers_.emplace_back(smooth);
    }
  }
  choice_ = Distribution1D(choice);
}

SeenPoints::SeenPoints(const std::vector<Vec3>& points, ThreadPool& pool) : tree_(points, pool) {
  constexpr size_t kNeighbours = 8;
  std::vector<PointTree::Found> found;
  for (uint32_t k = 0; k < tree_.size(); ++k) {
    tree_.nearest(tree_.point(k), kNeighbours, kInf, found);
    float reach = 0.0f;
    for (const auto& f : found) reach = std::max(reach, f.distance_squared);
    reach_.push_back(reach);
  }
}

bool SeenPoints::near(Vec3 position) const {
  float best = kInf;
  uint32_t nearest = 0;
  tree_.within(position, best, [&](uint32_t k, float d2) {
    if (d2 < best) best = d2, nearest = k;
  });
  return best < kInf && best <= reach_[nearest];
}

}  // namespace gi
