// Huang's fibre: integrals over the width of the fibre by Simpson's rule, over facets of the first interfaces by one sample for each place.
// Within: Y along the fibre, X the ellipse's long axis, Z its short one; θ from the X-Z plane, φ from Z to X. γ is the parameter of the
// ellipse (sin γ, b cos γ), h where a ray meets its width. Samples are drawn by what a smooth fibre would do, widened.
#include "shading/lobes/hair_huang.h"

#include <array>
#include <cstring>

#include "core/sampler.h"
#include "shading/lobes/fresnel.h"
#include "shading/lobes/ggx_tables.h"
#include "shading/lobes/microfacet_distribution.h"

namespace gi {
namespace {

Vec3 within(Vec3 local) { return {local.z, local.x, local.y}; }
Vec3 without(Vec3 v) { return {v.y, v.z, v.x}; }

float cos_theta(Vec3 w) { return std::sqrt(w.x * w.x + w.z * w.z); }
float tan_theta(Vec3 w) { return w.y / std::max(cos_theta(w), 1e-8f); }
float phi_of(Vec3 w) { return std::atan2(w.x, w.z); }
Vec3 direction(float theta, float phi) {
  const float c = std::cos(theta);
  return {std::sin(phi) * c, std::sin(theta), std::cos(phi) * c};
}

// The ellipse's normal at γ points to φ, and back. The first also turns a chord's direction into the angle that it has on the circle.
float phi_of_gamma(float gamma, float b) { return b == 1.0f ? gamma : std::atan2(b * std::sin(gamma), std::cos(gamma)); }
float gamma_of_phi(float phi, float b) { return b == 1.0f ? phi : std::atan2(std::sin(phi), b * std::cos(phi)); }
Vec2 point_at(float gamma, float b) { return {std::sin(gamma), b * std::cos(gamma)}; }
float distance(Vec2 p, Vec2 q) { return std::hypot(p.x - q.x, p.y - q.y); }

// Smith's Λ of GGX, G2, and G2 over G1 of the side that the light comes from. [Heitz 2014, eq. 72 and 99]
struct Facets {
  float alpha;
  float lambda(float c) const { return 0.5f * (std::sqrt(1.0f + sqr(alpha) * std::max(1.0f / (c * c) - 1.0f, 0.0f)) - 1.0f); }
  float g2(float ci, float co) const { return 1.0f / (1.0f + lambda(ci) + lambda(co)); }
  float g2_over_g1(float ci, float co) const { return (1.0f + lambda(ci)) / (1.0f + lambda(ci) + lambda(co)); }
  float density(float c) const { return sqr(alpha) * kInvPi / sqr(1.0f + (sqr(alpha) - 1.0f) * c * c); }
  Vec3 sample(Vec3 w, Vec3 mean, Vec2 u) const {
    const Frame frame = Frame::from_normal(mean);
    return frame.to_world(Ggx{alpha, alpha}.sample_visible(frame.to_local(w), u));
  }
  // What restores the energy of bounces between facets: as of glass.
  float restored(float c, float eta) const { return 1.0f / ggx_glass_energy(std::sqrt(alpha), c, eta).directional; }
};

bool sees(Vec3 w, Vec3 m, Vec3 h) { return dot(w, h) > 0.0f && dot(w, m) > 0.0f; }
bool sees(Vec3 a, Vec3 b, Vec3 m, Vec3 h) { return sees(a, m, h) && sees(b, m, h); }

// Into the far side; where that is not possible the result means nothing. `eta`: far over near.
Vec3 refracted(Vec3 w, Vec3 h, float eta) {
  const float c = dot(w, h), ct = safe_sqrt(1.0f - (1.0f - c * c) / (eta * eta));
  return h * (c / eta - ct) - w / eta;
}

uint32_t bits(float x) {
  uint32_t u;
  std::memcpy(&u, &x, sizeof u);
  return u;
}
struct RandomNumbers {  // [O'Neill 2014, "PCG", the 32-bit hash]
  uint32_t state;
  RandomNumbers(Vec3 a, Vec3 b) : state(0x9e3779b9u) {
    for (const float x : {a.x, a.y, a.z, b.x, b.y, b.z}) state = hash_combine(state, bits(x));
  }
  float next() {
    state = state * 747796405u + 2891336453u;
    const uint32_t word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return float(((word >> 22u) ^ word) >> 8) * 0x1p-24f;
  }
  Vec2 next_2d() {
    const float x = next();
    return {x, next()};
  }
};

// One evaluation.
class Fibre {
 public:
  Fibre(const HairHuang& model, Vec3 o, Vec3 i) : m_(model), o_(o), i_(i), facets_{model.alpha}, phi_o_(phi_of(o)), b_(model.aspect) {
    sin_o_ = std::sin(phi_o_), cos_o_ = std::cos(phi_o_);
    radius_ = std::sqrt(std::max(1.0f - (1.0f - b_ * b_) * sqr(sin_o_), 1e-12f));
  }

