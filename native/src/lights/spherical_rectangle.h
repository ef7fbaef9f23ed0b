// Uniform sampling of the solid angle of a rectangle.
// [Ureña, Fajardo & King 2013, "An area-preserving parametrization for spherical rectangles"]
#pragma once
#include "core/warp.h"

namespace gi {

class SphericalRectangle {
 public:
  // `u`, `v`: unit, orthogonal; the rectangle is `size` wide along them about `middle`.
  SphericalRectangle(Vec3 from, Vec3 middle, Vec3 u, Vec3 v, Vec2 size)
      : from_(from), u_(u), v_(v), n_(cross(u, v)), area_(size.x * size.y) {
    const Vec3 d = middle - from;
    x_ = dot(d, u), y_ = dot(d, v), z_ = dot(d, n_);
    if (z_ > 0.0f) n_ = -n_, z_ = -z_;
    x0_ = x_ - 0.5f * size.x, x1_ = x_ + 0.5f * size.x, y0_ = y_ - 0.5f * size.y, y1_ = y_ + 0.5f * size.y;
    // z components of the edge planes' normals, and the inner angles less a quarter turn: kept apart from π so that
    // small rectangles keep their digits.
    const float n0 = -y0_ / hypot(y0_), n1 = x1_ / hypot(x1_), n2 = y1_ / hypot(y1_), n3 = -x0_ / hypot(x0_);
    const float g0 = safe_asin(-n0 * n1), g1 = safe_asin(-n1 * n2);
    g2_ = safe_asin(-n2 * n3), g3_ = safe_asin(-n3 * n0);
    solid_angle_ = -(g0 + g1 + g2_ + g3_);
    b0_ = n0, b1_ = n2;
    const float steepest = std::max({n0 * n0, n1 * n1, n2 * n2, n3 * n3});
    by_area_ = !(solid_angle_ > 1e-5f) || steepest > 0.99999f;
  }

  Vec3 sample(Vec2 r) const {
    if (by_area_) return place(lerp(x0_, x1_, r.x), lerp(y0_, y1_, r.y));
    const float a = r.x * solid_angle_ + g2_ + g3_;
    const float f = safe_divide(std::cos(a) * b0_ + b1_, std::sin(a));
    const float c = std::clamp(std::copysign(1.0f / std::sqrt(f * f + b0_ * b0_), f), -1.0f, 1.0f);
    const float x = std::clamp(-(c * z_) / std::max(safe_sqrt(1.0f - c * c), 1e-7f), x0_, x1_);
    const float d2 = x * x + z_ * z_;
    const float h0 = y0_ / std::sqrt(d2 + y0_ * y0_), h1 = y1_ / std::sqrt(d2 + y1_ * y1_);
    const float h = lerp(h0, h1, r.y), h2 = h * h;
    return place(x, h2 < 1.0f - 1e-6f ? std::clamp(h * std::sqrt(d2 / (1.0f - h2)), y0_, y1_) : y1_);
  }

  // At a point `distance` away that is seen under `cos_light`.
  float pdf_dir(float distance, float cos_light) const {
    return by_area_ ? pdf_area_to_dir(1.0f / area_, distance, cos_light) : 1.0f / solid_angle_;
  }

 private:
  static float safe_asin(float x) { return std::asin(std::clamp(x, -1.0f, 1.0f)); }
  float hypot(float a) const { return std::max(std::sqrt(a * a + z_ * z_), 1e-30f); }
  Vec3 place(float x, float y) const { return from_ + u_ * x + v_ * y + n_ * z_; }

  Vec3 from_, u_, v_, n_;
  float area_, x_, y_, z_, x0_, x1_, y0_, y1_, g2_, g3_, b0_, b1_, solid_angle_;
  bool by_area_;
};

}  // namespace gi
