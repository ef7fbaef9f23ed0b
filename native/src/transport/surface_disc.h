// The part of a disc about a point that is surface, and in sight of the point along it: photons elsewhere, behind a wall, say nothing of
// the point, and where the surface ends there can be none. Looks about by rays.
#pragma once
#include <array>
#include <bit>

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
      : scene_(scene),
        position_(position),
        radius_(radius),
        key_(hash_combine(bits(position.x), hash_combine(bits(position.y), bits(position.z)))) {
    // Above the surface by as much as what is on it may rise, but under what hangs over it.
    height_ = kSurfaceSlope * radius;
    if (const auto above = look(offset_point(position, normal, normal), normal, 2.0f * height_)) height_ = 0.5f * *above;
    eye_ = position + normal * height_;
    const float turn = 2.0f * kPi * number(0), c = std::cos(turn), s = std::sin(turn);
    const Frame even = Frame::from_normal(normal);
    frame_ = {even.x * c + even.y * s, even.y * c - even.x * s, normal};
    for (int k = 0; k < kSectors; ++k) {
      const auto wall = look(eye_, direction(float(k) + 0.5f), radius);
      reach_[size_t(k)] = wall ? *wall : radius;
      is_open_ = is_open_ && !wall;
    }
  }

  Vec2 place(Vec3 p) const {  // in the plane
    const Vec3 local = frame_.to_local(p - position_);
    return {local.x, local.y};
  }
  bool is_open() const { return is_open_; }  // all of it is in sight
  bool sees(Vec2 place) const { return sqr(place.x) + sqr(place.y) <= sqr(reach_[sector(place)]); }

  // The share that is surface and in sight, by chance: rays fall all over what is in sight.
  float share() const {
    constexpr int kRings = 2;
    float sum = 0.0f;
    for (int k = 0; k < kSectors; ++k) {
      const float reach = reach_[size_t(k)], part = sqr(reach / radius_) / float(kSectors * kRings);
      for (int ring = 0; ring < kRings; ++ring) {
        const uint32_t place = uint32_t(1 + 2 * (k * kRings + ring));
        const float distance = reach * std::sqrt((float(ring) + number(place)) / kRings);
        const Vec3 from = eye_ + direction(float(k) + number(place + 1)) * distance;
        const auto ground = look(from, -frame_.z, height_ + kSurfaceSlope * radius_);
        if (ground && is_on_surface(*ground - height_, distance, radius_)) sum += part;
      }
    }
    return std::max(sum, 0.5f / float(kSectors * kRings));
  }

 private:
  static constexpr int kSectors = 8;

  static uint32_t bits(float x) { return std::bit_cast<uint32_t>(x); }
  float number(uint32_t k) const { return to_unit_float(hash_combine(key_, k)); }
  Vec3 direction(float sector) const {
    const float angle = 2.0f * kPi * sector / kSectors;
    return frame_.to_world({std::cos(angle), std::sin(angle), 0.0f});
  }
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
  std::array<float, kSectors> reach_;
  bool is_open_ = true;
};

}  // namespace gi