  // f |cos| over the width that is seen.
  Rgb value() {
    const float tan_tilt = std::tan(m_.tilt), edge = std::max(-tan_tilt * tan_theta(o_), 0.0f);
    if (tan_tilt * tan_theta(i_) < -1.0f || edge > 1.0f) return Rgb();
    const float span = std::acos(edge);
    const float first = std::max(h_of_phi(phi_o_ + span), m_.h_from), last = std::min(h_of_phi(phi_o_ - span), m_.h_to);
    seen_ = (std::min(m_.h_to, radius_) - std::max(m_.h_from, -radius_)) / radius_;
    const float from = std::max(first / radius_, -1.0f), to = std::min(last / radius_, 1.0f);
    if (!(from < to) || !(seen_ > 0.0f)) return Rgb();
    from_ = gamma_of_h(to), to_ = gamma_of_h(from);  // one rises as the other falls
    return Rgb(reflected()) + passed();
  }

 private:
  // h over the projected radius, and γ there. [Huang et al. 2022, §3.2]
  float h_of_phi(float phi) const {
    const float gamma = gamma_of_phi(phi, b_);
    return -cos_o_ * std::sin(gamma) + b_ * sin_o_ * std::cos(gamma);
  }
  float gamma_of_h(float h) const { return b_ == 1.0f ? phi_o_ - std::asin(h) : std::atan2(cos_o_, -b_ * sin_o_) - std::acos(-h); }
  float dh_dgamma(float gamma) const { return (cos_o_ * std::cos(gamma) + b_ * sin_o_ * std::sin(gamma)) / radius_; }
  Vec3 normal(float theta, float gamma) const { return direction(theta, phi_of_gamma(gamma, b_)); }
  float arc(float gamma) const { return b_ == 1.0f ? 1.0f : std::sqrt(1.0f - (1.0f - b_ * b_) * sqr(std::sin(gamma))); }

  // The mean over the width that is seen by Simpson's rule in γ, with steps of about `step`: f(γ, weight). Over h, as the paper has it,
  // rays that graze the fibre would count too much.
  template <class F>
  void over_width(float step, const F& f) const {
    const int n = 2 * std::max(int(std::ceil(0.5f * (to_ - from_) / step)), 1);
    const float width = (to_ - from_) / float(n);
    for (int i = 0; i <= n; ++i) f(from_ + float(i) * width, width * (i == 0 || i == n ? 1.0f : i % 2 ? 4.0f : 2.0f) / (3.0f * seen_));
  }

  // [Huang et al. 2022, eq. 6]
  float reflected() const {
    if (m_.r <= 0.0f) return 0.0f;
    const Vec3 h = normalize(o_ + i_);
    float sum = 0.0f;
    over_width(0.7f * m_.alpha, [&](float gamma, float weight) {
      const Vec3 meso = normal(m_.tilt, gamma);
      if (!sees(o_, i_, {meso.x, 0.0f, meso.z}, h)) return;
      const float co = dot(meso, o_);
      sum += weight * facets_.density(dot(meso, h)) * facets_.g2(co, dot(meso, i_)) * arc(gamma) * facets_.restored(co, m_.eta);
    });
    return 0.25f * m_.r * fresnel_dielectric(dot(o_, h), m_.eta) * sum / (cos_theta(o_) * radius_);
  }

