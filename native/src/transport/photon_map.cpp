// Photons: sent out, stored, and looked up.
#include "transport/photon_map.h"

namespace gi {
namespace {

float sign_of(float x) { return x < 0.0f ? -1.0f : 1.0f; }

// Sets the limits of the eye, less what the light's part of the path has used up; false if that is more than there is.
bool limit(const LightVertex& v, const BounceLimits& limits, Photon& photon) {
  BounceCount used = v.bounces;
  if (!v.is_first()) used.add(kReflection | kDiffuse);
  const int left[4] = {std::min(limits.total, v.max_bounces) - used.total, limits.diffuse - used.diffuse, limits.glossy - used.glossy,
                       limits.transmission - used.transmission};
  uint8_t* to[4] = {&photon.total, &photon.diffuse, &photon.glossy, &photon.transmission};
  for (int k = 0; k < 4; ++k) {
    if (left[k] < 0) return false;
    *to[k] = uint8_t(std::min(left[k], 255));
  }
  return true;
}

// Of a photon at a squared distance, that of the border being 1; on average over the disc 1. [Jensen 2001, eq. 7.8 and 7.9; the latter's
// scale is here what makes the average 1]
float weight_of(PhotonFilter filter, float distance_squared) {
  constexpr float kBeta = 1.953f, kGaussScale = 1.728309f;
  switch (filter) {
    case PhotonFilter::kDisc: return 1.0f;
    case PhotonFilter::kCone: return 3.0f * (1.0f - std::sqrt(distance_squared));
    case PhotonFilter::kGauss: break;
  }
  return kGaussScale * (1.0f - (1.0f - std::exp(-0.5f * kBeta * distance_squared)) / (1.0f - std::exp(-kBeta)));
}

}  // namespace

PackedDirection::PackedDirection(Vec3 w) {
  const float scale = 1.0f / (std::abs(w.x) + std::abs(w.y) + std::abs(w.z));
  float x = w.x * scale, y = w.y * scale;
  if (w.z < 0.0f) {
    const float folded = (1.0f - std::abs(y)) * sign_of(x);
    y = (1.0f - std::abs(x)) * sign_of(y), x = folded;
  }
  u = int16_t(std::lrint(x * 32767.0f)), v = int16_t(std::lrint(y * 32767.0f));
}

Vec3 PackedDirection::along() const {
  const float x = float(u) / 32767.0f, y = float(v) / 32767.0f, z = 1.0f - std::abs(x) - std::abs(y);
  if (z >= 0.0f) return {x, y, z};
  return {(1.0f - std::abs(y)) * sign_of(x), (1.0f - std::abs(x)) * sign_of(y), z};
}

Rgb photon_power(const LightVertex& v, const SubpathSettings& settings, uint8_t classes) {
  if (!(v.bsdf.flags() & kDiffuse) || !(v.seen_by & kRayDiffuse)) return Rgb();
  if (v.is_first()) return classes & kDirectPhoton ? v.power : Rgb();
  Rgb share;
  if (classes & kCausticPhoton) share += v.by_mirrors;
  if (classes & kGlobalPhoton) share += Rgb(1.0f) - v.by_mirrors;
  return v.power * share * (v.hides_mirrors(settings.without) ? Rgb(1.0f) - v.last_by_mirrors : Rgb(1.0f));
}

void trace_photons(const RenderContext& context, const SubpathSettings& settings, int pass, int count, uint8_t classes,
                   LargeVector<Photon>& photons) {
  append(trace_light_paths<std::vector<Photon>>(context, settings, pass, count,
                                                [&](const LightVertices& path, Sampler&, std::vector<Photon>& batch) {
                                                  for (int i = 0; i < int(path.count()); ++i) {
                                                    const LightVertex& v = path[size_t(i)];
                                                    const Rgb power = photon_power(v, settings, classes);
                                                    if (is_black(power)) continue;
                                                    Photon& photon = batch.emplace_back();
                                                    photon.position = v.point.position, photon.wi = PackedDirection(v.point.wo),
                                                    photon.normal = PackedDirection(v.point.ng);
                                                    photon.power[0] = power.r(), photon.power[1] = power.g(), photon.power[2] = power.b();
                                                    if (!limit(v, settings.limits, photon)) batch.pop_back();
                                                  }
                                                }),
         photons);
}

double shrinking(int pass, double alpha) {
  return std::exp(std::lgamma(pass + 1 + alpha) - std::lgamma(1 + alpha) - std::lgamma(pass + 2.0));
}

PhotonMap::PhotonMap(const LargeVector<Photon>& photons, double paths, ThreadPool& pool)
    : tree_(photons, [](const Photon& p) { return p.position; }, pool), scale_(float(1.0 / paths)) {
  lights_.reserve(photons.size());
  for (const uint32_t i : tree_.order()) lights_.push_back(photons[i]);
}

void Photon::write(float* row) const {
  const float numbers[kNumbers] = {position.x, position.y, position.z, float(wi.u),  float(wi.v),    float(normal.u), float(normal.v),
                                   power[0],   power[1],   power[2],   float(total), float(diffuse), float(glossy),   float(transmission)};
  std::copy_n(numbers, kNumbers, row);
}

std::optional<Photon> Photon::read(const float* row) {
  for (size_t i = 0; i < kNumbers; ++i) {
    const bool is_direction = i >= 3 && i < 7, is_count = i >= 10;
    if (!std::isfinite(row[i])) return {};
    if ((is_direction || is_count) && row[i] != std::floor(row[i])) return {};
    if ((is_direction && std::abs(row[i]) > 32767.0f) || (is_count && !(row[i] >= 0.0f && row[i] < 256.0f))) return {};
  }
  Photon p;
  p.position = {row[0], row[1], row[2]};
  p.wi.u = int16_t(row[3]), p.wi.v = int16_t(row[4]), p.normal.u = int16_t(row[5]), p.normal.v = int16_t(row[6]);
  std::copy_n(row + 7, 3, p.power);
  p.total = uint8_t(row[10]), p.diffuse = uint8_t(row[11]), p.glossy = uint8_t(row[12]), p.transmission = uint8_t(row[13]);
  return p;
}

LargeVector<Photon> PhotonMap::photons() const {
  LargeVector<Photon> all(size());
  for (size_t k = 0; k < size(); ++k) static_cast<PhotonLight&>(all[k]) = lights_[k], all[k].position = position(k);
  return all;
}

LargeVector<Photon> PhotonMap::equalised(uint32_t seed) const {
  constexpr size_t kAround = 64;  // in the order of the tree, so of one place
  const auto size = [](const PhotonLight& p) { return double(std::abs(p.power[0])) + std::abs(p.power[1]) + std::abs(p.power[2]); };
  LargeVector<Photon> all = photons(), kept;
  for (size_t begin = 0; begin < all.size(); begin += kAround) {
    const size_t end = std::min(begin + kAround, all.size());
    double sum = 0.0;
    for (size_t k = begin; k < end; ++k) sum += size(all[k]);
    for (size_t k = begin; k < end; ++k) {
      const float left = float(std::min(size(all[k]) * double(end - begin) / sum, 1.0));
      if (to_unit_float(hash_combine(seed, uint32_t(k))) >= left) continue;
      for (float& channel : all[k].power) channel /= left;
      kept.push_back(all[k]);
    }
  }
  return kept;
}

PhotonError PhotonMap::error(const std::vector<PathEnd>& places, float radius, size_t count, const PathState& eye) const {
  const size_t probes = std::min<size_t>(512, places.size());
  double noise = 0, difference = 0;
  size_t lit = 0;
  for (size_t i = 0; i < probes; ++i) {
    const auto& [position, normal] = places[i * places.size() / probes];
    const Rgb all = irradiance(position, normal, radius, count, eye, nullptr),
              half = irradiance(position, normal, radius, count / 2, eye, nullptr);
    if (is_black(all)) continue;
    double sum = 0, squares = 0;
    for (const auto& f : around(position, normal, radius, count, eye)) {
      const float* power = lights_[f.point].power;
      const double mean = power[0] + power[1] + power[2];
      sum += mean, squares += mean * mean;
    }
    noise += squares / (sum * sum), difference += sqr(double(average(half)) / double(average(all)) - 1.0);
    ++lit;
  }
  if (lit == 0) return {};
  noise /= double(lit), difference /= double(lit);
  // What half the photons leave out is as noisy as all together. Blur grows with the area.
  return {std::sqrt(noise), 2.0 * std::sqrt(std::max(difference - noise, 0.0))};
}

float PhotonMap::spread(Vec3 position, size_t count) const {
  std::vector<PointTree::Found> found;
  tree_.nearest(position, count, kInf, found);
  float farthest = 0.0f;
  for (const auto& f : found) farthest = std::max(farthest, f.distance_squared);
  return std::sqrt(farthest);
}

bool PhotonMap::is_of(uint32_t k, Vec3 position, Vec3 normal, float radius) const {
  return of_one_surface(tree_.point(k) - position, lights_[k].normal.along(), normal, radius);
}

// f Φ: irradiance is by the true normal, whatever normals the lobes weigh light by.
Rgb PhotonMap::scattered(const ShadingPoint& point, const Bsdf& bsdf, const PhotonLight& photon) const {
  if (!photon.reaches(point.path)) return Rgb();
  const Vec3 wi = photon.wi.unpack();
  const float cosine = abs_dot(photon.normal.unpack(), wi);
  const uint8_t side = dot(point.ng, wi) >= 0.0f ? kReflection : kTransmission;
  if (!(cosine > 1e-4f)) return Rgb();
  return Rgb(photon.power[0], photon.power[1], photon.power[2]) * bsdf.eval(point.wo, wi, side | kDiffuse).value / cosine;
}

size_t PhotonMap::count(Vec3 position, Vec3 normal, float radius) const {
  size_t found = 0;
  float radius_squared = sqr(radius);
  tree_.within(position, radius_squared, [&](uint32_t k, float) { found += is_of(k, position, normal, radius); });
  return found;
}

Rgb PhotonMap::radiance(const Scene& scene, const ShadingPoint& point, const Bsdf& bsdf, float radius) const {
  static thread_local std::vector<Vec3> places;
  static thread_local std::vector<uint32_t> found;
  places.clear(), found.clear();
  float radius_squared = sqr(radius);
  tree_.within(point.position, radius_squared, [&](uint32_t k, float) {
    if (is_of(k, point.position, point.ng, radius)) places.push_back(tree_.point(k)), found.push_back(k);
  });
  const std::vector<float>& counts = counts_in_sight(scene, point.position, point.ng, radius, places);
  Rgb sum;
  for (size_t i = 0; i < found.size(); ++i)
    if (counts[i] != 0.0f) sum += scattered(point, bsdf, lights_[found[i]]) * counts[i];
  return sum * (scale_ / (kPi * sqr(radius)));
}

Rgb PhotonMap::radiance(const ShadingPoint& point, const Bsdf& bsdf, float radius, size_t count, PhotonFilter filter) const {
  static thread_local std::vector<PointTree::Found> found;
  tree_.nearest(point.position, count, sqr(radius), found, [&](uint32_t k) { return is_of(k, point.position, point.ng, radius); });
  // The last of `count` marks the border, and is not in it; with fewer, the disc reaches as far as was looked.
  float end = sqr(radius);
  if (found.size() == count) {
    end = 0.0f;
    for (const auto& f : found) end = std::max(end, f.distance_squared);
  }
  Rgb sum;
  for (const auto& f : found)
    if (f.distance_squared < end) sum += scattered(point, bsdf, lights_[f.point]) * weight_of(filter, f.distance_squared / end);
  return end > 0.0f ? sum * (scale_ / (kPi * end)) : Rgb();
}

const std::vector<PointTree::Found>& PhotonMap::around(Vec3 position, Vec3 normal, float radius, size_t count, const PathState& eye) const {
  static thread_local std::vector<PointTree::Found> found;
  const auto is_good = [&](uint32_t k) {
    const PhotonLight& photon = lights_[k];
    return photon.reaches(eye) && dot(photon.normal.along(), normal) > 0.0f && is_of(k, position, normal, radius);
  };
  for (const float reach : {0.6f * radius, radius}) {  // mostly the smaller one will do
    tree_.nearest(position, count, sqr(reach), found, is_good);
    if (found.size() == count) break;
  }
  return found;
}

Rgb PhotonMap::irradiance(Vec3 position, Vec3 normal, float radius, size_t count, const PathState& eye, const Scene* scene,
                          float* farthest) const {
  const std::vector<PointTree::Found>& found = around(position, normal, radius, count, eye);
  constexpr float kLeastShare = 0.4f;
  constexpr int kMostHalvings = 3;
  if (found.empty()) return Rgb();
  float end = 0.0f;
  for (const auto& f : found) end = std::max(end, f.distance_squared);
  if (found.size() < count) end = sqr(radius);
  if (farthest) *farthest = std::sqrt(end);
  const float share_of_farthest = found.size() < count ? 1.0f : float(count - 1) / float(count);  // it only marks the border
  const float per_area = share_of_farthest * scale_ / (kPi * end);
  Rgb sum;
  const auto add = [&](const PointTree::Found& f) {
    const float* power = lights_[f.point].power;
    sum += Rgb(power[0], power[1], power[2]);
  };
  if (!scene) {
    for (const auto& f : found) add(f);
    return sum * per_area;
  }
  static thread_local std::vector<Vec2> places;
  float all = per_area;  // of what lies in the disc, if all of it were surface
  for (int halvings = 0;; ++halvings) {
    const SurfaceDisc disc(*scene, position, normal, std::sqrt(end));
    places.clear();
    sum = Rgb();
    for (const auto& f : found) {
      const Vec2 place = disc.place(tree_.point(f.point));
      if (f.distance_squared > end || !(disc.is_open() || disc.sees(place))) continue;
      places.push_back(place);
      add(f);
    }
    if (disc.is_open() && is_even(places, end)) return sum * all;
    const float share = disc.share();
    if (share > kLeastShare || halvings == kMostHalvings) return sum * (all / share);
    // Of so little a few rays do not tell how much it is.
    end *= 0.25f, all = scale_ / (kPi * end);
  }
}

}  // namespace gi
