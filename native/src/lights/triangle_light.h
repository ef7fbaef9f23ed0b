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

  Vec3 normal() const { return normalize(cross(ab, ac)); }
  float area() const { return 0.5f * length(cross(ab, ac)); }
  bool shines_to(Vec3 position) const { return dot(position - a, cross(ab, ac)) > 0.0f ? front : back; }

  std::optional<TriangleSample> sample(Vec3 position, Vec2 u) const {
    if (!shines_to(position)) return std::nullopt;
    const Corners c(*this, position);
    return c.by_angle ? sample_by_angle(c, position, u) : sample_by_area(position, u);
  }

  // Density of `sample` at the point in direction `wi`, which is on the triangle.
  float pdf_dir(Vec3 position, Vec3 wi) const {
    if (!shines_to(position)) return 0.0f;
    const Corners c(*this, position);
    if (c.by_angle) return 1.0f / c.solid_angle;
    const Vec3 n = cross(ab, ac);
    const float twice_area = length(n), across = dot(wi, n);
    if (across == 0.0f) return 0.0f;
    const float distance = std::abs(dot(a - position, n) / across);
    return pdf_area_to_dir(2.0f / twice_area, distance, std::abs(across) / twice_area);
  }

 private:
  // Where area sampling's 1/cos and 1/d² do not matter the cheaper way is taken; near a whole half space the angles
  // lose their digits. Bounds as in pbrt-v4.
  static constexpr float kMinSolidAngle = 3e-4f, kMaxSolidAngle = 6.22f;

  struct Corners {
    Vec3 a, b, c;
    float solid_angle;
    bool by_angle;
    Corners(const TriangleLight& t, Vec3 p) : a(normalize(t.a - p)), b(normalize(t.a + t.ab - p)), c(normalize(t.a + t.ac - p)) {
      // [Van Oosterom & Strackee 1983]
      solid_angle = 2.0f * std::abs(std::atan2(dot(a, cross(b, c)), 1.0f + dot(a, b) + dot(a, c) + dot(b, c)));
      by_angle = solid_angle > kMinSolidAngle && solid_angle < kMaxSolidAngle;
    }
  };

  std::optional<TriangleSample> sample_by_area(Vec3 position, Vec2 u) const {
    const Vec2 b = sample_triangle(u);
    const Vec3 to = a + ab * b.x + ac * b.y - position, n = cross(ab, ac);
    const float distance = length(to), twice_area = length(n);
    if (!(distance > 0.0f)) return std::nullopt;
    const Vec3 wi = to / distance;
    const float pdf = pdf_area_to_dir(2.0f / twice_area, distance, abs_dot(wi, n) / twice_area);
    return TriangleSample{wi, distance, pdf, b.x, b.y};
  }

  // [Arvo 1995, "Stratified sampling of spherical triangles"]: u.x cuts off a triangle of that share of the area by an arc
  // through b, u.y goes along the arc.
  std::optional<TriangleSample> sample_by_angle(const Corners& k, Vec3 position, Vec2 u) const {
    const Vec3 n_ab = normalize(cross(k.a, k.b)), n_ca = normalize(cross(k.c, k.a));
    if (n_ab == Vec3{0, 0, 0} || n_ca == Vec3{0, 0, 0}) return sample_failed(k, position);
    const float cos_alpha = std::clamp(-dot(n_ab, n_ca), -1.0f, 1.0f), sin_alpha = length(cross(n_ab, n_ca));
    const float area = u.x * k.solid_angle;
    const float s = std::sin(area) * cos_alpha - std::cos(area) * sin_alpha;  // sin(area − α)
    const float t = std::cos(area) * cos_alpha + std::sin(area) * sin_alpha;  // cos(area − α)
    const float p = t - cos_alpha, q = s + sin_alpha * dot(k.a, k.b);
    float cos_b = ((t * q - s * p) * cos_alpha - q) / ((s * q + t * p) * sin_alpha);
    if (!std::isfinite(cos_b)) cos_b = 1.0f;
    cos_b = std::clamp(cos_b, -1.0f, 1.0f);
    const Vec3 c_cut = k.a * cos_b + normalize(k.c - k.a * dot(k.c, k.a)) * safe_sqrt(1.0f - cos_b * cos_b);
    const float cos_arc = 1.0f - u.y * (1.0f - dot(c_cut, k.b));
    const Vec3 wi = normalize(k.b * cos_arc + normalize(c_cut - k.b * dot(c_cut, k.b)) * safe_sqrt(1.0f - cos_arc * cos_arc));
    return on_triangle(position, wi, 1.0f / k.solid_angle);
  }

  std::optional<TriangleSample> sample_failed(const Corners& k, Vec3 position) const {
    return on_triangle(position, normalize(k.a + k.b + k.c), 1.0f / k.solid_angle);
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
