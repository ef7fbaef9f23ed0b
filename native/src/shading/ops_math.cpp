// Ops on numbers: the Math node's operations under Blender's names, map range, clamp, curves, and conversions between widths.
#include "shading/identities.h"
#include "shading/op_helpers.h"
#include "shading/ops.h"
#include "shading/tables.h"

namespace gi {
namespace {

float smooth_minimum(float a, float b, float width) {
  if (width == 0.0f) return std::min(a, b);
  const float h = std::max(width - std::abs(a - b), 0.0f) / width;
  return std::min(a, b) - h * h * h * width * (1.0f / 6.0f);
}

float wrap(float x, float hi, float lo) {
  const float range = hi - lo;
  return range != 0.0f ? x - range * std::floor((x - lo) / range) : lo;
}

float ping_pong(float a, float scale) {
  return scale != 0.0f ? std::abs(fraction((a - scale) / (scale * 2.0f)) * scale * 2.0f - scale) : 0.0f;
}

float logarithm(float a, float base) { return a <= 0.0f || base <= 0.0f ? 0.0f : safe_divide(std::log(a), std::log(base)); }

float map_factor(float x, float from_min, float from_max, float steps, int kind) {
  enum { kLinear, kStepped, kSmooth, kSmoother };
  const bool turned = from_min > from_max;
  if (kind == kSmooth) return turned ? 1.0f - smoothstep(from_max, from_min, x) : smoothstep(from_min, from_max, x);
  if (kind == kSmoother) return turned ? 1.0f - smootherstep(from_max, from_min, x) : smootherstep(from_min, from_max, x);
  const float t = (x - from_min) / (from_max - from_min);
  if (kind == kStepped) return steps > 0.0f ? std::floor(t * (steps + 1.0f)) / steps : 0.0f;
  return t;
}

// value, from min, from max, to min, to max, steps; kind, clamp
void map_range(const Operands& o, ShadeState&) {
  const float from_min = o.f(2), from_max = o.f(3), to_min = o.f(4), to_max = o.f(5);
  if (from_min == from_max) return o.set(0, o.imm(8) ? clamp_to(0.0f, std::min(to_min, to_max), std::max(to_min, to_max)) : 0.0f);
  float x = to_min + map_factor(o.f(1), from_min, from_max, o.f(6), o.imm(7)) * (to_max - to_min);
  if (o.imm(8)) x = clamp_to(x, std::min(to_min, to_max), std::max(to_min, to_max));
  o.set(0, x);
}

void clamp_range(const Operands& o, ShadeState&) {
  const float a = o.f(2), b = o.f(3);
  o.set(0, a > b ? clamp_to(o.f(1), b, a) : clamp_to(o.f(1), a, b));
}

void mix_float(const Operands& o, ShadeState&) { o.set(0, mix(o.f(2), o.f(3), o.f(1))); }

// factor, value; table, its size, extrapolate, and the bits of the range's ends
void float_curve(const Operands& o, ShadeState& s) {
  const float x = o.f(2), lo = float_of_bits(o.imm(6)), hi = float_of_bits(o.imm(7));
  const float y = curve_lookup(s.tables + o.imm(3), o.imm(4), 1, (x - lo) / (hi - lo), o.imm(5) != 0);
  o.set(0, mix(x, y, o.f(1)));
}

void splat(const Operands& o, ShadeState&) {
  const float a = o.f(1);
  o.set(0, Vec3{a, a, a});
}
void average_op(const Operands& o, ShadeState&) { o.set(0, average(o.c(1))); }
void rgb_to_bw(const Operands& o, ShadeState&) { o.set(0, luminance(o.c(1))); }
void combine(const Operands& o, ShadeState&) { o.set(0, Vec3{o.f(1), o.f(2), o.f(3)}); }

constexpr OpKind kPure = OpKind::kPure;
const Op kOps[] = {
    {"splat", "v", "f", 0, kPure, splat},
    {"average", "f", "v", 0, kPure, average_op},
    {"rgb_to_bw", "f", "v", 0, kPure, rgb_to_bw},
    {"combine", "v", "fff", 0, kPure, combine},
    {"map_range", "f", "ffffff", 2, kPure, map_range},
    {"clamp_minmax", "f", "fff", 0, kPure, float_op3<clamp_to>},
    {"clamp_range", "f", "fff", 0, kPure, clamp_range},
    {"saturate", "f", "f", 0, kPure, float_op1<[](float a) { return clamp01(a); }>},
    {"mix_float", "f", "fff", 0, kPure, mix_float, 0, nullptr, identity::mix},
    {"float_curve", "f", "ff", 5, kPure, float_curve, 0, curve_fits<1>, identity::changed},
    {"math_add", "f", "ff", 0, kPure, float_op2<[](float a, float b) { return a + b; }>, 0, nullptr, identity::sum<false>},
    {"math_subtract", "f", "ff", 0, kPure, float_op2<[](float a, float b) { return a - b; }>, 0, nullptr, identity::difference<false>},
    {"math_multiply", "f", "ff", 0, kPure, float_op2<[](float a, float b) { return a * b; }>, 0, nullptr, identity::product<false>},
    {"math_divide", "f", "ff", 0, kPure, float_op2<safe_divide>, 0, nullptr, identity::quotient<false>},
    {"math_multiply_add", "f", "fff", 0, kPure, float_op3<[](float a, float b, float c) { return a * b + c; }>, 0, nullptr,
     identity::product_and_sum<false>},
    {"math_power", "f", "ff", 0, kPure, float_op2<safe_power>, 0, nullptr, identity::power},
    {"math_logarithm", "f", "ff", 0, kPure, float_op2<logarithm>},
    {"math_sqrt", "f", "f", 0, kPure, float_op1<safe_sqrt>},
    {"math_inverse_sqrt", "f", "f", 0, kPure, float_op1<[](float a) { return (a > 0.0f) ? 1.0f / std::sqrt(a) : 0.0f; }>},
    {"math_absolute", "f", "f", 0, kPure, float_op1<[](float a) { return std::abs(a); }>},
    {"math_exponent", "f", "f", 0, kPure, float_op1<[](float a) { return std::exp(a); }>},
    {"math_minimum", "f", "ff", 0, kPure, float_op2<[](float a, float b) { return std::fmin(a, b); }>},
    {"math_maximum", "f", "ff", 0, kPure, float_op2<[](float a, float b) { return std::fmax(a, b); }>},
    {"math_less_than", "f", "ff", 0, kPure, float_op2<[](float a, float b) { return a < b; }>},
    {"math_greater_than", "f", "ff", 0, kPure, float_op2<[](float a, float b) { return (a > b); }>},
    {"math_sign", "f", "f", 0, kPure, float_op1<sign_or_zero>},
    {"math_compare", "f", "fff", 0, kPure,
     float_op3<[](float a, float b, float c) { return a == b || std::abs(a - b) <= std::fmax(c, 1.1920929e-7f); }>},
    {"math_smooth_min", "f", "fff", 0, kPure, float_op3<smooth_minimum>},
    {"math_smooth_max", "f", "fff", 0, kPure, float_op3<[](float a, float b, float c) { return -smooth_minimum(-a, -b, c); }>},
    {"math_round", "f", "f", 0, kPure, float_op1<[](float a) { return std::floor(a + 0.5f); }>},
    {"math_floor", "f", "f", 0, kPure, float_op1<[](float a) { return std::floor(a); }>},
    {"math_ceil", "f", "f", 0, kPure, float_op1<[](float a) { return std::ceil(a); }>},
    {"math_trunc", "f", "f", 0, kPure, float_op1<[](float a) { return std::trunc(a); }>},
    {"math_fract", "f", "f", 0, kPure, float_op1<fraction>},
    {"math_modulo", "f", "ff", 0, kPure, float_op2<safe_modulo>},
    {"math_floored_modulo", "f", "ff", 0, kPure, float_op2<[](float a, float b) { return b != 0.0f ? a - std::floor(a / b) * b : 0.0f; }>},
    {"math_wrap", "f", "fff", 0, kPure, float_op3<wrap>},
    {"math_snap", "f", "ff", 0, kPure, float_op2<snap>},
    {"math_pingpong", "f", "ff", 0, kPure, float_op2<ping_pong>},
    {"math_sine", "f", "f", 0, kPure, float_op1<[](float a) { return std::sin(a); }>},
    {"math_cosine", "f", "f", 0, kPure, float_op1<[](float a) { return std::cos(a); }>},
    {"math_tangent", "f", "f", 0, kPure, float_op1<[](float a) { return std::tan(a); }>},
    {"math_arcsine", "f", "f", 0, kPure, float_op1<[](float a) { return std::asin(clamp_to(a, -1.0f, 1.0f)); }>},
    {"math_arccosine", "f", "f", 0, kPure, float_op1<[](float a) { return std::acos(clamp_to(a, -1.0f, 1.0f)); }>},
    {"math_arctangent", "f", "f", 0, kPure, float_op1<[](float a) { return std::atan(a); }>},
    {"math_arctan2", "f", "ff", 0, kPure, float_op2<[](float a, float b) { return a == 0.0f && b == 0.0f ? 0.0f : std::atan2(a, b); }>},
    {"math_sinh", "f", "f", 0, kPure, float_op1<[](float a) { return std::sinh(a); }>},
    {"math_cosh", "f", "f", 0, kPure, float_op1<[](float a) { return std::cosh(a); }>},
    {"math_tanh", "f", "f", 0, kPure, float_op1<[](float a) { return std::tanh(a); }>},
    {"math_radians", "f", "f", 0, kPure, float_op1<[](float a) { return a * (kPi / 180.0f); }>},
    {"math_degrees", "f", "f", 0, kPure, float_op1<[](float a) { return a * (180.0f / kPi); }>},
};

}  // namespace

std::span<const Op> math_ops() { return kOps; }

}  // namespace gi
