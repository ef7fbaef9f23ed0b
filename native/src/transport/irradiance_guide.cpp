// IrradianceGuide: cells, their weights.
#include "transport/irradiance_guide.h"

#include <algorithm>
#include <bit>

namespace gi {
namespace {

constexpr float kUnguided = 0.25f;  // of the rays: what no record near by has met must be found too
constexpr float kPrior = 1.0f;      // rays of the mean that each cell is thought to have had
constexpr float kOwn = 0.5f;  // of a cell's weight; the rest is its neighbours', as what one record meets is seen elsewhere by another

uint16_t half_of(float value) { return uint16_t(std::bit_cast<uint32_t>(value) >> 16); }
float of_half(uint16_t half) { return std::bit_cast<float>(uint32_t(half) << 16); }

// The cells of a fine grid over the disc below the hemisphere.
struct Disc {
  static constexpr int kSide = 128;
  uint8_t cell[kSide][kSide];
  float tangent[IrradianceGuide::kRings];
  Disc() {
    constexpr int rings = IrradianceGuide::kRings, sectors = IrradianceGuide::kSectors;
    for (int i = 0; i < kSide; ++i)
      for (int j = 0; j < kSide; ++j) {
        const float x = (float(i) + 0.5f) * (2.0f / float(kSide)) - 1.0f, y = (float(j) + 0.5f) * (2.0f / float(kSide)) - 1.0f;
        const float turn = std::atan2(y, x) * (0.5f * kInvPi);
        const int ring = std::min(int((sqr(x) + sqr(y)) * float(rings)), rings - 1);
        const int sector = std::min(int((turn < 0.0f ? turn + 1.0f : turn) * float(sectors)), sectors - 1);
        cell[i][j] = uint8_t(ring * sectors + sector);
      }
    for (int ring = 0; ring < rings; ++ring) tangent[ring] = mean_tangent(ring, rings);
  }
  static int along(float x) { return std::clamp(int((x + 1.0f) * (0.5f * float(kSide))), 0, kSide - 1); }
};

const Disc& disc() {
  static const Disc disc;
  return disc;
}

}  // namespace

Sighting::Sighting(Vec3 local, float distance, float luminance)
    : x_(int8_t(std::lround(local.x * 127.0f))),
      y_(int8_t(std::lround(local.y * 127.0f))),
      distance_(half_of(distance)),
      luminance_(half_of(luminance)) {}

Vec3 Sighting::local() const {
  const float x = float(x_) / 127.0f, y = float(y_) / 127.0f;
  return {x, y, safe_sqrt(1.0f - sqr(x) - sqr(y))};
}
float Sighting::distance() const { return of_half(distance_); }
float Sighting::luminance() const { return of_half(luminance_); }

void IrradianceGuide::add(Vec3 local, float luminance) {
  const size_t cell = disc().cell[Disc::along(local.x)][Disc::along(local.y)];
  seen_[cell] += 1.0f, squares_[cell] += sqr(luminance);
}

// Each cell in proportion to the root of its mean square, which makes the variance least. [Neyman 1934]
void IrradianceGuide::settle() {
  float all = 0, squares = 0;
  for (size_t i = 0; i < size_t(kCells); ++i) all += seen_[i], squares += squares_[i];
  const float mean = all > 0.0f ? squares / all : 0.0f;
  std::array<float, kCells> root;
  for (size_t i = 0; i < size_t(kCells); ++i) root[i] = std::sqrt((squares_[i] + kPrior * mean) / (seen_[i] + kPrior));
  std::array<float, kCells> weight;
  float sum = 0;
  for (int ring = 0; ring < kRings; ++ring)
    for (int sector = 0; sector < kSectors; ++sector) {
      const auto at = [&](int r, int s) { return root[size_t(std::clamp(r, 0, kRings - 1) * kSectors + (s + kSectors) % kSectors)]; };
      const float around = at(ring - 1, sector) + at(ring + 1, sector) + at(ring, sector - 1) + at(ring, sector + 1);
      sum += weight[size_t(ring * kSectors + sector)] = kOwn * at(ring, sector) + (1.0f - kOwn) * 0.25f * around;
    }
  double below = 0;
  for (size_t i = 0; i < size_t(kCells); ++i) {
    below_[i] = float(below);
    const float share = sum > 0.0f && std::isfinite(sum) ? weight[i] / sum : 1.0f / float(kCells);
    below += kUnguided / double(kCells) + (1.0 - kUnguided) * double(share);
  }
  below_[kCells] = 1.0f;
}

IrradianceGuide::Direction IrradianceGuide::sample(float u, Vec2 within) const {
  const auto next = std::upper_bound(below_.begin() + 1, below_.end() - 1, u);
  const int cell = int(next - below_.begin()) - 1, ring = cell / kSectors, sector = cell % kSectors;
  const float sin2 = (float(ring) + within.x) / float(kRings), phi = 2.0f * kPi * (float(sector) + within.y) / float(kSectors);
  const float sin = std::sqrt(sin2), chosen = *next - *(next - 1);
  return {{sin * std::cos(phi), sin * std::sin(phi), safe_sqrt(1.0f - sin2)}, 1.0f / (float(kCells) * chosen), disc().tangent[ring]};
}

float mean_tangent(int ring, int rings) {
  const auto below = [&](int j) {
    const float sin = std::sqrt(float(j) / float(rings));
    return std::asin(sin) - sin * safe_sqrt(1.0f - float(j) / float(rings));
  };
  return float(rings) * (below(ring + 1) - below(ring));
}

}  // namespace gi