  // The share that the fibre's inside lets pass from γ to γ', and the way it takes within the fibre's cross section.
  Rgb absorbed(float way, Vec3 w) const { return exp(m_.sigma * (-way / std::max(cos_theta(w), 1e-6f))); }

  // A ray that has come in through one facet of the first interface.
  struct Inside {
    Vec3 t, meso, macro;  // its direction; normals where it meets the far side, both inwards
    float gamma;  // of these
    float energy;  // what came in
    float amount;  // of that, per area of the far side; the weight of its place included
    Rgb absorbed;
    float cos_in;  // to the mesonormal of the far side
  };
  std::optional<Inside> enter(float gamma, float weight, Vec2 u) const {
    const Vec3 meso = normal(m_.tilt, gamma), macro = normal(0.0f, gamma), h = facets_.sample(o_, meso, u);
    if (!(dot(o_, h) > 0.0f)) return {};
    Inside in;
    in.t = refracted(o_, h, m_.eta);
    if (!sees(o_, -in.t, meso, h) || !sees(o_, -in.t, macro, h)) return {};
    const float cos_o = dot(o_, meso), cos_t = dot(-in.t, meso);
    in.energy = (1.0f - fresnel_dielectric(dot(o_, h), m_.eta)) * facets_.restored(cos_o, m_.eta) * facets_.g2_over_g1(cos_o, cos_t);
    in.amount = weight * in.energy * cos_o / cos_t;
    in.gamma = 2.0f * chord_angle(in.t) - gamma;
    in.meso = normal(-m_.tilt, in.gamma), in.macro = normal(0.0f, in.gamma);
    in.absorbed = absorbed(distance(point_at(gamma, b_), point_at(in.gamma + kPi, b_)), in.t);
    in.cos_in = dot(-in.t, in.meso);
    return in;
  }
  // The parameter of the ellipse half way between the ends of a chord in direction w.
  float chord_angle(Vec3 w) const { return phi_of_gamma(phi_of(w), b_); }

  // Out towards i_ through the facets about `meso`, from within along −w.
  float leave(Vec3 w, Vec3 meso, Vec3 h_scaled) const {
    const float scale2 = 1.0f / length_squared(h_scaled);
    const Vec3 h = h_scaled * std::sqrt(scale2);
    const float cos_hw = dot(w, h), cos_hi = -dot(i_, h), cos_w = dot(w, meso), inv_eta = 1.0f / m_.eta;
    const float transmitted = (1.0f - fresnel_dielectric(cos_hw, inv_eta)) * facets_.restored(cos_w, inv_eta);
    return transmitted * facets_.density(dot(meso, h)) * facets_.g2(cos_w, -dot(i_, meso)) * cos_hw * cos_hi * scale2;
  }

  // [Huang et al. 2022, eq. 7 to 9]
  Rgb passed() const {
    if (m_.tt <= 0.0f && m_.trt <= 0.0f) return Rgb();
    RandomNumbers random(o_, i_);
    Rgb bent, rest;
    over_width(0.8f * m_.alpha, [&](float gamma, float weight) {
      const Vec2 u_in = random.next_2d(), u_back = random.next_2d(), u_out = random.next_2d();
      const auto in = enter(gamma, weight, u_in);
      if (!in) return;
      if (m_.tt > 0.0f) add_finite(bent, straight_through(*in) * m_.tt);
      if (m_.trt > 0.0f) {
        const auto [once, more] = turned_back(*in, gamma, weight, u_back, u_out);
        add_finite(bent, once * m_.trt), add_finite(rest, more);
      }
    });
    const float along = along_fibre(o_.y, cos_theta(o_), i_.y, cos_theta(i_), 4.0f * m_.alpha);
    return bent / (sqr(m_.eta) * cos_theta(o_) * radius_) + rest * (along * 0.5f * kInvPi);
  }
  static void add_finite(Rgb& sum, Rgb x) {
    if (is_finite(x)) sum += x;
  }

  Rgb straight_through(const Inside& in) const {
    const float inv_eta = 1.0f / m_.eta;
    if (dot(i_, in.t) < inv_eta - 1e-5f) return Rgb();  // reflected totally
    const Vec3 h = i_ * inv_eta - in.t;
    return dot(in.meso, h) < 0.0f ? Rgb() : in.absorbed * (in.amount * leave(-in.t, in.meso, h) * arc(in.gamma));
  }

