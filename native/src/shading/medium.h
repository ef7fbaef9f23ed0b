// What fills a volume at one place: how much it takes, scatters and emits per metre, and how it scatters.
// Directions point away from the place, as at surfaces. Leaves out where media are (transport/media.h).
#pragma once
#include <memory>
#include <optional>
#include <variant>

#include "shading/fournier_forand.h"
#include "shading/lobes/lobe.h"
#include "shading/phase.h"

namespace gi {

class Medium {
 public:
  Rgb sigma_t, emission;  // per metre; radiance per metre

  Medium() {}
  Medium(const Medium& other) { *this = other; }
  Medium& operator=(const Medium& other) {
    sigma_t = other.sigma_t, emission = other.emission, count_ = other.count_;
    for (int i = 0; i < count_; ++i) std::construct_at(&lobes_[i], other.lobes_[i]);
    return *this;
  }

  // Takes `sigma_s` out of the beam and scatters it by Draine's phase function, or Fournier and Forand's. What comes after the fourth is
  // scattered as the fourth.
  void add_scattering(Rgb sigma_s, float g, float alpha) {
    add_lobe(within_limits(sigma_s), DrainePhase{std::clamp(g, -0.999f, 0.999f), std::max(alpha, 0.0f)});
  }
  void add_scattering(Rgb sigma_s, const FournierForand& phase) { add_lobe(within_limits(sigma_s), phase); }
  void add_absorption(Rgb sigma_a) { sigma_t += within_limits(sigma_a); }
  void add(const Medium& other) {
    sigma_t += other.sigma_t, emission += other.emission;
    for (int i = 0; i < other.count_; ++i) {
      if (count_ < kMost)
        std::construct_at(&lobes_[count_++], other.lobes_[i]);
      else
        lobes_[kMost - 1].sigma_s += other.lobes_[i].sigma_s;
    }
  }
  bool scatters() const { return count_ > 0; }
  Rgb scattering() const {  // σs of all lobes
    Rgb sum;
    for (int i = 0; i < count_; ++i) sum += lobes_[i].sigma_s;
    return sum;
  }
  bool empty() const { return is_black(sigma_t) && is_black(emission); }

  Rgb transmittance(float t) const {
    Rgb passed;
    for (int i = 0; i < 3; ++i) passed[i] = sigma_t[i] > 0.0f ? std::exp(-sigma_t[i] * t) : 1.0f;
    return passed;
  }
  // What is emitted along a way of length t, as it arrives at its beginning.
  Rgb emitted(float t) const {
    Rgb sum;
    for (int i = 0; i < 3; ++i) {
      if (emission[i] <= 0.0f) continue;
      const float depth = sigma_t[i] * t;
      sum[i] = emission[i] * (depth > 1e-4f ? -std::expm1(-depth) / sigma_t[i] : t * (1.0f - 0.5f * depth));
    }
    return sum;
  }

  // Σ σs p over the phase functions, per metre and steradian; the density is that of `sample`.
  LobeEval eval(Vec3 wo, Vec3 wi) const {
    LobeEval e;
    const float cosine = -dot(wo, wi), all = total();
    for (int i = 0; i < count_; ++i) {
      const Lobe& l = lobes_[i];
      float density, pdf;
      if (const auto* dust = std::get_if<DrainePhase>(&l.phase))
        density = dust->density(cosine), pdf = dust->pdf(cosine);
      else
        density = pdf = std::get<FournierForand>(l.phase).density(cosine);
      e.value += l.sigma_s * density;
      e.pdf_dir += average(l.sigma_s) / all * pdf;
    }
    return e;
  }
  std::optional<LobeSample> sample(Vec3 wo, Vec2 u, float u_lobe) const {
    float left = u_lobe * total();
    for (int i = 0; i < count_; ++i) {
      const Lobe& l = lobes_[i];
      left -= average(l.sigma_s);
      if (left > 0.0f && i + 1 < count_) continue;
      const auto* dust = std::get_if<DrainePhase>(&l.phase);
      const Vec3 wi = dust ? dust->sample(-wo, u) : around(-wo, std::get<FournierForand>(l.phase).sample(u.x), u.y);
      const LobeEval e = eval(wo, wi);
      return LobeSample{wi, e.value, e.pdf_dir, 0, 1.0f};
    }
    return {};
  }

 private:
  struct Lobe {
    Rgb sigma_s;
    std::variant<DrainePhase, FournierForand> phase;
  };
  static constexpr int kMost = 4;
  static Rgb within_limits(Rgb sigma) { return min(positive(sigma), Rgb(1e9f)); }
  void add_lobe(Rgb sigma_s, const std::variant<DrainePhase, FournierForand>& phase) {
    sigma_t += sigma_s;
    if (is_black(sigma_s)) return;
    if (count_ == kMost) return void(lobes_[kMost - 1].sigma_s += sigma_s);
    std::construct_at(&lobes_[count_++], Lobe{sigma_s, phase});
  }
  float total() const {
    float sum = 0.0f;
    for (int i = 0; i < count_; ++i) sum += average(lobes_[i].sigma_s);
    return sum;
  }

  union {  // those in use alone are made and copied: media are, at every step of a way
    Lobe lobes_[kMost];
  };
  int count_ = 0;
};

}  // namespace gi
