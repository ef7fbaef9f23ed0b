// Ops that read the shading point, its object, its path and the camera: Geometry, Texture Coordinate, Object Info, Light Path,
// attributes, transforms between spaces. Leaves out normals (ops_normal).
#include "scene/camera.h"
#include "scene/object_space.h"
#include "scene/scene.h"
#include "shading/lobes/fresnel.h"
#include "shading/op_helpers.h"
#include "shading/ops.h"

namespace gi {
namespace {

// ---------------------------------------------------------------- the point

void position(const Operands& o, ShadeState& s) { o.set(0, s.point.position); }
void object_position(const Operands& o, ShadeState& s) { o.set(0, s.point.object_position); }
void normal(const Operands& o, ShadeState& s) { o.set(0, s.point.ns); }
void true_normal(const Operands& o, ShadeState& s) { o.set(0, s.point.ng); }
void incoming(const Operands& o, ShadeState& s) { o.set(0, s.point.wo); }
void backfacing(const Operands& o, ShadeState& s) { o.set(0, s.point.backfacing ? 1.0f : 0.0f); }
void parametric(const Operands& o, ShadeState& s) { o.set(0, Vec3{1.0f - s.point.b1 - s.point.b2, s.point.b1, 0.0f}); }
void object_normal(const Operands& o, ShadeState& s) { o.set(0, normal_to_object(s, s.point.ns)); }
void object_incoming(const Operands& o, ShadeState& s) { o.set(0, normal_to_object(s, s.point.wo)); }
void generated(const Operands& o, ShadeState& s) { o.set(0, generated_coordinates(s, o.imm(1))); }

// of any place in world space; deformation is left out
void generated_at(const Operands& o, ShadeState& s) {
  const Instance* i = instance_of(s);
  o.set(0, i ? in_texture_space(s.resources.scene->mesh(i->mesh), i->to_object.point(o.v(1))) : o.v(1));
}

void reflection(const Operands& o, ShadeState& s) {
  const ShadingPoint& p = s.point;
  o.set(0, p.instance == kNoId ? p.wo : reflect(p.wo, p.ns));
}

// Width of a pixel on the surface as it is seen: the mean along two directions, which are Cycles', for it hangs on them.
float pixel_across(const ShadingPoint& p) {
  const Vec3 x = normalize_or(cross(Vec3{1, 1, 1}, p.ng), Frame::from_normal(p.ng).x), y = cross(p.ng, x);
  const auto seen = [&](Vec3 d) { return length(d - p.wo * dot(d, p.wo)); };
  return p.footprint * (seen(x) + seen(y));
}

// size; in pixels
void wireframe(const Operands& o, ShadeState& s) {
  const ShadingPoint& p = s.point;
  o.set(0, 0.0f);
  if (!s.resources.scene || p.instance == kNoId || p.strand != kNoId) return;
  Vec3 v[3];
  s.resources.scene->triangle_vertices(p.instance, p.triangle, v);
  // A wire is split between the two faces of its edge.
  const float width = 0.5f * o.f(1) * (o.imm(2) ? pixel_across(p) : 1.0f);
  for (int i = 0; i < 3; ++i) {
    const Vec3 edge = v[(i + 1) % 3] - v[i];
    if (length_squared(cross(edge, p.position - v[i])) < length_squared(edge) * sqr(width)) o.set(0, 1.0f);
  }
}

// ---------------------------------------------------------------- attributes

// slot -> vector, mean, alpha. A single number fills the vector; of two numbers the first is the mean.
void attribute(const Operands& o, ShadeState& s) {
  float a[4] = {0, 0, 0, 1};
  const int components = s.resources.scene ? s.resources.scene->attribute(s.point, o.imm(3), a) : 0;
  if (components == 1) a[1] = a[2] = a[0];
  o.set(0, Vec3{a[0], a[1], a[2]});
  o.set(1, components == 2 ? a[0] : (a[0] + a[1] + a[2]) * (1.0f / 3.0f));
  o.set(2, a[3]);
}
// 1 where the object has the attribute.
void has_attribute(const Operands& o, ShadeState& s) {
  float a[4];
  o.set(0, s.resources.scene && s.resources.scene->attribute(s.point, o.imm(1), a) ? 1.0f : 0.0f);
}
void uv(const Operands& o, ShadeState& s) {
  float a[4] = {};
  if (s.resources.scene) s.resources.scene->attribute(s.point, o.imm(1), a);
  o.set(0, Vec3{a[0], a[1], 0.0f});
}

// ---------------------------------------------------------------- the object

void object_location(const Operands& o, ShadeState& s) {
  const Instance* i = instance_of(s);
  o.set(0, i ? i->to_world.translation() : s.point.position);
}
void object_color(const Operands& o, ShadeState& s) {
  const Instance* i = instance_of(s);
  o.set(0, i ? Vec3{i->data->color[0], i->data->color[1], i->data->color[2]} : Vec3{});
  o.set(1, i ? i->data->color[3] : 0.0f);
}
void object_index(const Operands& o, ShadeState& s) {
  const Instance* i = instance_of(s);
  o.set(0, i ? float(i->data->object_index) : 0.0f);
}
void object_random(const Operands& o, ShadeState& s) {
  const Instance* i = instance_of(s);
  o.set(0, i ? i->data->random : 0.0f);
}

// ---------------------------------------------------------------- the path

void ray_kind(const Operands& o, ShadeState& s) { o.set(0, s.point.path.kind & uint32_t(o.imm(1)) ? 1.0f : 0.0f); }
void ray_length(const Operands& o, ShadeState& s) { o.set(0, s.point.path.ray_length); }

void ray_depth(const Operands& o, ShadeState& s) {
  const PathState& p = s.point.path;
  const int depths[] = {p.depth, p.diffuse_depth, p.glossy_depth, p.transparent_depth, p.transmission_depth, p.portal_depth};
  const unsigned which = unsigned(o.imm(1));
  o.set(0, which < std::size(depths) ? float(depths[which]) : 0.0f);
}

// strength, smooth -> quadratic, linear, constant. Light from infinitely far away has no falloff to undo.
void light_falloff(const Operands& o, ShadeState& s) {
  const float strength = o.f(3), smooth = o.f(4), t = s.point.path.ray_length;
  const bool distant = !(t < 1e30f);
  const float softened = smooth > 0.0f && !distant ? strength * t * t / (smooth + t * t) : strength;
  o.set(0, softened), o.set(1, distant ? strength : softened * t), o.set(2, distant ? strength : softened * t * t);
}

void fresnel(const Operands& o, ShadeState& s) {
  const float ior = std::max(o.f(1), 1e-5f);
  o.set(0, fresnel_dielectric(dot(s.point.wo, o.v(2)), s.point.backfacing ? 1.0f / ior : ior));
}

// blend, normal -> Fresnel, facing
void layer_weight(const Operands& o, ShadeState& s) {
  const float blend = o.f(2), c = dot(s.point.wo, o.v(3)), ior = std::max(1.0f - blend, 1e-5f);
  o.set(0, fresnel_dielectric(c, s.point.backfacing ? ior : 1.0f / ior));
  float facing = std::abs(c);
  if (blend != 0.5f) {
    const float b = clamp_to(blend, 0.0f, 1.0f - 1e-5f);
    facing = std::pow(facing, b < 0.5f ? 2.0f * b : 0.5f / (1.0f - b));
  }
  o.set(1, 1.0f - facing);
}

// ---------------------------------------------------------------- the camera

// Blender's nodes have the camera look along +Z.
Vec3 flip(Vec3 v) { return {v.x, v.y, -v.z}; }

Vec3 camera_point(const ShadeState& s) {
  const Camera* camera = s.resources.camera;
  if (!camera) return flip(s.point.position);
  const bool direction = s.point.instance == kNoId;  // the world: as seen from where the camera stands
  return flip(camera->to_world.inverse().point(direction ? s.point.position + camera->to_world.translation() : s.point.position));
}

void camera_coordinates(const Operands& o, ShadeState& s) { o.set(0, camera_point(s)); }

// -> view vector, depth along the axis, distance
void camera_data(const Operands& o, ShadeState& s) {
  const Vec3 p = s.resources.camera ? flip(s.resources.camera->to_world.inverse().point(s.point.position)) : flip(s.point.position);
  o.set(0, normalize(p)), o.set(1, p.z), o.set(2, length(p));
}

// The frame: (0, 0) at the lower left, (1, 1) at the upper right.
void window(const Operands& o, ShadeState& s) {
  const Camera* camera = s.resources.camera;
  if (!camera) return o.set(0, Vec3{});
  Vec3 p = camera_point(s);
  float x = p.x, y = p.y, left = camera->left, right = camera->right, bottom = camera->bottom, top = camera->top;
  if (camera->kind == Camera::Kind::kPerspective) {
    x = safe_divide(p.x, p.z), y = safe_divide(p.y, p.z);
  } else if (camera->kind == Camera::Kind::kPanoramic) {
    p = normalize(p);
    x = std::atan2(p.x, p.z), y = std::asin(clamp_to(p.y, -1.0f, 1.0f));
    left = camera->longitude[0], right = camera->longitude[1], bottom = camera->latitude[0], top = camera->latitude[1];
  }
  o.set(0, Vec3{safe_divide(x - left, right - left), safe_divide(y - bottom, top - bottom), 0.0f});
}

// ---------------------------------------------------------------- spaces

// A point by another object's matrix, given by its rows: Texture Coordinate's Object.
void to_space(const Operands& o, ShadeState& s) {
  const Vec3 p = s.point.position;
  o.set(0, Vec3{dot(o.v(1), p), dot(o.v(2), p), dot(o.v(3), p)} + o.v(4));
}

enum TransformKind { kVector, kPoint, kNormal };
enum Space { kWorldSpace, kObjectSpace, kCameraSpace };

Vec3 transformed(const Affine& to, const Affine& from, Vec3 v, int kind) {
  if (kind == kPoint) return to.point(v);
  return kind == kVector ? to.vector(v) : normalize(from.transposed_vector(v));
}

// kind, from, to; by way of the world
void vector_transform(const Operands& o, ShadeState& s) {
  Vec3 v = o.v(1);
  const int kind = o.imm(2), from = o.imm(3), to = o.imm(4);
  const Instance* instance = instance_of(s);
  Affine camera = s.resources.camera ? s.resources.camera->to_world : Affine{};
  for (auto& row : camera.m) row[2] = -row[2];
  if (from == to) return o.set(0, v);
  if (from == kObjectSpace && instance) v = transformed(instance->to_world, instance->to_object, v, kind);
  if (from == kCameraSpace) v = transformed(camera, camera.inverse(), v, kind);
  if (to == kObjectSpace && instance) v = transformed(instance->to_object, instance->to_world, v, kind);
  if (to == kCameraSpace) v = transformed(camera.inverse(), camera, v, kind);
  o.set(0, v);
}

constexpr OpKind kContext = OpKind::kContext;
const Op kOps[] = {
    {"position", "v", "", 0, kContext, position},
    {"object_position", "v", "", 0, kContext, object_position},
    {"normal", "v", "", 0, kContext, normal},
    {"true_normal", "v", "", 0, kContext, true_normal},
    {"incoming", "v", "", 0, kContext, incoming},
    {"backfacing", "f", "", 0, kContext, backfacing},
    {"parametric", "v", "", 0, kContext, parametric},
    {"object_normal", "v", "", 0, kContext, object_normal},
    {"object_incoming", "v", "", 0, kContext, object_incoming},
    {"generated", "v", "", 1, kContext, generated},
    {"generated_at", "v", "v", 0, kContext, generated_at},
    {"reflection", "v", "", 0, kContext, reflection},
    {"wireframe", "f", "f", 1, kContext, wireframe},
    {"attribute", "vff", "", 1, kContext, attribute},
    {"has_attribute", "f", "", 1, kContext, has_attribute},
    {"uv", "v", "", 1, kContext, uv},
    {"object_location", "v", "", 0, kContext, object_location},
    {"object_color", "vf", "", 0, kContext, object_color},
    {"object_index", "f", "", 0, kContext, object_index},
    {"object_random", "f", "", 0, kContext, object_random},
    {"ray_kind", "f", "", 1, kContext, ray_kind},
    {"ray_length", "f", "", 0, kContext, ray_length},
    {"ray_depth", "f", "", 1, kContext, ray_depth},
    {"light_falloff", "fff", "ff", 0, kContext, light_falloff},
    {"fresnel", "f", "fv", 0, kContext, fresnel},
    {"layer_weight", "ff", "fv", 0, kContext, layer_weight},
    {"camera_coordinates", "v", "", 0, kContext, camera_coordinates},
    {"camera_data", "vff", "", 0, kContext, camera_data},
    {"window", "v", "", 0, kContext, window},
    {"to_space", "v", "vvvv", 0, kContext, to_space},
    {"vector_transform", "v", "v", 3, kContext, vector_transform},
};

}  // namespace

std::span<const Op> input_ops() { return kOps; }

}  // namespace gi
