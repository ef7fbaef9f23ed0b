// The part of a disc about a point that is surface, and in sight of the point along it: photons elsewhere, behind a wall, say nothing of
// the point, and where the surface ends there can be none. Looks about by rays.
#pragma once
#include <array>
#include <bit>
#include <cmath>
#include <vector>

#include "core/sampler.h"
#include "scene/scene.h"
#include "transport/path_state.h"

namespace gi {

// Whether what lies `distance` away along the plane of a point, and `off` it, is taken to be of the same surface, within `radius`.
constexpr float kSurfaceSlope = 0.3f;
inline bool is_on_surface(float off, float distance, float radius) {
  constexpr float kRoughness = 0.02f;  // of the radius
  return std::abs(off) < kSurfaceSlope * distance + kRoughness * radius;
}

class SurfaceDisc {
 public:
  SurfaceDisc(const Scene& scene, Vec3 position, Vec3 normal, float radius)
      : scene_(scene), position_(position), radius_(radius), key_(key_of(position)) {
    // Above the surface by as much as what is on it may rise, but under what hangs over it.
    height_ = kSurfaceSlope * radius;
    if (const auto above = look(offset_point(position, normal, normal), normal, 2.0f * height_)) height_ = 0.5f * *above;
    eye_ = position + normal * height_;
    const float turn = 2.0f * kPi * number(0), c = std::cos(turn), s = std::sin(turn);
    const Frame even = Frame::from_normal(normal);
    frame_ = {even.x * c + even.y * s, even.y * c - even.x * s, normal};
    for (int k = 0; k < kSectors; ++k) walls_[size_t(k)] = wall_along(direction(float(k) + 0.5f));
  }

  // What its random numbers are keyed by.
  static uint32_t key_of(Vec3 p) {
    const auto bits = [](float x) { return std::bit_cast<uint32_t>(x); };
    return hash_combine(bits(p.x), hash_combine(bits(p.y), bits(p.z)));
  }

  Vec2 place(Vec3 p) const {  // in the plane
    const Vec3 local = frame_.to_local(p - position_);
    return {local.x, local.y};
  }
  bool is_open() const { return is_open_; }  // all of it is in sight
  bool sees(Vec2 place) const {
    const Wall& wall = walls_[sector(place)];
    return dot(wall.normal, place) <= wall.distance;
  }

  // The share that is in sight; and that is surface, too, by rays that fall all over what is in sight.
  float share_in_sight() const {
    float sum = 0.0f;
    for_each_place([&](Vec2, float, float part) { sum += part; });
    return std::max(sum, kLeastShare);
  }
  float share() const {
    float sum = 0.0f;
    for_each_place([&](Vec2 along, float distance, float part) {
      const auto ground = look(eye_ + to_world(along) * distance, -frame_.z, height_ + kSurfaceSlope * radius_);
      if (ground && is_on_surface(*ground - height_, distance, radius_)) sum += part;
    });
    return std::max(sum, kLeastShare);
  }

 private:
  static constexpr int kSectors = 8, kRings = 2;
  static constexpr float kLeastShare = 0.5f / float(kSectors * kRings);

  // What ends the sight in a sector, as the straight line in the plane that it would be if it were flat; none: far away.
  struct Wall {
    Vec2 normal{0, 0};  // away from the middle
    float distance = kInf;
    float reach(Vec2 along, float most) const {
      const float cosine = dot(normal, along);
      return cosine * most > distance ? distance / cosine : most;
    }
  };

  Wall wall_along(Vec2 along) {
    const Ray ray{eye_, to_world(along), 0.0f, radius_};
    const auto hit = scene_.intersect(ray, kRayDiffuse);
    if (!hit) return {};
    is_open_ = false;
    const Vec3 its_normal = frame_.to_local(-scene_.shading_point(ray, *hit, PathState()).ng);
    const float size = std::hypot(its_normal.x, its_normal.y);
    const Vec2 normal{its_normal.x / size, its_normal.y / size};
    constexpr float kLeast = 0.1f;  // where it is nearly level, or seen edgewise, it ends the sight at a right angle
    if (!(size > kLeast && dot(normal, along) > kLeast)) return {along, hit->t};
    return {normal, hit->t * dot(normal, along)};
  }

