// What a LightSet holds: lamps, emissive triangles and the world, with what it takes to choose among them.
// Leaves out the set's public face (lights.cpp) and light as it leaves luminaires (emission.cpp).
#pragma once
#include <algorithm>
#include <atomic>
#include <thread>

#include "core/distribution.h"
#include "core/sampler.h"
#include "lights/emission.h"
#include "lights/lamp_bvh.h"
#include "lights/light_tree.h"
#include "lights/triangle_light.h"
#include "lights/triangle_power.h"
#include "lights/world_light.h"

namespace gi {

inline PathState seen_by_light(PathState path, float distance) {
  path.kind = 0, path.depth += 1, path.ray_length = distance;
  return path;
}

struct LightSet::Impl {
  const Scene& scene;
  std::vector<Lamp> lamps;
  std::vector<TriangleLight> triangles;
  std::vector<std::vector<uint32_t>> triangle_light;  // by instance: light of each triangle, kNoId for none; empty: no light
  WorldLight world;
  LampBvh bvh;
  LightTree tree;
  std::vector<uint32_t> tree_light, tree_slot;  // light ↔ index in the tree
  std::vector<uint32_t> suns;
  SceneBall ball;
  Distribution1D emitters;  // lights by power

  uint32_t first_triangle() const { return uint32_t(lamps.size()); }
  uint32_t world_light() const { return first_triangle() + uint32_t(triangles.size()); }
  uint32_t count() const { return world_light() + (world.emits() ? 1u : 0u); }

  Impl(const Scene& s, int threads) : scene(s), ball(s.bounds()) {
    add_lamps();
    std::vector<LightBounds> bounds;
    for (uint32_t i = 0; i < lamps.size(); ++i) {
      if (std::holds_alternative<SunLight>(lamps[i].shape)) continue;
      LightBounds b;
      std::visit([&](const auto& shape) { bound(shape, b); }, lamps[i].shape);
      b.power *= lamps[i].strength;
      bounds.push_back(b), tree_light.push_back(i);
    }
    add_triangles(threads, bounds);
    tree_slot.assign(world_light(), kNoId);
    for (uint32_t k = 0; k < tree_light.size(); ++k) tree_slot[tree_light[k]] = k;
    tree = LightTree(bounds);
    world = WorldLight(scene, threads);
    weigh_emitters(bounds);
  }

  void weigh_emitters(const std::vector<LightBounds>& bounds) {
    std::vector<float> power;
    for (const Lamp& lamp : lamps)
      power.push_back(lamp.strength * std::visit([&](const auto& s) { return gi::emitted_power(s, ball); }, lamp.shape));
    for (uint32_t k = 0; k < triangles.size(); ++k)
      power.push_back(kPi * bounds[tree_slot[first_triangle() + k]].power * float(triangles[k].front + triangles[k].back));
    if (world.emits()) power.push_back(4.0f * world.irradiance() * ball.cross_section());
    emitters = Distribution1D(power);
  }

  void add_lamps() {
    std::vector<LampBvh::Item> items;
    for (const LampData& data : scene.data().lamps) {
      if (!is_finite(data.color) || !(magnitude(data.color) > 0.0f)) continue;
      Lamp lamp{make_shape(data), &data, data.matrix.inverse(), false};
      const float weight = weight_of(lamp.shape);
      if (!(weight > 0.0f) || !std::isfinite(weight)) continue;
      std::visit(
          [&](const auto& shape) {
            using S = std::decay_t<decltype(shape)>;
            if constexpr (std::is_same_v<S, SunLight>) {
              lamp.findable = shape.has_shape();
              suns.push_back(uint32_t(lamps.size()));
            } else {
              if constexpr (std::is_same_v<S, SpotLight>)
                lamp.findable = shape.point.has_shape();
              else
                lamp.findable = shape.has_shape();
              LightBounds b;
              bound(shape, b);
              if (lamp.findable) items.push_back({b.box(), uint32_t(lamps.size())});
            }
          },
          lamp.shape);
      lamp.strength = magnitude(data.color) * program_strength(lamp);
      lamps.push_back(lamp);
    }
    bvh = LampBvh(std::move(items));
  }

  void add_triangles(int threads, std::vector<LightBounds>& bounds) {
    const std::vector<MeasuredTriangle> found = measure_triangles(scene, threads);
    triangle_light.resize(scene.instances().size());
    triangles.reserve(found.size());
    for (const MeasuredTriangle& m : found) {
      auto& table = triangle_light[m.light.instance];
      if (table.empty()) table.assign(scene.mesh(scene.instances()[m.light.instance].mesh).triangle_count(), kNoId);
      const uint32_t index = first_triangle() + uint32_t(triangles.size());
      table[m.light.triangle] = index;
      tree_light.push_back(index);
      triangles.push_back(m.light);
      LightBounds b;
      Bounds box;
      for (Vec3 p : {m.light.a, m.light.a + m.light.ab, m.light.a + m.light.ac}) box.add(p);
      b.lo = box.lo, b.hi = box.hi;
      b.axis = m.light.front ? m.light.normal() : -m.light.normal();
      b.power = m.radiance * m.light.area();
      b.two_sided = m.light.front && m.light.back;
      bounds.push_back(b);
    }
  }

