// Cloth: the microfibre sheen of [Zeltner et al. 2022] as a linearly transformed cosine [Heitz et al. 2016], and the velvet of
// [Ashikhmin, Premoze & Shirley 2000]. Neither has a Fresnel term; weights carry the tint.
#pragma once
#include "shading/lobes/lobe.h"
#include "shading/lobes/sheen_table.h"

namespace gi {

struct Sheen {
  // The table is read once, for the view that the shading point has.
  Sheen(float roughness, float cos_o) {
    // What is not a number must not become an index.
    const float y = (roughness > 1e-3f ? std::min(roughness, 1.0f) : 1e-3f) * (kSheenGrid - 1);
    const float x = (cos_o > 0.0f ? std::min(cos_o, 1.0f) : 0.0f) * (kSheenGrid - 1);
    const int i = std::min(int(y), kSheenGrid - 2), j = std::min(int(x), kSheenGrid - 2);
    const auto read = [&](const float (&t)[kSheenGrid][kSheenGrid]) {
      return lerp(lerp(t[i][j], t[i][j + 1], x - j), lerp(t[i + 1][j], t[i + 1][j + 1], x - j), y - i);
    };
    a_ = read(kSheenA), b_ = read(kSheenB), albedo_ = read(kSheenR);
    if (albedo_ < 1e-5f || a_ < 1e-5f) albedo_ = 0.0f;
  }

  uint8_t flags() const { return kReflection | kDiffuse; }

  LobeEval eval(Vec3 wo, Vec3 wi) const {
    if (wi.z <= 0.0f || albedo_ <= 0.0f) return {};
    const float p = density(turned(wo, wi, -1.0f));
    return {Rgb(albedo_ * p), p};
  }
  std::optional<LobeSample> sample(Vec3 wo, Vec2 u, float) const {
    if (albedo_ <= 0.0f) return {};
    const Vec3 c = sample_cosine_hemisphere(u);
    const Vec3 w = normalize({c.x - b_ * c.z, c.y, a_ * c.z});
    const float p = density(w);
    if (w.z <= 0.0f || p <= 0.0f) return {};
    return LobeSample{turned(wo, w, 1.0f), Rgb(albedo_ * p), p, flags(), 1.0f};
  }
  Rgb albedo(Vec3) const { return Rgb(albedo_); }

 private:
  // The transform is given in the frame whose x axis is the tangential part of wo.
  static Vec3 turned(Vec3 wo, Vec3 w, float sign) {
    const float r = std::sqrt(wo.x * wo.x + wo.y * wo.y);
    if (r < 1e-6f) return w;
    const float c = wo.x / r, s = sign * wo.y / r;
    return {c * w.x - s * w.y, s * w.x + c * w.y, w.z};
  }
  // [Heitz16 eq. 5] for the inverse transform ((a, 0, b), (0, a, 0), (0, 0, 1)), cosine included.
  float density(Vec3 w) const {
    const float l2 = sqr(a_ * w.x + b_ * w.z) + sqr(a_ * w.y) + sqr(w.z);
    return kInvPi * std::max(w.z, 0.0f) * sqr(a_ / l2);
  }

  float a_, b_, albedo_;
};

struct Velvet {
  explicit Velvet(float sigma) : inv_sigma2_(1.0f / sqr(std::clamp(sigma, 0.01f, 1.0f))) {}

  uint8_t flags() const { return kReflection | kDiffuse; }

  LobeEval eval(Vec3 wo, Vec3 wi) const {
    if (wi.z <= 0.0f) return {};
    const float pdf = 0.5f * kInvPi;
    const Vec3 h = normalize(wo + wi);
    const float cos_nh = h.z, cos_oh = abs_dot(wo, h);
    if (cos_nh >= 1.0f - 1e-5f || cos_oh <= 1e-5f || wo.z <= 1e-5f) return {Rgb(), pdf};
    const float sin2 = 1.0f - sqr(cos_nh);
    const float d = std::exp(-sqr(cos_nh) / sin2 * inv_sigma2_) * inv_sigma2_ * kInvPi / sqr(sin2);
    const float g = std::min(1.0f, 2.0f * std::max(cos_nh / cos_oh, 1e-5f) * std::min(wo.z, wi.z));
    return {Rgb(0.25f * d * g / wo.z), pdf};
  }
  std::optional<LobeSample> sample(Vec3 wo, Vec2 u, float) const {
    const Vec3 wi = sample_uniform_hemisphere(u);
    const LobeEval e = eval(wo, wi);
    if (e.pdf_dir <= 0.0f) return {};
    return LobeSample{wi, e.value, e.pdf_dir, flags(), 1.0f};
  }
  Rgb albedo(Vec3) const { return Rgb(1.0f); }

 private:
  float inv_sigma2_;
};

}  // namespace gi
