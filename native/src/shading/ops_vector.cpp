// Ops on vectors: the Vector Math node's operations under Blender's names, rotation, mapping, map range, mix and curves.
#include "shading/identities.h"
#include "shading/op_helpers.h"
#include "shading/ops.h"
#include "shading/tables.h"
#include "shading/textures/radial_tiling.h"

namespace gi {
namespace {

template <auto F>
void vector_op1(const Operands& o, ShadeState&) {
  o.set(0, F(o.v(1)));
}
template <auto F>
void vector_op2(const Operands& o, ShadeState&) {
  o.set(0, F(o.v(1), o.v(2)));
}
template <auto F>
void vector_op3(const Operands& o, ShadeState&) {
  o.set(0, F(o.v(1), o.v(2), o.v(3)));
}

Vec3 divide(Vec3 a, Vec3 b) { return {safe_divide(a.x, b.x), safe_divide(a.y, b.y), safe_divide(a.z, b.z)}; }
Vec3 project(Vec3 a, Vec3 onto) { return onto * safe_divide(dot(a, onto), dot(onto, onto)); }
// `a` points towards the surface here, as in the Vector Math node.
Vec3 reflect_incident(Vec3 a, Vec3 b) {
  const Vec3 n = normalize(b);
  return a - n * (2.0f * dot(a, n));
}
void refract_incident(const Operands& o, ShadeState&) {
  const Vec3 a = o.v(1), n = normalize(o.v(2));
  const float eta = o.f(3), c = dot(n, a), k = 1.0f - eta * eta * (1.0f - c * c);
  o.set(0, k < 0.0f ? Vec3{} : a * eta - n * (eta * c + std::sqrt(k)));
}
Vec3 face_forward(Vec3 a, Vec3 incident, Vec3 reference) { return dot(reference, incident) < 0.0f ? a : -a; }
void scale(const Operands& o, ShadeState&) { o.set(0, o.v(1) * o.f(2)); }

float wrap(float x, float hi, float lo) {
  const float range = hi - lo, a = x - lo;
  return (range != 0.0f ? a - std::floor(a / range) * range : 0.0f) + lo;
}

// ---------------------------------------------------------------- rotation

struct Rotation {
  Vec3 rows[3];
  Vec3 apply(Vec3 v) const { return {dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)}; }
  Vec3 apply_inverse(Vec3 v) const { return rows[0] * v.x + rows[1] * v.y + rows[2] * v.z; }
};

// Euler angles, about X first, then Y, then Z. An op of its own, so that constant angles cost nothing later.
void euler_rows(const Operands& o, ShadeState&) {
  const Vec3 e = o.v(3);
  const float cx = std::cos(e.x), sx = std::sin(e.x), cy = std::cos(e.y), sy = std::sin(e.y), cz = std::cos(e.z), sz = std::sin(e.z);
  o.set(0, Vec3{cy * cz, sy * sx * cz - cx * sz, sy * cx * cz + sx * sz});
  o.set(1, Vec3{cy * sz, sy * sx * sz + cx * cz, sy * cx * sz - sx * cz});
  o.set(2, Vec3{-sy, cy * sx, cy * cx});
}

Rotation rotation_at(const Operands& o, int i) { return {{o.v(i), o.v(i + 1), o.v(i + 2)}}; }

// vector, three rows, location, scale; kind
void mapping(const Operands& o, ShadeState&) {
  enum { kPoint, kTexture, kVector, kNormal };
  const Vec3 v = o.v(1), location = o.v(5), size = o.v(6);
  const Rotation r = rotation_at(o, 2);
  switch (o.imm(7)) {
    case kTexture: return o.set(0, divide(r.apply_inverse(v - location), size));
    case kVector: return o.set(0, r.apply(v * size));
    case kNormal: return o.set(0, normalize(r.apply(divide(v, size))));
    default: return o.set(0, r.apply(v * size) + location);
  }
}

// vector, centre, three rows; inverse
void rotate_rows(const Operands& o, ShadeState&) {
  const Vec3 center = o.v(2), v = o.v(1) - center;
  const Rotation r = rotation_at(o, 3);
  o.set(0, (o.imm(6) ? r.apply_inverse(v) : r.apply(v)) + center);
}

// vector, centre, axis, angle [Rodrigues]
void rotate_axis(const Operands& o, ShadeState&) {
  const Vec3 center = o.v(2), v = o.v(1) - center, axis = normalize(o.v(3));
  if (axis == Vec3{}) return o.set(0, o.v(1));
  const float c = std::cos(o.f(4)), s = std::sin(o.f(4));
  o.set(0, v * c + cross(axis, v) * s + axis * (dot(axis, v) * (1.0f - c)) + center);
}

// ---------------------------------------------------------------- ranges, mixes, curves

float map_factor(float x, float from_min, float from_max, float steps, int kind) {
  enum { kLinear, kStepped, kSmooth, kSmoother };
  const float t = safe_divide(x - from_min, from_max - from_min);
  if (kind == kSmooth) return smoothstep(0.0f, 1.0f, t);
  if (kind == kSmoother) return smootherstep(0.0f, 1.0f, t);
  if (kind == kStepped) return steps > 0.0f ? std::floor(t * (steps + 1.0f)) / steps : 0.0f;
  return t;
}

// value, from min, from max, to min, to max, steps; kind, clamp
void map_range_vector(const Operands& o, ShadeState&) {
  const Vec3 x = o.v(1), from_min = o.v(2), from_max = o.v(3), to_min = o.v(4), to_max = o.v(5), steps = o.v(6);
  Vec3 r;
  for (int i = 0; i < 3; ++i) {
    r[i] = to_min[i] + map_factor(x[i], from_min[i], from_max[i], steps[i], o.imm(7)) * (to_max[i] - to_min[i]);
    if (o.imm(8)) r[i] = clamp_to(r[i], std::min(to_min[i], to_max[i]), std::max(to_min[i], to_max[i]));
  }
  o.set(0, r);
}

void mix_vector(const Operands& o, ShadeState&) {
  const float t = o.f(1);
  o.set(0, o.v(2) * (1.0f - t) + o.v(3) * t);
}

// factor, vector; table of three floats an entry, its size, extrapolate, bits of the range's ends
void curves(const Operands& o, ShadeState& s) {
  const Vec3 x = o.v(2);
  const float lo = float_of_bits(o.imm(6)), hi = float_of_bits(o.imm(7)), t = o.f(1);
  Vec3 y;
  for (int i = 0; i < 3; ++i)
    y[i] = mix(x[i], curve_lookup(s.tables + o.imm(3) + i, o.imm(4), 3, (x[i] - lo) / (hi - lo), o.imm(5) != 0), t);
  o.set(0, y);
}

constexpr OpKind kPure = OpKind::kPure;
// -> (along, outwards, 0), segment, width, rotation; vector, sides, roundness; normalized
void radial_tiling(const Operands& o, ShadeState&) {
  const Vec3 p = o.v(4);
  const float sides = std::max(o.f(5), 2.0f);
  const texture::RadialTiling t = texture::RadialPolygon(sides, clamp01(o.f(6))).at(p.x, p.y, o.imm(7) != 0);
  o.set(0, Vec3{t.along, t.outwards, 0.0f}), o.set(1, texture::radial_segment(p.x, p.y, sides));
  o.set(2, t.width), o.set(3, t.rotation);
}

const Op kOps[] = {
    {"vector_add", "v", "vv", 0, kPure, vector_op2<[](Vec3 a, Vec3 b) { return a + b; }>, 0, nullptr, identity::sum<true>},
    {"vector_subtract", "v", "vv", 0, kPure, vector_op2<[](Vec3 a, Vec3 b) { return a - b; }>, 0, nullptr, identity::difference<true>},
    {"vector_multiply", "v", "vv", 0, kPure, vector_op2<[](Vec3 a, Vec3 b) { return a * b; }>, 0, nullptr, identity::product<true>},
    {"vector_divide", "v", "vv", 0, kPure, vector_op2<divide>, 0, nullptr, identity::quotient<true>},
    {"vector_multiply_add", "v", "vvv", 0, kPure, vector_op3<[](Vec3 a, Vec3 b, Vec3 c) { return a * b + c; }>, 0, nullptr,
     identity::product_and_sum<true>},
    {"vector_cross_product", "v", "vv", 0, kPure, vector_op2<cross>},
    {"vector_project", "v", "vv", 0, kPure, vector_op2<project>},
    {"vector_reflect", "v", "vv", 0, kPure, vector_op2<reflect_incident>},
    {"vector_refract", "v", "vvf", 0, kPure, refract_incident},
    {"vector_faceforward", "v", "vvv", 0, kPure, vector_op3<face_forward>},
    {"vector_dot_product", "f", "vv", 0, kPure, vector_op2<[](Vec3 a, Vec3 b) { return dot(a, b); }>, 0, nullptr, identity::dot_product},
    {"vector_distance", "f", "vv", 0, kPure, vector_op2<[](Vec3 a, Vec3 b) { return length(a - b); }>},
    {"vector_length", "f", "v", 0, kPure, vector_op1<[](Vec3 a) { return length(a); }>},
    {"vector_scale", "v", "vf", 0, kPure, scale, 0, nullptr, identity::scaled},
    {"vector_normalize", "v", "v", 0, kPure, vector_op1<normalize>},
    {"vector_absolute", "v", "v", 0, kPure, component_op1<[](float a) { return std::abs(a); }>},
    {"vector_power", "v", "vv", 0, kPure, component_op2<safe_power>},
    {"vector_sign", "v", "v", 0, kPure, component_op1<sign_or_zero>},
    {"vector_minimum", "v", "vv", 0, kPure, component_op2<[](float a, float b) { return std::fmin(a, b); }>},
    {"vector_maximum", "v", "vv", 0, kPure, component_op2<[](float a, float b) { return std::fmax(a, b); }>},
    {"vector_floor", "v", "v", 0, kPure, component_op1<[](float a) { return std::floor(a); }>},
    {"vector_ceil", "v", "v", 0, kPure, component_op1<[](float a) { return std::ceil(a); }>},
    {"vector_round", "v", "v", 0, kPure, component_op1<[](float a) { return std::floor(a + 0.5f); }>},
    {"vector_fraction", "v", "v", 0, kPure, component_op1<fraction>},
    {"vector_modulo", "v", "vv", 0, kPure, component_op2<safe_modulo>},
    {"vector_wrap", "v", "vvv", 0, kPure, component_op3<wrap>},
    {"vector_snap", "v", "vv", 0, kPure, component_op2<snap>},
    {"vector_sine", "v", "v", 0, kPure, component_op1<[](float a) { return std::sin(a); }>},
    {"vector_cosine", "v", "v", 0, kPure, component_op1<[](float a) { return std::cos(a); }>},
    {"vector_tangent", "v", "v", 0, kPure, component_op1<[](float a) { return std::tan(a); }>},
    {"euler_rows", "vvv", "v", 0, kPure, euler_rows},
    {"mapping", "v", "vvvvvv", 1, kPure, mapping, 0, nullptr, identity::mapping},
    {"rotate_rows", "v", "vvvvv", 1, kPure, rotate_rows},
    {"rotate_axis", "v", "vvvf", 0, kPure, rotate_axis},
    {"radial_tiling", "vfff", "vff", 1, kPure, radial_tiling},
    {"map_range_vector", "v", "vvvvvv", 2, kPure, map_range_vector},
    {"saturate_vector", "v", "v", 0, kPure, component_op1<[](float a) { return clamp01(a); }>},
    {"mix_vector", "v", "fvv", 0, kPure, mix_vector, 0, nullptr, identity::mix},
    {"mix_vector_each", "v", "vvv", 0, kPure, component_op3<[](float t, float a, float b) { return mix(a, b, t); }>},
    {"curves", "v", "fv", 5, kPure, curves, 0, curve_fits<3>, identity::changed},
};

}  // namespace

std::span<const Op> vector_ops() { return kOps; }

}  // namespace gi