  // ------------------------------------------------------------ choice

  // The share of all samples that goes to lights without a place: by irradiance, but never less than a sixth of either
  // kind, since neither knows what is in the way.
  static float local_share(float local, float far) {
    if (!(local > 0.0f)) return 0.0f;
    if (!(far > 0.0f)) return 1.0f;
    constexpr float kLeast = 1.0f / 6.0f;
    return kLeast + (1.0f - 2.0f * kLeast) * (local / (local + far));
  }
  float sun_weight(uint32_t k, const LightQuery& query) const {
    const Lamp& lamp = lamps[suns[k]];
    const SunLight& sun = std::get<SunLight>(lamp.shape);
    float c = length_squared(query.normal) > 0.0f ? dot(query.normal, sun.direction) : 1.0f;
    if (query.transmission) c = std::abs(c);
    return sun.irradiance() * lamp.strength * std::max(c, 0.02f);
  }
  float world_weight(const LightQuery& query) const { return world.emits() ? world.irradiance() * query.world_share : 0.0f; }
  float far_weight(const LightQuery& query) const {
    float sum = world_weight(query);
    for (uint32_t k = 0; k < suns.size(); ++k) sum += sun_weight(k, query);
    return sum;
  }

  std::optional<LightTree::Pick> pick(const LightQuery& query, float u) const {
    const LightTree::Importance root = tree.root(query);
    const float far = far_weight(query), local = local_share(root.sum(), far);
    if (u < local) {
      const auto p = tree.sample(query, root, std::min(u / local, kOneMinusEpsilon));
      if (!p) return std::nullopt;
      return LightTree::Pick{tree_light[p->light], p->probability * local};
    }
    if (!(far > 0.0f)) return std::nullopt;
    float x = (u - local) / (1.0f - local) * far;
    uint32_t light = kNoId;
    float weight = 0;
    for (uint32_t k = 0; k < suns.size(); ++k) {
      light = suns[k], weight = sun_weight(k, query);
      if (x < weight) return LightTree::Pick{light, (1.0f - local) * weight / far};
      x -= weight;
    }
    if (world_weight(query) > 0.0f) light = world_light(), weight = world_weight(query);
    return LightTree::Pick{light, (1.0f - local) * weight / far};
  }

  float pick_probability(const LightQuery& query, uint32_t light) const {
    const LightTree::Importance root = tree.root(query);
    const float far = far_weight(query), local = local_share(root.sum(), far);
    if (light < tree_slot.size() && tree_slot[light] != kNoId) {
      return local > 0.0f ? local * tree.probability(query, root, tree_slot[light]) : 0.0f;
    }
    if (!(far > 0.0f)) return 0.0f;
    if (light == world_light()) return (1.0f - local) * world_weight(query) / far;
    const auto k = std::find(suns.begin(), suns.end(), light);
    return k == suns.end() ? 0.0f : (1.0f - local) * sun_weight(uint32_t(k - suns.begin()), query) / far;
  }

  // ------------------------------------------------------------ sampling

  // What a lamp's node program makes of its light towards −wi; 1 without a program.
  Rgb lamp_program(const Lamp& lamp, Vec3 origin, Vec3 wi, float distance, const PathState& path) const {
    if (lamp.data->program < 0) return Rgb(1.0f);
    if (const auto& constant = scene.material(lamp.data->program).program.constant_emission()) return *constant;
    ShadingPoint p;
    p.wo = -wi;
    p.position = std::isfinite(distance) ? origin + wi * distance : wi;
    p.object_position = std::isfinite(distance) ? lamp.to_lamp.point(p.position) : lamp.to_lamp.vector(wi);
    p.ng = p.ns = p.wo;
    p.lamp_to_world = &lamp.data->matrix;
    if (const auto* area = std::get_if<AreaLight>(&lamp.shape)) {
      p.ng = p.ns = area->normal;
      const Vec2 c = area->coordinates(p.position);
      p.b1 = c.y + 0.5f, p.b2 = -c.x - c.y;  // Cycles' order, for the Parametric output
    } else if (const PointLight* ball = sphere_of(lamp.shape)) {
      p.ng = p.ns = normalize_or(p.position - ball->center, p.wo);
    }
    p.path = path;
    return scene.run_emission(lamp.data->program, p);
  }

  // Only for choosing among lamps: never 0, since the samples may miss what the program shows.
  float program_strength(const Lamp& lamp) const {
    if (lamp.data->program < 0) return 1.0f;
    constexpr int kPoints = 32;
    float sum = 0;
    for (int k = 0; k < kPoints; ++k) {
      const Vec2 u{(float(k) + 0.5f) / kPoints, to_unit_float(reverse_bits(uint32_t(k)))};
      const auto [place, out] = std::visit([&](const auto& s) { return gi::emit(s, u); }, lamp.shape);
      const bool is_sun = std::holds_alternative<SunLight>(lamp.shape);
      const float m = magnitude(lamp_program(lamp, place + out, -out, is_sun ? kInf : 1.0f, seen_by_light({}, 1.0f)));
      sum += std::isfinite(m) ? m : 0.0f;
    }
    return std::max(sum / kPoints, 1e-3f);
  }

