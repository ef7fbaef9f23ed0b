// Ops that look around the shading point by rays: Ambient Occlusion, Bevel, Raycast. Their random numbers come from the point itself,
// so that a program gives the same for the same ray. On the world and on lamps they find nothing.
#include <bit>

#include "core/warp.h"
#include "scene/object_space.h"
#include "scene/scene.h"
#include "shading/op_helpers.h"
#include "shading/ops.h"

namespace gi {
namespace {

// ---------------------------------------------------------------- random numbers of a point

uint32_t mixed(uint32_t h, uint32_t more) {  // one round of PCG's output function
  h = (h ^ more) * 747796405u + 2891336453u;
  h = ((h >> ((h >> 28) + 4u)) ^ h) * 277803737u;
  return (h >> 22) ^ h;
}

uint32_t hash_of(const ShadingPoint& p) {
  uint32_t h = p.instance;
  for (const float x : {p.position.x, p.position.y, p.position.z, p.wo.x, p.wo.y, p.wo.z}) h = mixed(h, std::bit_cast<uint32_t>(x));
  return h;
}

// Points of the plane's best additive sequence [Roberts 2018, "The unreasonable effectiveness of quasirandom sequences"], moved by
// random numbers of the point.
class PointSamples {
 public:
  PointSamples(const ShadingPoint& p, uint32_t purpose) {
    const uint32_t h = mixed(hash_of(p), purpose);
    start_ = {float(h >> 8) * 0x1p-24f, float(mixed(h, 1u) >> 8) * 0x1p-24f};
  }
  Vec2 operator[](int i) const {
    const float x = start_.x + 0.7548776662f * float(i), y = start_.y + 0.5698402910f * float(i);
    return {x - std::floor(x), y - std::floor(y)};
  }

