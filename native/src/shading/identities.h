// When ops give back one of their inputs, by what is known of the others: see Op::equals. Operand 0 is the output.
#pragma once
#include "shading/program.h"

namespace gi::identity {

inline bool is_all(const KnownInputs& in, int i, float x, bool vector) { return vector ? in.is(i, Vec3{x, x, x}) : in.is(i, x); }

template <bool Vector>
int sum(const KnownInputs& in) {
  return is_all(in, 1, 0.0f, Vector) ? 2 : is_all(in, 2, 0.0f, Vector) ? 1 : kNothingKnown;
}
template <bool Vector>
int difference(const KnownInputs& in) {
  return is_all(in, 2, 0.0f, Vector) ? 1 : kNothingKnown;
}
template <bool Vector>
int product(const KnownInputs& in) {
  if (is_all(in, 1, 0.0f, Vector) || is_all(in, 2, 0.0f, Vector)) return kZero;
  return is_all(in, 1, 1.0f, Vector) ? 2 : is_all(in, 2, 1.0f, Vector) ? 1 : kNothingKnown;
}
template <bool Vector>
int quotient(const KnownInputs& in) {
  if (is_all(in, 1, 0.0f, Vector) || is_all(in, 2, 0.0f, Vector)) return kZero;  // dividing by zero gives zero
  return is_all(in, 2, 1.0f, Vector) ? 1 : kNothingKnown;
}
template <bool Vector>
int product_and_sum(const KnownInputs& in) {
  return is_all(in, 1, 0.0f, Vector) || is_all(in, 2, 0.0f, Vector) ? 3 : kNothingKnown;
}
inline int power(const KnownInputs& in) { return in.is(2, 1.0f) ? 1 : kNothingKnown; }
inline int scaled(const KnownInputs& in) {
  if (in.is(1, Vec3{}) || in.is(2, 0.0f)) return kZero;
  return in.is(2, 1.0f) ? 1 : kNothingKnown;
}
inline int dot_product(const KnownInputs& in) { return in.is(1, Vec3{}) || in.is(2, Vec3{}) ? kZero : kNothingKnown; }

// Of factor, below, above: all of one side. The blend modes that change nothing at 0, but for Mix, still differ at 1.
inline int mix(const KnownInputs& in) { return in.is(1, 0.0f) ? 2 : in.is(1, 1.0f) ? 3 : kNothingKnown; }
inline int blend(const KnownInputs& in) { return in.is(1, 0.0f) ? 2 : kNothingKnown; }
// Of a factor and what is changed by it.
inline int changed(const KnownInputs& in) { return in.is(1, 0.0f) ? 2 : kNothingKnown; }

// vector, three rows, location, scale
inline int mapping(const KnownInputs& in) {
  const bool turns = !(in.is(2, Vec3{1, 0, 0}) && in.is(3, Vec3{0, 1, 0}) && in.is(4, Vec3{0, 0, 1}));
  constexpr int kNormal = 3;  // makes vectors unit
  const bool still = !turns && in.is(5, Vec3{}) && in.is(6, Vec3{1, 1, 1}) && in.operands.imm(7) != kNormal;
  return still ? 1 : kNothingKnown;
}

// A bump of no strength gives the normal that it would change.
inline int bump(const KnownInputs& in) { return in.known[4] && in.operands.f(4) <= 0.0f ? 7 : kNothingKnown; }
// height, middle, scale
inline int displacement(const KnownInputs& in) { return in.is(3, 0.0f) ? kZero : kNothingKnown; }

}  // namespace gi::identity