  // Reflected once within; and what stays within after that, in all directions together.
  std::pair<Rgb, Rgb> turned_back(const Inside& in, float gamma, float weight, Vec2 u, Vec2 u_out) const {
    const float inv_eta = 1.0f / m_.eta;
    const Vec3 h = facets_.sample(-in.t, in.meso, u), back = reflect(in.t, h);  // against its way
    if (!sees(-in.t, -back, in.meso, h) || !sees(-in.t, -back, in.macro, h)) return {};
    const float r = fresnel_dielectric(dot(-in.t, h), inv_eta), cos_back = dot(in.meso, -back);
    const float gamma_out = gamma - 2.0f * (chord_angle(in.t) - chord_angle(back)) + kPi;
    const Vec3 meso = normal(-m_.tilt, gamma_out), macro = normal(0.0f, gamma_out), h_out = back + i_ * inv_eta;
    const Rgb way = in.absorbed * absorbed(distance(point_at(gamma_out, b_), point_at(in.gamma, b_)), back);
    const float turned = r * facets_.restored(in.cos_in, inv_eta) * facets_.g2_over_g1(in.cos_in, cos_back);
    const Rgb more = residue(back, meso, r, way, u_out) * (in.energy * turned * weight * dh_dgamma(gamma));
    if (-dot(back, i_) < inv_eta - 1e-5f) return {Rgb(), more};  // reflected totally
    if (dot(meso, h_out) < 0.0f || !sees(back, -i_, meso, h_out) || !sees(back, -i_, macro, h_out)) return {Rgb(), more};
    return {way * (in.amount * turned * in.cos_in / cos_back * leave(back, meso, h_out) * arc(gamma_out)), more};
  }

  // What is reflected more than once, about as Chiang has it: a series that goes on as it began. `way`: absorbed on two passages.
  Rgb residue(Vec3 w, Vec3 meso, float r, Rgb way, Vec2 u) const {
    const float cos_w = dot(w, meso);
    if (!(cos_w > 0.0f)) return Rgb();
    const Vec3 h = facets_.sample(w, meso, u);
    const float r_out = fresnel_dielectric(dot(w, h), 1.0f / m_.eta), t_mean = std::max(1.0f - 0.5f * (r + r_out), 1e-5f);
    Rgb rest;
    for (int i = 0; i < 3; ++i) {
      const float once = std::sqrt(way[i]);
      rest[i] = way[i] * once * t_mean / (1.0f - once * (1.0f - t_mean));
    }
    return rest * (r_out * facets_.restored(cos_w, 1.0f / m_.eta) * facets_.g2_over_g1(cos_w, dot(meso, reflect(w, h))));
  }

  const HairHuang& m_;
  Vec3 o_, i_;
  Facets facets_;
  float phi_o_, b_, sin_o_, cos_o_, radius_, seen_ = 2, from_ = 0, to_ = 0;
};

// ---------------------------------------------------------------- what samples are drawn from

enum Part { kR, kTt, kTrt, kRest, kAnywhere, kParts };

// A smooth circular fibre's lobes, widened as the facets would: not what is evaluated, but nowhere much less.
struct Guess {
  std::array<float, kParts> share{};
  std::array<float, kParts> variance{};
  CutLogistic through;
  float sin_o, cos_o, phi, tilt;

