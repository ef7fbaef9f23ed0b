// Phase functions: how media scatter. Directions are those that light travels, before and after; densities per steradian.
#pragma once
#include "core/vec.h"

namespace gi {

// [Henyey & Greenstein 1941]
inline float henyey_greenstein(float cosine, float g) {
  if (std::abs(g) < 1e-3f) return 0.25f * kInvPi;
  const float d = 1.0f + g * g - 2.0f * g * cosine;
  return 0.25f * kInvPi * (1.0f - g * g) / (d * std::sqrt(d));
}

inline Vec3 around(Vec3 direction, float cosine, float turns) {
  const float sine = safe_sqrt(1.0f - cosine * cosine), phi = 2.0f * kPi * turns;
  return Frame::from_normal(direction).to_world({sine * std::cos(phi), sine * std::sin(phi), cosine});
}

inline Vec3 sample_henyey_greenstein(Vec3 direction, float g, Vec2 u) {
  float cosine = 1.0f - 2.0f * u.x;
  if (std::abs(g) >= 1e-3f) {
    const float k = (1.0f - g * g) / (1.0f - g + 2.0f * g * u.x);
    cosine = (1.0f + g * g - k * k) / (2.0f * g);
  }
  return around(direction, std::clamp(cosine, -1.0f, 1.0f), u.y);
}

// [Draine 2003, "Scattering by interstellar dust grains"]: Rayleigh at g = 0 and alpha = 1, Henyey and Greenstein at alpha = 0.
inline float draine(float cosine, float g, float alpha) {
  const float g2 = g * g, d = 1.0f + g2 - 2.0f * g * cosine;
  return 0.25f * kInvPi * (1.0f - g2) * (1.0f + alpha * cosine * cosine) / ((1.0f + alpha * (1.0f + 2.0f * g2) / 3.0f) * d * std::sqrt(d));
}

// Henyey and Greenstein's part of it is drawn; where there is little of it, all directions alike.
struct DrainePhase {
  float g = 0, alpha = 0;
  float density(float cosine) const { return draine(cosine, g, alpha); }
  float pdf(float cosine) const { return henyey_greenstein(cosine, drawn_g()); }  // of what `sample` gives
  Vec3 sample(Vec3 direction, Vec2 u) const { return sample_henyey_greenstein(direction, drawn_g(), u); }

 private:
  float drawn_g() const { return std::abs(g) < 0.05f ? 0.0f : g; }
};

// Water drops by their diameter (micrometres): a mix of both. [Jendersie & d'Eon 2023, "An approximate Mie scattering function"]
struct MieFit {
  float g_henyey, g_draine, alpha, share_draine;
};
inline MieFit mie_fit(float diameter) {
  const float d = std::max(diameter, 0.0f);
  if (d <= 0.1f) return {13.8f * d * d, 1.1456f * d * std::sin(9.29044f * d), 250.0f, 0.252977f - 312.983f * std::pow(d, 4.3f)};
  const float l = std::log(d);
  if (d < 1.5f) {
    const float a = (l - 0.238604f) * (l + 1.00667f), b = 0.507522f - 0.15677f * l;
    const float c = 1.19692f * std::cos(a / b) + 1.37932f * l + 0.0625835f;
    return {0.862f - 0.143f * l * l, 0.379685f * std::cos(c) + 0.344213f, 250.0f,
            0.146209f * std::cos(3.38707f * l + 2.11193f) + 0.316072f + 0.0778917f * l};
  }
  if (d < 5.0f)
    return {0.0604931f * std::log(l) + 0.940256f, 0.500411f - 0.081287f / (-2.0f * l + std::tan(l) + 1.27551f), 7.30354f * l + 6.31675f,
            0.026914f * (l - std::cos(5.68947f * (std::log(l) - 0.0292149f))) + 0.3764f};
  return {std::exp(-0.0990567f / (d - 1.67154f)), std::exp(-2.20679f / (d + 3.91029f) - 0.428934f),
          std::exp(3.62489f - 8.29288f / (d + 5.52825f)), std::exp(-0.599085f / (d - 0.641583f) - 0.665888f)};
}

}  // namespace gi
