// Ops that make normals and tangents: normal maps, bumps from heights at shifted points, displacement as bump.
#include "scene/object_space.h"
#include "scene/scene.h"
#include "shading/identities.h"
#include "shading/op_helpers.h"
#include "shading/ops.h"

namespace gi {
namespace {

// ---------------------------------------------------------------- normal maps

Vec3 map_color(const Operands& o, int i, bool invert_green) {
  const Vec3 c = o.v(i) * 2.0f - Vec3{1, 1, 1};
  return {c.x, invert_green ? -c.y : c.y, c.z};
}

void set_or_keep(const Operands& o, const ShadeState& s, Vec3 n) { o.set(0, n == Vec3{} || !is_finite(n) ? s.point.ns : n); }

// colour, strength; UV slot, green goes down, the normal is made unit first, as before true displacement (2: but for the normal). The frame
// is that of the UV map, about the interpolated normal.
void normal_map_tangent(const Operands& o, ShadeState& s) {
  const ShadingPoint& p = s.point;
  const Instance* instance = instance_of(s);
  const int original = o.imm(6);
  const auto tangent = instance ? s.resources.scene->uv_tangent(p, o.imm(3), original != 0) : std::nullopt;
  if (!tangent) return o.set(0, p.ns);
  Vec3 c = map_color(o, 1, o.imm(4) != 0);
  const float strength = o.f(2);
  // In object space, where the normal is as it was before it was turned towards the viewer.
  Vec3 smooth = s.resources.scene->smooth_object_normal(p);
  const auto from =
      original == 1 && s.resources.scene->mesh(p.mesh).normals_domain != Domain::kFace ? s.resources.scene->undisplaced(p) : std::nullopt;
  if (from)
    smooth = from->object_normal;
  else
    c = {c.x * strength, c.y * strength, lerp(1.0f, c.z, clamp01(strength))};
  const Vec3 n = o.imm(5) && !from ? normalize(smooth) : smooth, t = tangent->direction;
  Vec3 mapped = normal_to_world(s, normalize(c.x * t + c.y * tangent->side * cross(n, t) + c.z * n));
  if (p.backfacing) mapped = -mapped;
  if (from && strength != 1.0f) mapped = normalize(lerp(p.ns, mapped, std::max(strength, 0.0f)));  // from another normal than the frame's
  set_or_keep(o, s, mapped);
}

// colour, strength; object space (else world), Blender's old sign of y and z, green goes down
void normal_map_space(const Operands& o, ShadeState& s) {
  const ShadingPoint& p = s.point;
  Vec3 c = map_color(o, 1, o.imm(5) != 0);
  if (o.imm(4)) c.y = -c.y, c.z = -c.z;
  Vec3 n = o.imm(3) ? normal_to_world(s, c) : normalize(c);
  if (p.backfacing) n = -n;
  const float strength = std::max(o.f(2), 0.0f);
  set_or_keep(o, s, strength == 1.0f ? n : normalize(lerp(p.ns, n, strength)));
}

// ---------------------------------------------------------------- bump

// A Normal socket's value as it is, whatever its length: Cycles does not make it unit.
Vec3 given_normal(const Operands& o, const ShadeState& s, int i) {
  const Vec3 n = o.v(i);
  return n == Vec3{} || !is_finite(n) ? s.point.ns : n;
}

// Paths that carry no footprint step by this part of the scene's size.
constexpr float kDefaultStep = 1e-4f;

struct Edges {
  Vec3 e1, e2;
  // Of a vector over the triangle: least squares on its plane.
  Vec2 barycentrics(Vec3 d) const {
    const float a = dot(e1, e1), b = dot(e1, e2), c = dot(e2, e2), det = a * c - b * b, x = dot(d, e1), y = dot(d, e2);
    return det > 0.0f ? Vec2{(c * x - b * y) / det, (a * y - b * x) / det} : Vec2{};
  }
};

// Of the surface as it is traced.
Edges edges_of(const ShadeState& s) {
  if (s.point.strand != kNoId) {
    const Vec3 along = s.resources.scene->strand_place(s.point).along;
    return {along, cross(along, s.point.ng)};
  }
  Vec3 v[3];
  s.resources.scene->triangle_vertices(s.point.instance, s.point.triangle, v);
  return {v[1] - v[0], v[2] - v[0]};
}

// Moves the barycentrics with the position; on back faces the other way, as Cycles does.
void shift_barycentrics(ShadeState& s, Vec3 d) {
  ShadingPoint& p = s.point;
  if (!s.resources.scene || p.triangle == kNoId) return;
  const Vec2 b = edges_of(s).barycentrics(p.backfacing ? -d : d);
  p.b1 += b.x, p.b2 += b.y;
  p.shift1 += b.x, p.shift2 += b.y;
}

struct Steps {
  Vec3 dx, dy;  // one pixel over the surface
};
Steps pixel_steps(const ShadeState& s) {
  const Scene* scene = s.resources.scene;
  float step = 2.0f * s.point.footprint;  // the footprint is a radius
  if (!(step > 0.0f)) step = kDefaultStep * (scene && !scene->bounds().empty() ? length(scene->bounds().extent()) : 1.0f);
  // As Cycles turns them, for where a surface has been displaced sideways the result hangs on it.
  const Vec3 n = s.point.ng, x = normalize_or(cross(Vec3{1, 1, 1}, n), Frame::from_normal(n).x);
  return {x * step, cross(n, x) * step};
}

// The same steps where the surface was before true displacement: to the same places between the vertices.
Steps undisplaced_steps(const ShadeState& s, const Undisplaced& from, const Steps& steps) {
  const Edges edges = edges_of(s);
  const auto there = [&](Vec3 d) {
    const Vec2 b = edges.barycentrics(s.point.backfacing ? -d : d);
    return b.x * from.e1 + b.y * from.e2;
  };
  return {there(steps.dx), there(steps.dy)};
}

// filter width -> what bump_restore needs; axis. Everything until then sees the point moved along the surface: where that is displaced,
// a point that was before steps as it is now, as in Cycles.
void bump_shift(const Operands& o, ShadeState& s) {
  ShadingPoint& p = s.point;
  const float width = o.f(3);
  o.set(0, p.position), o.set(1, p.object_position), o.set(2, Vec3{p.b1, p.b2, 0.0f});
  const Steps steps = pixel_steps(s);
  const Vec3 d = (o.imm(4) ? steps.dy : steps.dx) * width;
  const Vec3 step = p.undisplaced_step > 0.0f ? d * p.undisplaced_step : d;
  p.position += step;
  const Instance* i = instance_of(s);
  p.object_position += i ? i->to_object.vector(step) : step;
  shift_barycentrics(s, d);
}

void bump_restore(const Operands& o, ShadeState& s) {
  s.point.position = o.v(0), s.point.object_position = o.v(1);
  const Vec3 b = o.v(2);
  s.point.shift1 -= s.point.b1 - b.x, s.point.shift2 -= s.point.b2 - b.y;
  s.point.b1 = b.x, s.point.b2 = b.y;
}

// heights here, along x, along y; strength, distance, filter width; normal; object space.
// [Mikkelsen 2010, "Bump mapping unparametrized surfaces on the GPU"]
void bump(const Operands& o, ShadeState& s) {
  const float here = o.f(1), along_x = o.f(2), along_y = o.f(3), strength = std::max(o.f(4), 0.0f), distance = o.f(5), width = o.f(6);
  const Vec3 given = given_normal(o, s, 7);
  Vec3 n = given;
  Steps steps = pixel_steps(s);
  if (s.point.undisplaced_step > 0.0f) steps = undisplaced_steps(s, *s.resources.scene->undisplaced(s.point), steps);
  const Instance* instance = o.imm(8) ? instance_of(s) : nullptr;
  if (instance) {
    n = normal_to_object(s, n);
    steps = {instance->to_object.vector(steps.dx), instance->to_object.vector(steps.dy)};
  }
  const Vec3 rx = cross(steps.dy, n), ry = cross(n, steps.dx);
  const float det = dot(steps.dx, rx);
  const Vec3 gradient = (along_x - here) * rx + (along_y - here) * ry;
  const Vec3 bumped = normalize(n * (width * std::abs(det)) - gradient * std::copysign(distance, distance * det));
  if (bumped == Vec3{}) return o.set(0, given);
  Vec3 r = normalize(lerp(n, bumped, strength));
  if (instance) r = normal_to_world(s, r);
  set_or_keep(o, s, r);
}

// -> what redisplace needs; as in Cycles 4.5: steps get another length, and the normal is that of the displaced surface. Everything until
// then sees the point where it was before true displacement; the normal stays so.
void undisplace(const Operands& o, ShadeState& s) {
  ShadingPoint& p = s.point;
  o.set(0, p.position), o.set(1, p.object_position), o.set(2, Vec3{p.b1, p.b2, 0.0f});
  const Instance* i = instance_of(s);
  const auto before = i ? s.resources.scene->undisplaced(p) : std::nullopt;
  if (!before) return;
  p.position = before->position, p.object_position = i->to_object.point(before->position);
  p.undisplaced_step = 1.0f;
  if (!o.imm(3)) return void(p.ns = before->normal);
  const Steps now = pixel_steps(s), then = undisplaced_steps(s, *before, now);
  p.undisplaced_step = (length(then.dx) + length(then.dy)) / (length(now.dx) + length(now.dy));
}

void redisplace(const Operands& o, ShadeState& s) {
  bump_restore(o, s);
  s.point.undisplaced_step = 0.0f;
}

// For programs of displacement: where their vertex goes.
void move_point(const Operands& o, ShadeState& s) { s.point.position += o.v(0); }

void set_normal(const Operands& o, ShadeState& s) { s.point.ns = normalize_or(o.v(0), s.point.ns); }

// height, middle, scale, normal -> offset; object space
void displacement(const Operands& o, ShadeState& s) {
  const Vec3 n = given_normal(o, s, 4);
  const float amount = (o.f(1) - o.f(2)) * o.f(3);
  const Instance* i = instance_of(s);
  o.set(0, o.imm(5) && i ? i->to_world.vector(normal_to_object(s, n) * amount) : n * amount);
}

// vector, middle, scale -> offset; UV slot, space (0 tangent, 1 object, 2 world)
void vector_displacement(const Operands& o, ShadeState& s) {
  const float middle = o.f(2);
  Vec3 d = (o.v(1) - Vec3{middle, middle, middle}) * o.f(3);
  const Instance* i = instance_of(s);
  if (!i || o.imm(5) == 2) return o.set(0, d);
  if (o.imm(5) == 0) {
    const Vec3 n = normal_to_object(s, s.point.ns);
    ShadingPoint here = s.point;  // bumps take the same tangent wherever they step
    here.b1 -= here.shift1, here.b2 -= here.shift2;
    const CornerTangent t = s.resources.scene->uv_tangent(here, o.imm(4), true).value_or(CornerTangent{Frame::from_normal(n).x, 1.0f});
    d = t.direction * d.x + n * d.y + normalize(cross(n, t.direction)) * (t.side * d.z);
  }
  o.set(0, i->to_world.vector(d));
}

// ---------------------------------------------------------------- tangents

// In the plane of the shading normal; zero where `t` says nothing.
Vec3 along_surface(const ShadeState& s, Vec3 t) { return cross(s.point.ns, normalize(cross(t, s.point.ns))); }

// UV slot, as before true displacement. Cycles turns it as a normal, not as a direction.
void tangent_uv(const Operands& o, ShadeState& s) {
  const auto tangent = instance_of(s) ? s.resources.scene->uv_tangent(s.point, o.imm(1), o.imm(2) != 0) : std::nullopt;
  o.set(0, tangent ? along_surface(s, normal_to_world(s, tangent->direction)) : Vec3{});
}

// generated coordinates; axis to turn about
void tangent_radial(const Operands& o, ShadeState& s) {
  const Vec3 c = o.v(1) - Vec3{0.5f, 0.5f, 0.5f};
  const Vec3 t = o.imm(2) == 0 ? Vec3{0, -c.z, c.y} : o.imm(2) == 1 ? Vec3{-c.z, 0, c.x} : Vec3{-c.y, c.x, 0};
  o.set(0, along_surface(s, normal_to_world(s, t)));
}

const Op kOps[] = {
    {"normal_map_tangent", "v", "vf", 4, OpKind::kContext, normal_map_tangent},
    {"normal_map_space", "v", "vf", 3, OpKind::kContext, normal_map_space},
    {"bump_shift", "vvv", "f", 1, OpKind::kShift, bump_shift},
    {"undisplace", "vvv", "", 1, OpKind::kShift, undisplace},
    {"redisplace", "", "vvv", 0, OpKind::kRestore, redisplace},
    {"move_point", "", "v", 0, OpKind::kControl, move_point},
    {"bump_restore", "", "vvv", 0, OpKind::kRestore, bump_restore},
    {"bump", "v", "ffffffv", 1, OpKind::kContext, bump, 0, nullptr, identity::bump},
    {"set_normal", "", "v", 0, OpKind::kControl, set_normal},
    {"displacement", "v", "fffv", 1, OpKind::kContext, displacement, 0, nullptr, identity::displacement},
    {"vector_displacement", "v", "vff", 2, OpKind::kContext, vector_displacement},
    {"tangent_uv", "v", "", 2, OpKind::kContext, tangent_uv},
    {"tangent_radial", "v", "v", 1, OpKind::kContext, tangent_radial},
};

}  // namespace

std::span<const Op> normal_ops() { return kOps; }

}  // namespace gi