  Guess(const HairHuang& m, Vec3 o) : through(0.3f + 0.5f * m.alpha), sin_o(o.y), cos_o(cos_theta(o)), phi(phi_of(o)), tilt(m.tilt) {
    constexpr float kPlaces[] = {0.2f, 0.6f, 0.9f};  // where rays meet the fibre
    const float cos_t = std::max(cos_of_sin(sin_o / m.eta), 1e-3f);
    for (const float h : kPlaces) {
      const float r = fresnel_dielectric(cos_o * cos_of_sin(h), m.eta), depth = -2.0f * cos_of_sin(h / m.eta) / cos_t;
      const Rgb a = exp(m.sigma * depth);
      share[kR] += m.r * r, share[kTt] += m.tt * sqr(1.0f - r) * average(a), share[kTrt] += m.trt * sqr(1.0f - r) * r * average(a * a);
      share[kRest] += m.trt * sqr(r) * average(a * a * a);
    }
    const float sum = share[kR] + share[kTt] + share[kTrt] + share[kRest];
    share[kAnywhere] = 0.15f * sum + 1e-6f;
    for (float& x : share) x /= 1.15f * sum + 1e-6f;
    const float v = sqr(m.alpha);
    const auto kept = [](float x) { return std::clamp(x, 1e-4f, 4.0f); };
    variance = {kept(1.5f * v), kept(v), kept(4.0f * v), kept(4.0f * m.alpha), 1.0f};
  }
  std::pair<float, float> tilted(int part) const {
    const float by = part == kR ? -2.0f * tilt : part == kTt ? tilt : part == kTrt ? 4.0f * tilt : 0.0f;
    const float s = std::sin(by), c = std::cos(by);
    return {sin_o * c + cos_o * s, std::abs(cos_o * c - sin_o * s)};
  }
  float density(Vec3 i) const {
    const float around = wrapped_angle(phi_of(i) - phi), cos_i = cos_theta(i);
    float sum = share[kAnywhere] * 0.25f * kInvPi;
    for (int p = 0; p < kAnywhere; ++p) {
      const auto [s, c] = tilted(p);
      const float n = p == kR ? 0.25f * std::cos(0.5f * around) : p == kTt ? through.density(wrapped_angle(around - kPi)) : 0.5f * kInvPi;
      sum += share[size_t(p)] * n * along_fibre(i.y, cos_i, s, c, variance[size_t(p)]);
    }
    return sum;
  }
  Vec3 sample(Vec2 u, float u_part) const {
    int part = 0;
    while (part < kAnywhere && u_part >= share[size_t(part)]) u_part -= share[size_t(part)], ++part;
    const float left = clamp01(u_part / share[size_t(part)]);
    float around = 2.0f * kPi * u.x, sin_i = 2.0f * left - 1.0f;
    if (part == kR) around = 2.0f * asin_safe(2.0f * u.x - 1.0f);
    if (part == kTt) around = kPi + through.sample(u.x);
    if (part != kAnywhere) {
      const auto [s, c] = tilted(part);
      sin_i = sample_along_fibre(s, c, variance[size_t(part)], {std::max(left, 1e-5f), u.y});
    }
    return direction(asin_safe(sin_i), phi + around);
  }
};

}  // namespace

float HairHuang::projected_radius(Vec3 wo) const {
  const Vec3 o = within(wo);
  return std::sqrt(std::max(1.0f - (1.0f - aspect * aspect) * safe_divide(sqr(o.x), sqr(o.x) + sqr(o.z)), 0.0f));
}

Rgb HairHuang::value(Vec3 wo, Vec3 wi) const {
  const Vec3 o = within(wo), i = within(wi);
  if (!(cos_theta(o) > 1e-4f) || !(cos_theta(i) > 1e-4f)) return Rgb();
  const Rgb sum = Fibre(*this, o, i).value();
  return is_finite(sum) ? positive(sum) : Rgb();
}

float HairHuang::density(Vec3 wo, Vec3 wi) const { return Guess(*this, within(wo)).density(within(wi)); }

std::optional<LobeSample> HairHuang::sample(Vec3 wo, Vec2 u, float u_lobe) const {
  const Guess guess(*this, within(wo));
  const Vec3 i = guess.sample(u, u_lobe), wi = without(i);
  const float pdf = guess.density(i);
  if (!(pdf > 0.0f) || !std::isfinite(pdf)) return {};
  return LobeSample{wi, value(wo, wi), pdf, kReflection | kGlossy, alpha};
}

// Of a smooth circular fibre, met half way to its edge.
Rgb HairHuang::albedo(Vec3 wo) const {
  const Vec3 o = within(wo);
  const float r = fresnel_dielectric(cos_theta(o) * 0.866f, eta), cos_t = std::max(cos_of_sin(o.y / eta), 1e-3f);
  const Rgb a = exp(sigma * (-2.0f * cos_of_sin(0.5f / eta) / cos_t));
  return Rgb(r) + a * sqr(1.0f - r) / (Rgb(1.0f) - a * r);
}

}  // namespace gi
