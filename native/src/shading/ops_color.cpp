// Ops on colours: blend modes under Blender's names, hue and lightness, gamma, contrast, ramps, colours of light sources.
#include "shading/identities.h"
#include "shading/op_helpers.h"
#include "shading/ops.h"
#include "shading/spectrum.h"
#include "shading/tables.h"

namespace gi {
namespace {

// ---------------------------------------------------------------- colour models

// Hue in turns, saturation, value.
Vec3 rgb_to_hsv(Vec3 c) {
  const float hi = std::max({c.x, c.y, c.z}), range = hi - std::min({c.x, c.y, c.z});
  const float saturation = safe_divide(range, hi);
  if (saturation == 0.0f) return {0.0f, 0.0f, hi};
  const Vec3 below = {(hi - c.x) / range, (hi - c.y) / range, (hi - c.z) / range};
  float h = c.x == hi ? below.z - below.y : c.y == hi ? 2.0f + below.x - below.z : 4.0f + below.y - below.x;
  h /= 6.0f;
  return {h < 0.0f ? h + 1.0f : h, saturation, hi};
}

Vec3 hsv_to_rgb(Vec3 c) {
  const float v = c.z;
  if (c.y == 0.0f) return {v, v, v};
  const float h = c.x == 1.0f ? 0.0f : c.x * 6.0f, sector = std::floor(h), f = h - sector;
  const float p = v * (1.0f - c.y), q = v * (1.0f - c.y * f), t = v * (1.0f - c.y * (1.0f - f));
  if (sector == 0.0f) return {v, t, p};
  if (sector == 1.0f) return {q, v, p};
  if (sector == 2.0f) return {p, v, t};
  if (sector == 3.0f) return {p, q, v};
  if (sector == 4.0f) return {t, p, v};
  return {v, p, q};
}

// Hue in turns, saturation, lightness.
Vec3 rgb_to_hsl(Vec3 c) {
  const float hi = std::max({c.x, c.y, c.z}), lo = std::min({c.x, c.y, c.z}), range = hi - lo;
  const float lightness = std::min(1.0f, 0.5f * (hi + lo));
  if (range == 0.0f) return {0.0f, 0.0f, lightness};
  const float saturation = lightness > 0.5f ? range / (2.0f - hi - lo) : range / (hi + lo);
  float h;
  if (hi == c.x)
    h = (c.y - c.z) / range + (c.y < c.z ? 6.0f : 0.0f);
  else
    h = hi == c.y ? (c.z - c.x) / range + 2.0f : (c.x - c.y) / range + 4.0f;
  return {h / 6.0f, saturation, lightness};
}

Vec3 hsl_to_rgb(Vec3 c) {
  const float h = c.x * 6.0f, chroma = (1.0f - std::abs(2.0f * c.z - 1.0f)) * c.y;
  const auto channel = [&](float x) { return (clamp01(x) - 0.5f) * chroma + c.z; };
  return {channel(std::abs(h - 3.0f) - 1.0f), channel(2.0f - std::abs(h - 2.0f)), channel(2.0f - std::abs(h - 4.0f))};
}

template <auto F>
void convert(const Operands& o, ShadeState&) {
  o.set(0, F(o.v(1)));
}

// ---------------------------------------------------------------- blend modes: factor t, below a, above b

template <auto F>
void blend(const Operands& o, ShadeState&) {
  const float t = o.f(1);
  const Vec3 a = o.v(2), b = o.v(3);
  o.set(0, Vec3{F(t, a.x, b.x), F(t, a.y, b.y), F(t, a.z, b.z)});
}
template <auto F>
void blend_hsv(const Operands& o, ShadeState&) {
  o.set(0, F(o.f(1), o.v(2), o.v(3)));
}

float overlay(float t, float a, float b) {
  const float u = 1.0f - t;
  return a < 0.5f ? a * (u + 2.0f * t * b) : 1.0f - (u + 2.0f * t * (1.0f - b)) * (1.0f - a);
}
float dodge(float t, float a, float b) {
  if (a == 0.0f) return a;
  const float room = 1.0f - t * b;
  return room <= 0.0f ? 1.0f : std::min(a / room, 1.0f);
}
float burn(float t, float a, float b) {
  const float room = 1.0f - t + t * b;
  return room <= 0.0f ? 0.0f : clamp01(1.0f - (1.0f - a) / room);
}
float soft_light(float t, float a, float b) {
  const float screen = 1.0f - (1.0f - b) * (1.0f - a);
  return (1.0f - t) * a + t * ((1.0f - a) * b * a + a * screen);
}
// A grey above has no hue to give.
Vec3 blend_hue(float t, Vec3 a, Vec3 b) {
  const Vec3 from = rgb_to_hsv(b);
  if (from.y == 0.0f) return a;
  const Vec3 hsv = rgb_to_hsv(a);
  return lerp(a, hsv_to_rgb({from.x, hsv.y, hsv.z}), t);
}
Vec3 blend_saturation(float t, Vec3 a, Vec3 b) {
  const Vec3 hsv = rgb_to_hsv(a);
  return hsv.y == 0.0f ? a : hsv_to_rgb({hsv.x, mix(hsv.y, rgb_to_hsv(b).y, t), hsv.z});
}
Vec3 blend_value(float t, Vec3 a, Vec3 b) {
  const Vec3 hsv = rgb_to_hsv(a);
  return hsv_to_rgb({hsv.x, hsv.y, mix(hsv.z, rgb_to_hsv(b).z, t)});
}
Vec3 blend_color(float t, Vec3 a, Vec3 b) {
  const Vec3 from = rgb_to_hsv(b);
  return from.y == 0.0f ? a : lerp(a, hsv_to_rgb({from.x, from.y, rgb_to_hsv(a).z}), t);
}

// ---------------------------------------------------------------- adjustments

void gamma(const Operands& o, ShadeState&) {
  const Vec3 c = o.v(1);
  const float g = o.f(2);
  const auto channel = [g](float x) { return g == 0.0f ? 1.0f : x > 0.0f ? std::pow(x, g) : x; };
  o.set(0, Vec3{channel(c.x), channel(c.y), channel(c.z)});
}

void bright_contrast(const Operands& o, ShadeState&) {
  const float slope = 1.0f + o.f(3), offset = o.f(2) - 0.5f * o.f(3);
  const Vec3 c = o.v(1) * slope + Vec3{offset, offset, offset};
  o.set(0, max(c, {0, 0, 0}));
}

void invert(const Operands& o, ShadeState&) {
  const float t = o.f(1);
  const Vec3 c = o.v(2);
  o.set(0, (Vec3{1, 1, 1} - c) * t + c * (1.0f - t));
}

// hue, saturation, value, factor, colour; a hue of 0.5 changes nothing
void hue_saturation(const Operands& o, ShadeState&) {
  const Vec3 in = o.v(5), hsv = rgb_to_hsv(in);
  const float t = o.f(4);
  const Vec3 c = hsv_to_rgb({fraction(hsv.x + o.f(1) + 0.5f), clamp01(hsv.y * o.f(2)), hsv.z * o.f(3)});
  o.set(0, max(c * t + in * (1.0f - t), {0, 0, 0}));
}

// position; table of four floats an entry, its size, interpolate
void color_ramp(const Operands& o, ShadeState& s) {
  const float* table = s.tables + o.imm(3);
  const int size = o.imm(4);
  const TablePlace p = table_place(o.f(2), size);
  const float* a = table + 4 * p.index;
  const float* b = table + 4 * std::min(p.index + 1, size - 1);
  const float t = o.imm(5) ? p.past : 0.0f;
  o.set(0, Vec3{mix(a[0], b[0], t), mix(a[1], b[1], t), mix(a[2], b[2], t)});
  o.set(1, mix(a[3], b[3], t));
}

void blackbody(const Operands& o, ShadeState&) { o.set(0, blackbody_color(o.f(1))); }
void wavelength(const Operands& o, ShadeState&) { o.set(0, wavelength_color(o.f(1))); }

constexpr OpKind kPure = OpKind::kPure;
const Op kOps[] = {
    {"blend_mix", "v", "fvv", 0, kPure, blend<[](float t, float a, float b) { return mix(a, b, t); }>, 0, nullptr, identity::mix},
    {"blend_darken", "v", "fvv", 0, kPure, blend<[](float t, float a, float b) { return lerp(a, std::min(a, b), t); }>, 0, nullptr,
     identity::blend},
    {"blend_multiply", "v", "fvv", 0, kPure, blend<[](float t, float a, float b) { return a * (1.0f - t + t * b); }>, 0, nullptr,
     identity::blend},
    {"blend_burn", "v", "fvv", 0, kPure, blend<burn>},
    {"blend_lighten", "v", "fvv", 0, kPure, blend<[](float t, float a, float b) { return lerp(a, std::max(a, b), t); }>, 0, nullptr,
     identity::blend},
    {"blend_screen", "v", "fvv", 0, kPure,
     blend<[](float t, float a, float b) { return 1.0f - (1.0f - t + t * (1.0f - b)) * (1.0f - a); }>},
    {"blend_dodge", "v", "fvv", 0, kPure, blend<dodge>},
    {"blend_add", "v", "fvv", 0, kPure, blend<[](float t, float a, float b) { return a + t * b; }>, 0, nullptr, identity::blend},
    {"blend_overlay", "v", "fvv", 0, kPure, blend<overlay>},
    {"blend_soft_light", "v", "fvv", 0, kPure, blend<soft_light>},
    {"blend_linear_light", "v", "fvv", 0, kPure, blend<[](float t, float a, float b) { return a + t * (2.0f * b - 1.0f); }>, 0, nullptr,
     identity::blend},
    {"blend_difference", "v", "fvv", 0, kPure, blend<[](float t, float a, float b) { return lerp(a, std::abs(a - b), t); }>, 0, nullptr,
     identity::blend},
    {"blend_exclusion", "v", "fvv", 0, kPure,
     blend<[](float t, float a, float b) { return std::max(lerp(a, a + b - 2.0f * a * b, t), 0.0f); }>},
    {"blend_subtract", "v", "fvv", 0, kPure, blend<[](float t, float a, float b) { return a - t * b; }>, 0, nullptr, identity::blend},
    {"blend_divide", "v", "fvv", 0, kPure, blend<[](float t, float a, float b) { return b != 0.0f ? (1.0f - t) * a + t * a / b : a; }>},
    {"blend_hue", "v", "fvv", 0, kPure, blend_hsv<blend_hue>},
    {"blend_saturation", "v", "fvv", 0, kPure, blend_hsv<blend_saturation>},
    {"blend_color", "v", "fvv", 0, kPure, blend_hsv<blend_color>},
    {"blend_value", "v", "fvv", 0, kPure, blend_hsv<blend_value>},
    {"rgb_to_hsv", "v", "v", 0, kPure, convert<rgb_to_hsv>},
    {"hsv_to_rgb", "v", "v", 0, kPure, convert<hsv_to_rgb>},
    {"rgb_to_hsl", "v", "v", 0, kPure, convert<rgb_to_hsl>},
    {"hsl_to_rgb", "v", "v", 0, kPure, convert<hsl_to_rgb>},
    {"gamma", "v", "vf", 0, kPure, gamma},
    {"bright_contrast", "v", "vff", 0, kPure, bright_contrast},
    {"invert", "v", "fv", 0, kPure, invert, 0, nullptr, identity::changed},
    {"hue_saturation", "v", "ffffv", 0, kPure, hue_saturation},
    {"color_ramp", "vf", "f", 3, kPure, color_ramp, 0, curve_fits<4>},
    {"blackbody", "v", "f", 0, kPure, blackbody},
    {"wavelength", "v", "f", 0, kPure, wavelength},
};

}  // namespace

std::span<const Op> color_ops() { return kOps; }

}  // namespace gi