  // Calls f(direction, distance, part of the disc that it stands for) for places by chance in each ring of each sector.
  template <class F>
  void for_each_place(const F& f) const {
    for (int k = 0; k < kSectors; ++k) {
      for (int ring = 0; ring < kRings; ++ring) {
        const uint32_t place = uint32_t(1 + 2 * (k * kRings + ring));
        const Vec2 along = direction(float(k) + number(place + 1));
        const float reach = walls_[size_t(k)].reach(along, radius_);
        f(along, reach * std::sqrt((float(ring) + number(place)) / kRings), sqr(reach / radius_) / float(kSectors * kRings));
      }
    }
  }

  float number(uint32_t k) const { return to_unit_float(hash_combine(key_, k)); }
  static Vec2 direction(float sector) {
    const float angle = 2.0f * kPi * sector / kSectors;
    return {std::cos(angle), std::sin(angle)};
  }
  Vec3 to_world(Vec2 along) const { return frame_.to_world({along.x, along.y, 0.0f}); }
  // By the half of the plane, the quarter, and the eighth.
  static size_t sector(Vec2 p) {
    const bool below = p.y < 0.0f;
    const float x = below ? -p.x : p.x, y = std::abs(p.y);
    const bool left = x < 0.0f;
    const float u = left ? y : x, v = left ? -x : y;
    return size_t(4 * below + 2 * left + (v > u));
  }
  std::optional<float> look(Vec3 from, Vec3 towards, float distance) const {
    const auto hit = scene_.intersect({from, towards, 0.0f, distance}, kRayDiffuse);
    return hit ? std::optional(hit->t) : std::nullopt;
  }

  const Scene& scene_;
  Vec3 position_, eye_;
  Frame frame_;
  float radius_, height_;
  uint32_t key_;
  std::array<Wall, kSectors> walls_;
  bool is_open_ = true;
};

// Whether points in a disc lie as they would if all of it were surface, evenly lit: about the middle, and as far in any direction.
inline bool is_even(const std::vector<Vec2>& points, float radius_squared) {
  constexpr float kShift = 0.12f, kSpread = 0.19f;  // of the radius; of its square, where an even disc has 1/4
  Vec2 mean{0, 0};
  float xx = 0, xy = 0, yy = 0;
  for (const Vec2 p : points) mean.x += p.x, mean.y += p.y, xx += p.x * p.x, xy += p.x * p.y, yy += p.y * p.y;
  const float n = float(points.size()), least = 0.5f * (xx + yy - std::hypot(xx - yy, 2.0f * xy));
  return sqr(mean.x) + sqr(mean.y) < sqr(kShift * n) * radius_squared && least > kSpread * n * radius_squared;
}

// Of each of the points in a disc, what it counts where all of the disc would count 1: nothing where it is out of sight, more where not all
// is seen or is surface. Where they lie evenly no ray is sent. Whether it is surface is looked at with probability `chance`; right on
// average.
inline const std::vector<float>& counts_in_sight(const Scene& scene, Vec3 position, Vec3 normal, float radius,
                                                 const std::vector<Vec3>& points, float chance = 1.0f) {
  static thread_local std::vector<Vec2> places;
  static thread_local std::vector<float> counts;
  counts.assign(points.size(), 1.0f);
  if (points.empty()) return counts;
  places.clear();
  const Frame frame = Frame::from_normal(normal);
  for (const Vec3 p : points) {
    const Vec3 local = frame.to_local(p - position);
    places.push_back({local.x, local.y});
  }
  if (is_even(places, sqr(radius))) return counts;
  constexpr uint32_t kStream = 0x6c6f6f6bu;
  const bool looks = to_unit_float(hash_combine(SurfaceDisc::key_of(position), kStream)) < chance;
  const SurfaceDisc disc(scene, position, normal, radius);
  const float in_sight = disc.share_in_sight(), all = looks ? 1.0f + (in_sight / disc.share() - 1.0f) / chance : 1.0f;
  for (size_t k = 0; k < points.size(); ++k) counts[k] = disc.sees(disc.place(points[k])) ? all / in_sight : 0.0f;
  return counts;
}

}  // namespace gi