 private:
  Vec2 start_;
};

constexpr int kMostRays = 128;
// Rays begin a little further on, so that they do not meet the surface that they leave.
constexpr float kStep = 2e-5f;
float first_step(const ShadingPoint& p) {
  return kStep * std::max({std::abs(p.position.x), std::abs(p.position.y), std::abs(p.position.z), 0.05f});
}

// Null where there is nothing to trace: on the world, and while surfaces are displaced.
const Scene* scene_of(const ShadeState& s) { return instance_of(s) && s.resources.scene->traceable() ? s.resources.scene : nullptr; }

// ---------------------------------------------------------------- ambient occlusion

// -> part that is not occluded; distance (0: any), normal; rays, towards the inside, by the object itself alone
void ambient_occlusion(const Operands& o, ShadeState& s) {
  const Scene* scene = scene_of(s);
  const float distance = o.f(1);
  const int rays = std::min(o.imm(3), kMostRays);
  o.set(0, 1.0f);
  if (!scene || !(distance > 0.0f) || rays < 1 || (o.imm(5) && s.point.strand != kNoId)) return;  // strands do not see themselves
  const Vec3 n = normalize_or(o.v(2), s.point.ns);
  const Frame frame = Frame::from_normal(o.imm(4) ? -n : n);
  const PointSamples samples(s.point, 1);
  int free = 0;
  for (int i = 0; i < rays; ++i) {
    const Ray ray{s.point.position, frame.to_world(sample_cosine_hemisphere(samples[i])), first_step(s.point), distance, s.point.instance,
                  s.point.strand};
    free += !(o.imm(5) ? scene->intersect_instance(ray, s.point.instance).has_value() : scene->occluded(ray));
  }
  o.set(0, float(free) / float(rays));
}

// ---------------------------------------------------------------- bevel

// Density of points by their distance r: falls as (R − r)³, over the disc of radius R.
float cubic_density(float radius, float r) {
  const float left = radius - r;
  return left > 0.0f ? 10.0f * left * left * left / (kPi * radius * radius * radius * radius * radius) : 0.0f;
}

// The r / R below which a part u of that density lies: 10 x² − 20 x³ + 15 x⁴ − 4 x⁵ = u, by Newton's method.
float cubic_radius(float u) {
  float x = 0.25f;
  for (int i = 0; i < 10; ++i) {
    const float x2 = x * x, f = x2 * (10.0f - 20.0f * x + 15.0f * x2 - 4.0f * x2 * x) - u;
    const float slope = 20.0f * x * (1.0f - x) * (1.0f - x) * (1.0f - x);
    if (std::abs(f) < 1e-6f || slope == 0.0f) break;
    x = clamp01(x - f / slope);
  }
  return x;
}

// The axes of a frame, one of which is drawn to look along; the last one half of the time.
struct ProbeAxes {
  Vec3 across, along, axis;
  float pick[3];  // of each
  Vec2 u;
};
ProbeAxes probe_axes(Vec3 ng, Vec2 u) {
  const Frame f = Frame::from_normal(ng);
  if (u.x < 0.5f) return {f.x, f.y, f.z, {0.25f, 0.25f, 0.5f}, {u.x * 2.0f, u.y}};
  if (u.x < 0.75f) return {f.z, f.y, f.x, {0.5f, 0.25f, 0.25f}, {(u.x - 0.5f) * 4.0f, u.y}};
  return {f.x, f.z, f.y, {0.25f, 0.5f, 0.25f}, {(u.x - 0.75f) * 4.0f, u.y}};
}

// Of a hit as the mesh has it, not turned to the viewer.
struct OutwardNormals {
  Vec3 geometric, smooth;
};
OutwardNormals outward(const Scene& scene, const Hit& hit, Vec3 direction) {
  const ShadingPoint p = scene.surface_point(hit.instance, hit.triangle, hit.b1, hit.b2, -direction, {});
  return p.backfacing ? OutwardNormals{-p.ng, -p.ns} : OutwardNormals{p.ng, p.ns};
}

// The mean normal of the object's surface within `radius`, found by looking at it along three axes, weighed by the power heuristic.
// [King et al. 2013, "BSSRDF importance sampling"]
Vec3 mean_normal(const Scene& scene, const ShadingPoint& p, float radius, int rays) {
  const PointSamples samples(p, 2);
  Vec3 sum;
  for (int i = 0; i < rays; ++i) {
    const ProbeAxes a = probe_axes(p.ng, samples[i]);
    const float r = radius * cubic_radius(a.u.y), height = safe_sqrt(radius * radius - r * r), phi = 2.0f * kPi * a.u.x;
    const Vec3 start = p.position + a.axis * height + (a.across * std::cos(phi) + a.along * std::sin(phi)) * r;
    Ray ray{start, -a.axis, 0.0f, 2.0f * height};
    const float drawn = cubic_density(radius, r);
    for (int hits = 0; hits < 8 && drawn > 0.0f; ++hits) {
      const auto hit = scene.intersect_instance(ray, p.instance);
      if (!hit) break;
      ray.t_min = hit->t + first_step(p);
      const OutwardNormals n = outward(scene, *hit, ray.direction);
      const float by[3] = {a.pick[0] * std::abs(dot(a.across, n.geometric)), a.pick[1] * std::abs(dot(a.along, n.geometric)),
                           a.pick[2] * std::abs(dot(a.axis, n.geometric))};
      const float weight = by[2] / (sqr(by[0]) + sqr(by[1]) + sqr(by[2]));
      sum += n.smooth * (weight * cubic_density(radius, length(start + ray.direction * hit->t - p.position)) / drawn);
    }
  }
  const Vec3 n = normalize(sum);
  return n == Vec3{} ? p.ns : p.backfacing ? -n : n;
}

// Blender's cut-off: surfaces that are seen blurred are not worth the rays.
constexpr float kSharpEnough = 8.0f;

// radius, normal; rays
void bevel(const Operands& o, ShadeState& s) {
  const Scene* scene = scene_of(s);
  const float radius = o.f(1);
  const int rays = std::min(o.imm(3), kMostRays);
  Vec3 n = s.point.ns;
  if (scene && s.point.strand == kNoId && radius > 0.0f && rays > 0 && s.point.path.least_pdf >= kSharpEnough)
    n = mean_normal(*scene, s.point, radius, rays);
  o.set(0, normalize_or(o.v(2) + (n - s.point.ns), s.point.ns));
}

// ---------------------------------------------------------------- raycast

std::optional<Hit> cast(const ShadeState& s, Vec3 from, Vec3 direction, float reach, bool only_local, uint32_t seen) {
  const Scene* scene = scene_of(s);
  if (!scene || !(reach > 0.0f) || !is_finite(from) || !is_finite(direction) || direction == Vec3{}) return {};
  const float start = from == s.point.position ? first_step(s.point) / length(direction) : 0.0f;
  const Ray ray{from, direction, start, reach};
  return only_local ? scene->intersect_instance(ray, s.point.instance) : scene->intersect(ray, seen);
}

constexpr uint32_t kAnyone = 0xffffffffu;

// -> is hit, is hit on the object itself, distance, position, normal; position, direction, length; only local
void raycast(const Operands& o, ShadeState& s) {
  const Vec3 from = o.v(5), direction = o.v(6);
  const float reach = o.f(7);
  const auto hit = cast(s, from, direction, reach, o.imm(8) != 0, kAnyone);
  o.set(0, hit ? 1.0f : 0.0f), o.set(1, hit && hit->instance == s.point.instance ? 1.0f : 0.0f);
  o.set(2, hit ? hit->t : reach), o.set(3, hit ? from + direction * hit->t : Vec3{});
  o.set(4, hit ? scene_of(s)->shading_point({from, direction}, *hit, {}).ns : Vec3{});
}

// -> an attribute where the ray ends: vector, mean, alpha; as raycast; attribute slot
void raycast_attribute(const Operands& o, ShadeState& s) {
  const Vec3 direction = o.v(4);
  float a[4] = {0, 0, 0, 0};
  int components = 0;
  if (const auto hit = cast(s, o.v(3), direction, o.f(5), o.imm(6) != 0, kAnyone)) {
    const Scene& scene = *scene_of(s);
    components = scene.attribute(scene.shading_point({o.v(3), direction}, *hit, {}), o.imm(7), a);
  }
  if (components == 1) a[1] = a[2] = a[0];
  o.set(0, Vec3{a[0], a[1], a[2]});
  o.set(1, components == 2 ? a[0] : (a[0] + a[1] + a[2]) * (1.0f / 3.0f));
  o.set(2, a[3]);
}

constexpr OpKind kContext = OpKind::kContext;
const Op kOps[] = {
    {"ambient_occlusion", "f", "fv", 3, kContext, ambient_occlusion},
    {"bevel", "v", "fv", 1, kContext, bevel},
    {"raycast", "fffvv", "vvf", 1, kContext, raycast},
    {"raycast_attribute", "vff", "vvf", 2, kContext, raycast_attribute},
};

}  // namespace

std::span<const Op> ray_ops() { return kOps; }

}  // namespace gi
