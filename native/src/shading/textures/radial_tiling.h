// Blender's Radial Tiling: coordinates within the segments of a polygon with rounded corners about the origin. The number of
// sides need not be whole: the last side is then shorter than the others.
#pragma once
#include "core/vec.h"

namespace gi::texture {

struct RadialTiling {
  float along = 0, outwards = 0;  // along the segment; from the centre (0) to the outline (1)
  float width = 0;                // of half a segment at the outline
  float rotation = 0;             // of its middle, radians from the x axis
};

// Half a segment: from the ray through a corner to the ray through the middle of the side, in lengths in which the side's distance
// is 1. From the corner up to the angle `bevel` the outline is an arc, over which lengths blend into angles by a parabola.
struct HalfSegment {
  float angle, bevel, roundness;

  // At radius `r`, the angle `t` from the corner, and `out` from the centre to the outline.
  float along(float r, float t, float out) const {
    if (t >= bevel) return out * std::tan(std::abs(angle - t));
    const float y = r * std::cos(flat()), past = bevel - t;
    const float arc = past < blend() ? y * past + 0.5f * (1.0f - y) * sqr(past) / blend() : blend() * (0.5f * y - 0.5f) + past;
    return r * std::sin(flat()) + arc;
  }
  // What `along` comes to at the corner.
  float end(float r, float t, float out) const {
    const float straight = out * std::tan(flat()) + arc_length(out);
    if (t >= bevel) return straight;
    const float round = r * std::sin(flat()) + arc_length(r * std::cos(flat()));
    return straight + (bevel - t) / bevel * (round - straight);
  }
  // At the outline; `scale`: its 1 in the lengths of the whole polygon.
  float width(float scale) const { return std::tan(flat()) + scale * (blend() * (0.5f / scale + 0.5f) + roundness * bevel); }

 private:
  float flat() const { return angle - bevel; }
  float blend() const { return (1.0f - roundness) * bevel; }
  float arc_length(float y) const { return blend() * (0.5f * y + 0.5f) + roundness * bevel; }
};

// From the origin at `angle` to the far side of a circle.
inline float to_circle(float angle, Vec2 center, float radius) {
  const float along = std::sin(angle) * center.y + std::cos(angle) * center.x;
  return along + std::sqrt(sqr(along) + sqr(radius) - sqr(center.x) - sqr(center.y));
}

// What does not depend on the point. `sides` from 2 on, `roundness` in [0, 1].
class RadialPolygon {
 public:
  RadialPolygon(float sides, float roundness) : half_(kPi / sides), usual_{half_, bevel(half_, roundness), roundness} {
    if (sides == std::floor(sides)) return;
    has_last_ = true;
    last_half_ = kPi - std::floor(sides) * half_;
    last_ = {last_half_, bevel(last_half_, roundness), roundness};
    scale_ = std::cos(half_) / std::cos(last_half_);
    // The arc beside the last side touches both it and its neighbour.
    radius_ = roundness * std::tan(last_half_) / std::tan(0.5f * (half_ + last_half_));
    const float to_start = 1.0f / std::cos(last_half_ - last_.bevel);
    center_ = {std::cos(last_.bevel) * to_start - radius_ * std::cos(last_half_),
               radius_ * std::sin(last_half_) - std::sin(last_.bevel) * to_start};
    const float start = std::atan((center_.y + radius_ * std::sin(half_)) / (center_.x + radius_ * std::cos(half_)));
    beside_last_ = {half_, start, 1.0f - std::tan(half_ - start) / std::tan(half_)};
  }

  RadialTiling at(float x, float y, bool normalized) const {
    constexpr float kTurn = 2.0f * kPi;
    const float r = std::sqrt(sqr(x) + sqr(y)), from_x = std::atan2(y, x), phi = from_x + (y < 0.0f ? kTurn : 0.0f);
    const float first = 2.0f * half_ * std::floor(phi / (2.0f * half_)), within = phi - first;
    const float last_begins = has_last_ ? kTurn - 2.0f * last_half_ : 2.0f * kTurn;
    const HalfSegment* here = &usual_;
    float t, out, scale = 1.0f;
    if (!has_last_ || (phi >= beside_last_.bevel && phi < last_begins - beside_last_.bevel)) {
      t = within > half_ ? 2.0f * half_ - within : within;
      if (has_last_ && (phi < half_ || phi >= last_begins - half_)) here = &beside_last_;
      const float corner = (1.0f - usual_.roundness) / std::cos(half_);
      out = t >= here->bevel ? r * std::cos(half_ - within) : r / to_circle(t, {corner, 0.0f}, usual_.roundness);
    } else if (phi >= last_begins + last_.bevel && phi < kTurn - last_.bevel) {
      here = &last_, scale = scale_;
      t = within > last_half_ ? 2.0f * last_half_ - within : within;
      out = r * std::cos(last_half_ - within);
    } else {
      // An arc beside the last side: angles from its corner, those towards the last side's middle negative.
      const bool before = phi >= last_begins - beside_last_.bevel && phi < kTurn - last_half_;
      const float turned = before ? -(from_x + 2.0f * last_half_) : from_x;
      const bool on_last = turned < 0.0f;
      here = on_last ? &last_ : &beside_last_, scale = on_last ? scale_ : 1.0f;
      t = std::abs(turned);
      out = r / to_circle(turned, center_, radius_) * (on_last ? 1.0f : scale_);
    }
    const float middle = here == &last_ ? last_half_ : half_;
    RadialTiling tiling{scale * here->along(r, t, out), scale * out, (here == &last_ ? last_ : usual_).width(scale), first + middle};
    if (within < middle) tiling.along = -tiling.along;
    const bool endless = half_ == 0.5f * kPi && usual_.roundness == 0.0f;  // two sides do not meet
    if (normalized && !endless) tiling.along /= scale * here->end(r, t, out);
    if (endless) tiling.width = 0.0f;
    if (r == 0.0f) tiling.along = 0.0f;
    normalized ? tiling.along = 0.5f * tiling.along + 0.5f : tiling.outwards -= 1.0f;
    // Two sides have no corner that an arc could round.
    return {finite(tiling.along), finite(tiling.outwards), tiling.width, tiling.rotation};
  }

 private:
  static float finite(float x) { return std::isfinite(x) ? x : 0.0f; }
  static float bevel(float half, float roundness) {
    return roundness == 0.0f ? 0.0f : half - std::atan((1.0f - roundness) * std::tan(half));
  }
  float half_;
  HalfSegment usual_, last_{}, beside_last_{};  // the last one on the side of its neighbour
  bool has_last_ = false;
  float last_half_ = 0, scale_ = 1;  // the last side's distance 1 in the lengths of the whole
  float radius_ = 0;                 // of the arc beside the last side, in the lengths of that
  Vec2 center_;
};

inline float radial_segment(float x, float y, float sides) {
  return std::floor(sides * (std::atan2(y, x) / (2.0f * kPi) + (y < 0.0f ? 1.0f : 0.0f)));
}

}  // namespace gi::texture