  std::optional<LightSample> sample_lamp(uint32_t light, const LightQuery& query, Vec2 u) const {
    const Lamp& lamp = lamps[light];
    const LampData& data = *lamp.data;
    if (query.path.depth > data.max_bounces) return std::nullopt;
    const auto shape = std::visit([&](const auto& s) { return s.sample(query, u); }, lamp.shape);
    if (!shape || !(shape->scale > 0.0f)) return std::nullopt;
    const LightSample s = lamp_sample(lamp, light, query, *shape);
    if (!is_finite(s.radiance) || !std::isfinite(s.pdf_dir)) return std::nullopt;  // on top of a point
    return s;
  }
  LightSample lamp_sample(const Lamp& lamp, uint32_t light, const LightQuery& query, const ShapeSample& shape) const {
    const LampData& data = *lamp.data;
    LightSample s;
    s.wi = shape.wi, s.distance = shape.distance, s.pdf_dir = shape.pdf_dir, s.is_delta = shape.is_delta, s.light = light;
    s.radiance = data.color * shape.scale * lamp_program(lamp, query.position, s.wi, s.distance, seen_by_light(query.path, s.distance));
    s.cast_shadow = data.cast_shadow, s.use_mis = data.use_mis && lamp.findable;
    s.visibility = data.visibility;
    return s;
  }

  std::optional<LightSample> sample_triangle_light(uint32_t light, const LightQuery& query, Vec2 u) const {
    const TriangleLight& triangle = triangles[light - first_triangle()];
    const auto t = triangle.sample(query.position, u);
    if (!t || !(t->pdf_dir > 0.0f)) return std::nullopt;
    return triangle_sample(light, query, *t);
  }
  // Towards `wo`, as it is seen from so far away.
  Rgb triangle_emission(const TriangleLight& t, Vec2 barycentrics, Vec3 wo, const PathState& path, float distance) const {
    if (const auto& constant = scene.material(int(t.material)).program.constant_emission()) return *constant;
    ShadingPoint p = scene.surface_point(t.instance, t.triangle, barycentrics.x, barycentrics.y, wo, seen_by_light(path, distance));
    return scene.emission(p);
  }
  LightSample triangle_sample(uint32_t light, const LightQuery& query, const TriangleSample& t) const {
    const TriangleLight& triangle = triangles[light - first_triangle()];
    LightSample s;
    s.wi = t.wi, s.distance = t.distance, s.pdf_dir = t.pdf_dir, s.light = light;
    s.radiance = triangle_emission(triangle, {t.b1, t.b2}, -t.wi, query.path, t.distance);
    s.visibility = scene.instances()[triangle.instance].data->visibility;
    return s;
  }

  std::optional<LightSample> sample_world(const LightQuery& query, Vec2 u) const {
    const WorldData& data = scene.data().world;
    if (query.path.depth > data.max_bounces) return std::nullopt;
    const auto [wi, pdf] = world.sample(query, u);
    if (!(pdf > 0.0f)) return std::nullopt;
    return world_sample(query, wi, pdf);
  }
  LightSample world_sample(const LightQuery& query, Vec3 wi, float pdf) const {
    LightSample s;
    s.wi = wi, s.pdf_dir = pdf, s.light = world_light();
    s.radiance = scene.world_radiance(wi, seen_by_light(query.path, kInf));
    s.visibility = scene.data().world.visibility;
    return s;
  }

  std::optional<LightSample> sample_light(uint32_t light, const LightQuery& query, Vec2 u) const {
    if (light < first_triangle()) return sample_lamp(light, query, u);
    return light < world_light() ? sample_triangle_light(light, query, u) : sample_world(query, u);
  }

  // ------------------------------------------------------------ emission (emission.cpp)

  std::optional<EmittedRay> emit_lamp(uint32_t light, Vec2 u_place, Vec2 u_direction) const;
  std::optional<EmittedRay> emit_triangle(uint32_t light, Vec2 u_place, Vec2 u_direction) const;
  EmittedRay emit_world(Vec2 u_place, Vec2 u_direction) const;
  std::optional<LightSample> arriving_lamp(const EmittedRay& emitted, const LightQuery& query, bool with_pdf) const;
  std::optional<LightSample> arriving_triangle(const EmittedRay& emitted, const LightQuery& query, bool with_pdf) const;

  std::optional<float> meet(uint32_t index, const Ray& ray, uint32_t visibility) const {
    const Lamp& lamp = lamps[index];
    if (!(lamp.data->visibility & visibility) || !(lamp.data->use_mis || (visibility & kRayCamera))) return std::nullopt;
    return std::visit(
        [&](const auto& s) -> std::optional<float> {
          if constexpr (std::is_same_v<std::decay_t<decltype(s)>, SunLight>)
            return std::nullopt;
          else
            return s.intersect(ray);
        },
        lamp.shape);
  }
};

}  // namespace gi
