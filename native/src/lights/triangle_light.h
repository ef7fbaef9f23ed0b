// One emissive triangle: uniform over its solid angle where it is seen large, over its area elsewhere.
// What it emits is the business of its material.
#pragma once
#include "lights/light_common.h"

namespace gi {

struct TriangleSample {
  Vec3 wi;
  float distance = 0, pdf_dir = 0;
  float b1 = 0, b2 = 0;
};

struct TriangleLight {
  Vec3 a, ab, ac;
  uint32_t instance = 0, triangle = 0;
  uint32_t material = 0;
  bool front = true, back = true;  // which sides are sampled; front is where ab × ac points
  Vec3 n;                // ab × ac
  float twice_area = 0;  // its length
  float edge2 = 0;       // longest, squared

  TriangleLight() = default;
  explicit TriangleLight(const Vec3 v[3])
      : a(v[0]),
        ab(v[1] - v[0]),
        ac(v[2] - v[0]),
        n(cross(ab, ac)),
        twice_area(length(n)),
        edge2(std::max({length_squared(ab), length_squared(ac), length_squared(ac - ab)})) {}

  Vec3 normal() const { return normalize(n); }
  float area() const { return 0.5f * twice_area; }

  std::optional<TriangleSample> sample(Vec3 position, Vec2 u) const {
    if (!shines_to(position)) return std::nullopt;
    if (is_near(position)) {
      const Corners c(*this, position);
      if (c.by_angle) return sample_by_angle(c, position, u);
    }
    return sample_by_area(position, u);
  }

  bool shines_to(Vec3 position) const { return dot(position - a, n) > 0.0f ? front : back; }

  // Density of `sample` at the point in direction `wi`, which is on the triangle.
  float pdf_dir(Vec3 position, Vec3 wi) const {
    if (!shines_to(position)) return 0.0f;
    if (is_near(position)) {
      const Corners c(*this, position);
      if (c.by_angle) return 1.0f / c.solid_angle;
    }
    const float across = dot(wi, n);
    if (across == 0.0f) return 0.0f;
    const float distance = std::abs(dot(a - position, n) / across);
    return pdf_area_to_dir(2.0f / twice_area, distance, std::abs(across) / twice_area);
  }

 private:
  // Where area sampling's 1/cos and 1/d² do not matter the cheaper way is taken; near a whole half space the angles
  // lose their digits. Bounds as in pbrt-v4.
  static constexpr float kMinSolidAngle = 3e-4f, kMaxSolidAngle = 6.22f;
  static constexpr float kFar = 8.0f;  // in edges

  // Whether it fills so much of the view that 1/cos and 1/d² change across it.
  bool is_near(Vec3 position) const {
    const Vec3 to = a - position;
    return sqr(dot(to, n)) < edge2 * sqr(twice_area) && length_squared(to) < sqr(kFar) * edge2;
  }

  struct Corners {
    Vec3 a, b, c;
    float determinant, solid_angle;
    bool by_angle;
    Corners(const TriangleLight& t, Vec3 p) : a(normalize(t.a - p)), b(normalize(t.a + t.ab - p)), c(normalize(t.a + t.ac - p)) {
      // [Van Oosterom & Strackee 1983]
      determinant = dot(a, cross(b, c));
      solid_angle = 2.0f * std::abs(std::atan2(determinant, 1.0f + dot(a, b) + dot(a, c) + dot(b, c)));
      by_angle = solid_angle > kMinSolidAngle && solid_angle < kMaxSolidAngle;
    }
  };

  std::optional<TriangleSample> sample_by_area(Vec3 position, Vec2 u) const {
    const Vec2 b = sample_triangle(u);
    const Vec3 to = a + ab * b.x + ac * b.y - position;
    const float distance = length(to);
    if (!(distance > 0.0f)) return std::nullopt;
    const Vec3 wi = to / distance;
    const float pdf = pdf_area_to_dir(2.0f / twice_area, distance, abs_dot(wi, n) / twice_area);
    return TriangleSample{wi, distance, pdf, b.x, b.y};
  }

  // As Arvo [1995, "Stratified sampling of spherical triangles"]: u.x moves c along the arc a–c so as to cut off that share
  // of the solid angle, u.y goes along the arc from b to it. From tan(Ω/2) above, the bisector `o` of a and the moved c
  // is linear in a and c, without the angles that slivers lose their digits in. [Peters 2021, "BRDF importance sampling
  // for polygonal lights"]
  std::optional<TriangleSample> sample_by_angle(const Corners& k, Vec3 position, Vec2 u) const {
    const float half = 0.5f * u.x * k.solid_angle, sin = std::sin(half), cos = std::cos(half);
    const Vec3 o = k.a * (std::abs(k.determinant) * cos - dot(k.a + k.b, k.c) * sin) + k.c * ((1.0f + dot(k.a, k.b)) * sin);
    const float o2 = length_squared(o);
    const Vec3 cut = o2 > 0.0f ? o * (2.0f * dot(k.a, o) / o2) - k.a : k.a;

    const Vec3 along = cut - k.b;
    const float whole = 0.5f * length_squared(along), part = u.y * whole;  // 1 − cos of the arcs
    const Vec3 across = normalize(along + k.b * whole);
    const Vec3 wi = normalize(k.b * (1.0f - part) + across * safe_sqrt(part * (2.0f - part)));
    return on_triangle(position, wi, 1.0f / k.solid_angle);
  }

  // Barycentrics of the direction, clamped into the triangle. [Möller & Trumbore 1997]
  std::optional<TriangleSample> on_triangle(Vec3 position, Vec3 wi, float pdf) const {
    const Vec3 p = cross(wi, ac);
    const float det = dot(ab, p);
    if (det == 0.0f) return std::nullopt;
    const Vec3 from_a = position - a;
    float b1 = std::clamp(dot(from_a, p) / det, 0.0f, 1.0f);
    float b2 = std::clamp(dot(wi, cross(from_a, ab)) / det, 0.0f, 1.0f);
    if (b1 + b2 > 1.0f) {
      const float s = 1.0f / (b1 + b2);
      b1 *= s, b2 *= s;
    }
    return TriangleSample{wi, length(a + ab * b1 + ac * b2 - position), pdf, b1, b2};
  }
};

}  // namespace gi
