// Wrapping plain functions of floats and vectors as ops, and arithmetic that never divides by zero, as Blender's nodes do it.
#pragma once
#include "shading/program.h"

namespace gi {

// f(a), f(a, b), f(a, b, c) of floats.
template <auto F>
void float_op1(const Operands& o, ShadeState&) {
  o.set(0, float(F(o.f(1))));
}
template <auto F>
void float_op2(const Operands& o, ShadeState&) {
  o.set(0, float(F(o.f(1), o.f(2))));
}
template <auto F>
void float_op3(const Operands& o, ShadeState&) {
  o.set(0, float(F(o.f(1), o.f(2), o.f(3))));
}

// The same function on each component.
template <auto F>
void component_op1(const Operands& o, ShadeState&) {
  const Vec3 a = o.v(1);
  o.set(0, Vec3{F(a.x), F(a.y), F(a.z)});
}
template <auto F>
void component_op2(const Operands& o, ShadeState&) {
  const Vec3 a = o.v(1), b = o.v(2);
  o.set(0, Vec3{F(a.x, b.x), F(a.y, b.y), F(a.z, b.z)});
}
template <auto F>
void component_op3(const Operands& o, ShadeState&) {
  const Vec3 a = o.v(1), b = o.v(2), c = o.v(3);
  o.set(0, Vec3{F(a.x, b.x, c.x), F(a.y, b.y, c.y), F(a.z, b.z, c.z)});
}

inline float fraction(float a) { return a - std::floor(a); }
// 0 to the 0 is 1; negative numbers have powers with whole exponents only.
inline float safe_power(float a, float b) {
  if (b == 0.0f) return 1.0f;
  if (a == 0.0f || (a < 0.0f && b != std::trunc(b))) return 0.0f;
  return std::pow(a, b);
}
inline float safe_modulo(float a, float b) { return b != 0.0f ? std::fmod(a, b) : 0.0f; }
inline float sign_or_zero(float a) { return a == 0.0f ? 0.0f : a < 0.0f ? -1.0f : 1.0f; }
inline float snap(float a, float step) { return std::floor(safe_divide(a, step)) * step; }
// std::clamp without its precondition: where lo > hi, and for NaN, gives a bound.
inline float clamp_to(float x, float lo, float hi) { return std::min(std::max(lo, x), hi); }
inline float smoothstep(float lo, float hi, float x) {
  if (x < lo) return 0.0f;
  if (x >= hi) return 1.0f;
  const float t = (x - lo) / (hi - lo);
  return t * t * (3.0f - 2.0f * t);
}
inline float smootherstep(float lo, float hi, float x) {
  const float t = clamp_to(safe_divide(x - lo, hi - lo), 0.0f, 1.0f);
  return t * t * t * (t * (t * 6.0f - 15.0f) + 10.0f);
}
// Both ends are met exactly, however far apart in size.
inline float mix(float a, float b, float t) { return (1.0f - t) * a + t * b; }

}  // namespace gi
