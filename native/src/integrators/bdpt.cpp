// Bidirectional path tracing: a subpath from the light and one from the eye, every vertex of the one joined to every vertex of the
// other, all ways to make the same path weighed against one another [Lafortune & Willems 1993; Veach 1997, ch. 10]. The vertices of the
// other are drawn from those of several light subpaths, which the weights take as so many samples [Veach 1997, §9.2.1; Popov 2015].
// Vertex connection and merging adds one more way: eye vertices are merged with light vertices nearby [Georgiev et al. 2012]; merging
// alone is progressive photon mapping.
#include <bit>

#include "integrators/integrator.h"
#include "transport/camera_path.h"
#include "transport/light_choice.h"
#include "transport/light_merge.h"

namespace gi {
namespace {

// A path of s vertices from the light and t from the eye, both ends counted.
struct Strategies {
  int s, t;  // the one that is shown alone; negative: any
  bool weighted;
  bool shows(int s_of_path) const { return s < 0 || s == s_of_path; }
  float weight(int s_of_path, int t_of_path, float w) const {
    if ((s >= 0 && s != s_of_path) || (t >= 0 && t != t_of_path)) return 0.0f;
    return weighted ? w : 1.0f;
  }
};

// The light subpaths of a tile, one for each pixel, and which of them each pixel's eye vertices may be joined to: those of its group.
// The pixels of a square of 4 x 4 are of a group each, shuffled anew for each square and pass: neighbours differ, and no pattern stays.
struct TileLight {
  static constexpr int kGroups = 16;
  LightVertices vertices;
  LightChoice choices[kGroups];
  int counts[kGroups];  // of subpaths
  uint32_t key = 0;     // of the pass

  size_t group(int x, int y) const {
    const uint32_t h = hash_combine(key, uint32_t(y / 4) << 16 | uint32_t(x / 4)), place = uint32_t(y % 4 * 4 + x % 4);
    return ((place ^ (h & 15)) * ((h >> 4) | 1) + (h >> 8)) & 15;
  }
};

struct EyeVertex {
  const ShadingPoint& point;
  const Bsdf& bsdf;
  PartialWeights weights;
  const PathState& state;
  float merged;  // the weight of merging here
};

class BdptIntegrator final : public Integrator {
 public:
  BdptIntegrator(const Parameters& p, Strategies strategies, MergeSettings merging)
      : s_{{p.integer("max_bounces"), p.integer("diffuse_bounces"), p.integer("glossy_bounces"), p.integer("transmission_bounces"),
            p.integer("transparent_bounces")},
           {p.integer("heuristic") == 0},
           {},
           p.real("connections")},
        connections_(p.integer("connections")),
        strategies_(strategies),
        merge_(merging),
        min_bounces_(p.integer("min_bounces")),
        clamp_direct_(p.real("clamp_direct")),
        clamp_indirect_(p.real("clamp_indirect")) {}

  void render_pass(const RenderContext& context, int pass, Film& film) override {
    const FilmSpec& spec = film.spec();
    if (pass == 0) film.start_splats(splat_unit(context));
    s_.footprint = {context.camera, spec.width, spec.height};
    if (merge_.is_on()) merge_.begin_pass(context, pass, film, s_);
    tile_trials_.resize(film.tiles().size());
    const auto from_light = [&](const Tile& tile) {
      if (!merge_.is_alone()) shine(context, pass, film, tile, tile_light());
    };
    const auto from_eye = [&](const CameraRay& camera, Sampler& sampler, PixelSample& result, int x, int y) {
      const TileLight& light = tile_light();
      trace(context, film, camera, light, light.group(x, y), sampler, result);
    };
    for_each_tile(context, pass, film, from_light, from_eye);
    film.end_splats(!context.cancelled);
    if (!context.cancelled) aim(pass + 1);
  }

 private:
  using Trials = std::vector<EmissionGuide::Trial>;

  // Of the thread. Asked for by a function, since only what passes the declaration of a thread's variable makes one and ends it.
  static TileLight& tile_light() {
    static thread_local TileLight light;
    return light;
  }

  // Light subpaths aim at where other ways leave most to them: at what they brought in earlier passes when they were joined to the lens,
  // caustics, and what a sky sends through windows. The weights know nothing of it: they part each path among the ways to make it as if
  // light started evenly, and any parting is right [Veach 1997, §9.2.1].
  void aim(int passes) {
    constexpr float kEven = 0.5f;  // connections have a use for all light
    constexpr size_t kMost = 1 << 19;
    for (Trials& tile : tile_trials_) {
      if (trials_.size() < kMost) trials_.insert(trials_.end(), tile.begin(), tile.end());
      tile.clear();
    }
    if (std::has_single_bit(unsigned(passes)) && trials_.size() < kMost) aim_ = EmissionGuide(trials_, kEven);
  }

  // The light subpaths of a tile.
  void shine(const RenderContext& context, int pass, Film& film, const Tile& tile, TileLight& light) {
    Trials& trials = tile_trials_[size_t(&tile - film.tiles().data())];
    const FilmSpec& spec = film.spec();
    SubpathSettings settings = s_;
    settings.guide = &aim_;
    light.key = hash_combine(context.seed, uint32_t(pass));
    light.vertices.clear();
    for (LightChoice& choice : light.choices) choice.clear();
    std::fill_n(light.counts, TileLight::kGroups, 0);
    for (int y = tile.y0; y < tile.y1; ++y) {
      for (int x = tile.x0; x < tile.x1; ++x) {
        const uint32_t pixel = uint32_t(spec.y0 + y) * uint32_t(spec.width) + uint32_t(spec.x0 + x);
        Sampler sampler = light_sampler(context, pass, spec.width * spec.height, pixel);
        const size_t first = light.vertices.count(), group = light.group(x, y);
        trace_from_light(context, settings, sampler, light.vertices);
        ++light.counts[group];
        for (size_t k = first; s_.limits.total > 0 && k < light.vertices.count(); ++k)
          if (strategies_.shows(light.vertices[k].s())) light.choices[group].add(light.vertices[k], uint32_t(k));
        const float worth = splat(context, film, sampler, light.vertices, first);
        if (worth > 0.0f) trials.push_back({light.vertices.start, worth});
      }
    }
  }

  // t = 1: what the light subpath from vertex `first` on adds to the film. Returns how much that is.
  float splat(const RenderContext& context, Film& film, Sampler& sampler, const LightVertices& vertices, size_t first) const {
    const FilmSpec& spec = film.spec();
    const int pixels = spec.width * spec.height;
    const float count = float(spec.region_width() * spec.region_height());  // light subpaths of a pass
    float worth = 0.0f;
    for (size_t k = first; k < vertices.count(); ++k) {
      const LightVertex& v = vertices[k];
      sampler.jump_to(uint32_t(k - first) + 1);
      sampler.next_2d(), sampler.next_2d();  // those the walk took
      const Vec2 u_lens = sampler.next_2d();
      Vec2 u_pixel = sampler.next_2d();
      const auto c = connect_to_lens(context, s_.limits, v, pixels, u_lens);
      if (!c) continue;
      // All light subpaths of a pass may fall on the pixel, its own eye subpath is one. [Georgiev 2012, eq. 46]
      const float others = v.weights.sum(s_.heuristic, c->pdf_area * s_.joined / count, c->pdf_reverse, s_.merged(v.point.position));
      const float weight = strategies_.weight(v.s(), 1, 1.0f / (1.0f + others)), alpha = worth_a_look(weight);
      if (!(u_pixel.x < alpha)) continue;
      u_pixel.x /= alpha;
      const Rgb value = c->value * passage_to_lens(context, s_.limits, v, c->lens) * (weight / (alpha * count));
      if (film.splat(c->lens.film, film_wraps(context.camera), clamp_contribution(value, v.is_first() ? clamp_direct_ : clamp_indirect_),
                     u_pixel))
        worth += average(value);
    }
    return worth;
  }

  void trace(const RenderContext& context, const Film& film, const CameraRay& camera, const TileLight& light, size_t group,
             Sampler& sampler, PixelSample& result) const {
    const Heuristic h = s_.heuristic;
    const float pixels = float(film.spec().width * film.spec().height);
    const float light_count = float(film.spec().region_width() * film.spec().region_height());
    Bsdf bsdf;
    CameraPath path(camera);
    PartialWeights weights;  // of the ray that leaves the vertex before
    bool may_scatter = true, meets = true;
    float travelled = 0;  // since the vertex before
    bool behind_portal = false;  // since the vertex before
    bool left_strand = false;    // at the vertex before

    const auto add = [&](Rgb radiance, int depth) {
      if (!is_black(radiance))
        result.radiance += clamp_contribution(path.throughput * radiance, depth > 1 ? clamp_indirect_ : clamp_direct_);
    };
    // s = 0: the ray meets a luminaire by itself, which light sampling (s = 1) or a light subpath might have begun at. [Georgiev 2012, eq.
    // 43]
    const auto found = [&](Rgb radiance, float pdf_direct, uint32_t emitter) {
      if (is_black(radiance)) return Rgb();
      float others = 0;
      if (path.state.depth > 0 && (!merge_.is_alone() || left_strand))
        others = h(pdf_direct) * weights.vcm +
                 h(meets ? s_.joined * pdf_emit(context, emitter, path.origin.query.position, path.ray.direction) : 0.0f) * weights.vc;
      return radiance * strategies_.weight(0, path.state.depth + 2, 1.0f / (1.0f + others));
    };

    for (uint32_t bounce = 0;; ++bounce) {
      sampler.jump_to(bounce + 1);
      const uint32_t visibility = visibility_of(path.state.kind);
      const auto hit = context.scene.intersect(path.ray, visibility);
      add(lamps_along(context, path, hit ? hit->t : kInf, visibility, found), path.state.depth);
      path.absorb(context, hit ? hit->t : kInf);
      if (!hit) {
        add(leave(context, film, path, found, result), path.state.depth);
        break;
      }

      if (!may_scatter && ends_unlit(context, path, *hit)) break;

      // Arrive: the footprint is that of a surface seen directly, for both kinds of subpath must see the same textures.
      const float segment = travelled + hit->t;
      path.travelled = length(path.ray.origin + path.ray.direction * hit->t - camera.ray.origin) - hit->t;
      const ShadingPoint point = path.arrive(context, film, camera, *hit, bsdf, result);
      const uint32_t emitter = context.lights.light_of_triangle(point.instance, point.triangle);
      const float pdf_direct = is_black(bsdf.emission) ? 0.0f : context.lights.pdf_triangle(path.origin.query, point);
      const Rgb emitted = found(bsdf.emission, pdf_direct, emitter);
      if (path.state.depth == 0) result.emission += path.throughput * bsdf.emission;
      add(emitted, path.state.depth);
      const float cos_in = abs_dot(point.ng, point.wo);
      if (!(cos_in > 0.0f)) break;
      EyeVertex here{point, bsdf, weights.arrived(h, segment, cos_in), path.state, s_.merged(point.position)};
      if (path.state.depth == 0)
        here.weights = {h(light_count / (s_.joined * lens_density(context.camera, camera.ray, segment) * pixels * cos_in)),
                        0.0f};  // [eq. 45]
      const bool on_strand = point.strand != kNoId;
      if (behind_portal || on_strand) here.weights = {};  // light does not find the way back
      if (on_strand) here.merged = 0.0f;

      const float u_light_choice = sampler.next_1d(), u_lobe = sampler.next_1d();
      const Vec2 u_light = sampler.next_2d(), u = sampler.next_2d();
      const float u_continue = sampler.next_1d(), u_joined = sampler.next_1d();
      if (may_scatter && !bsdf.is_delta() && merge_.is_on() && !on_strand) {
        result.radiance += path.throughput * merge(context, here);
        if (merge_.is_alone()) bsdf.choose(kSpecular | kTransparent, point.wo);
      }
      if (may_scatter && !bsdf.is_delta() && (!merge_.is_alone() || on_strand)) {
        add(direct_light(context, here, u_light_choice, u_light), path.state.depth + 1);
        const auto join = [&](uint32_t k, float times, float u_left) {
          add(connect(context, here, light.vertices[k], u_left) / (times * float(light.counts[group])), path.state.depth + 2);
        };
        if (path.state.depth < s_.limits.total && !merge_.is_alone())
          light.choices[group].draw(point.position, bsdf.geometric_normal(), bsdf.flags() & kTransmission, connections_, u_joined, join);
      }

      // Draw the next direction.
      const auto next = bsdf.sample(point.wo, u, u_lobe);
      if (!next || !(next->pdf_dir > 0.0f)) break;
      const bool transparent = next->flags & kTransparent;
      if (!may_scatter && !transparent) break;
      const Rgb weight = next->value / next->pdf_dir;
      path.throughput *= weight;
      if (is_black(path.throughput)) break;
      if (transparent) {
        if (!advance(path.state, next->flags, s_.limits)) break;
        travelled = segment;
        path.pass(point, bsdf, *next, hit->t);
        behind_portal |= (next->flags & kPortal) != 0;
        if (behind_portal) weights = {};
        continue;
      }

      // Follow it.
      const bool is_delta = next->flags & kSpecular;
      const float pdf_reverse = is_delta || here.weights.vc == 0.0f ? 0.0f : reverse(context, here, next->wi).pdf_dir;
      weights = here.weights.scattered(h, is_delta, abs_dot(point.ng, next->wi), next->pdf_dir, pdf_reverse, here.merged);
      meets = meets_light(context.scene, point);
      travelled = 0, behind_portal = false, left_strand = on_strand;
      may_scatter = advance(path.state, next->flags, s_.limits);
      const FilmSpec& spec = film.spec();
      const bool through_glass = spec.transparent_glass && (next->flags & kTransmission) && next->roughness <= spec.transparent_roughness;
      if (!through_glass) path.seen_from_camera = false;
      path.origin = {light_query(point, bsdf), is_delta ? kInf : next->pdf_dir};
      path.origin.query.path = path.state;
      path.ray = ray_from(point, next->wi);

      // Russian roulette.
      const float alpha = path.state.depth <= min_bounces_ ? 1.0f : std::min(1.0f, max_component(path.throughput));
      if (alpha < 1.0f) {
        if (u_continue >= alpha) break;
        path.throughput *= 1.0f / alpha;
      }
    }
  }

  // s = 1: a light chosen for this vertex.
  Rgb direct_light(const RenderContext& context, const EyeVertex& z, float u_choice, Vec2 u) const {
    const Heuristic h = s_.heuristic;
    const auto light = context.lights.sample(light_query(z.point, z.bsdf), u_choice, u);
    if (!light || is_black(light->radiance) || !(light->pdf_dir > 0.0f)) return Rgb();
    const LobeEval e = eval_for_light(z.bsdf, z.point.wo, *light);
    if (is_black(e.value)) return Rgb();
    // Against the ray that meets the luminaire by itself, and light subpaths. [Georgiev 2012, eq. 44]
    float others = !light->is_delta && light->use_mis ? h(e.pdf_dir / light->pdf_dir) : 0.0f;
    const float pdf_emitted = meets_light(context.scene, z.point) ? pdf_emit(context, light->light, z.point.position, light->wi) : 0.0f;
    if (pdf_emitted > 0.0f) {
      const float pdf_area = pdf_emitted * abs_dot(z.point.ng, light->wi) / light->pdf_dir;
      const float pdf_reverse = z.weights.vc > 0.0f ? reverse(context, z, light->wi).pdf_dir : 0.0f;
      others += h(s_.joined) * z.weights.sum(h, pdf_area, pdf_reverse, z.merged);
    }
    const float weight = strategies_.weight(1, z.state.depth + 2, 1.0f / (1.0f + others));
    return shadowed(context, z.point, *light, e.value * light->radiance * (weight / light->pdf_dir));
  }

  // s > 1, t > 1: both vertices joined. [Veach 1997, eq. 10.8]
  Rgb connect(const RenderContext& context, const EyeVertex& z, const LightVertex& y, float u) const {
    const Heuristic h = s_.heuristic;
    if (strategies_.weight(y.s(), z.state.depth + 2, 1.0f) == 0.0f) return Rgb();
    const Vec3 to = y.point.position - z.point.position;
    const float distance = length(to);
    if (!(distance > 0.0f)) return Rgb();
    const Vec3 w = to / distance;
    const float cos_z = dot(z.bsdf.geometric_normal(), w), cos_y = -dot(y.point.ng, w);
    if ((cos_z < 0.0f && !(z.bsdf.flags() & kTransmission)) || (cos_y < 0.0f && !(y.bsdf.flags() & kTransmission))) return Rgb();

    // Bounces as Blender counts them.
    const uint8_t at_z = bounce_flags(z.bsdf, z.point, w);
    BounceCount bounces = y.bounces;
    bounces.add(bounces_of(z.state));
    bounces.add(at_z);
    if (!y.is_first()) bounces.add(bounce_flags(y.bsdf, y.point, -w));
    if (!bounces.within(s_.limits) || bounces.total > y.max_bounces) return Rgb();

    // What passes: f at both ends and the geometry between, in the measure of the true normals.
    const LobeEval from_z = eval_seen_by(z.bsdf, z.point.wo, w, context.scene.instances()[y.point.instance].data->visibility);
    if (is_black(from_z.value)) return Rgb();
    const LobeEval at_y = eval_turned(context, y.point, y.bsdf, -w, unknown_state(), y.seen_by);
    if (is_black(at_y.value)) return Rgb();
    const float to_y = std::abs(cos_y) / sqr(distance),
                to_z = std::abs(cos_z) / sqr(distance);  // densities per area, for those per steradian
    const Rgb value = y.power * at_y.value * from_z.value * (to_y / abs_dot(y.point.ng, y.point.wo));

    // The weight. [Georgiev 2012, eq. 37, 40, 41]
    const float pdf_y = y.bsdf.eval(y.point.wo, -w).pdf_dir;
    const float pdf_reverse = z.weights.vc > 0.0f ? reverse(context, z, w).pdf_dir : 0.0f;
    const float others = y.weights.sum(h, from_z.pdf_dir * to_y, at_y.pdf_dir, s_.merged(y.point.position)) +
                         z.weights.sum(h, pdf_y * to_z, pdf_reverse, z.merged);
    const float weight = strategies_.weight(y.s(), z.state.depth + 2, 1.0f / (1.0f + others)), alpha = worth_a_look(weight);
    if (is_black(value) || !(u < alpha)) return Rgb();

    const Ray out = ray_from(z.point, w);
    const Vec3 start = out.origin, end = offset_point(y.point.position, y.point.ng, -w);
    const float free = length(end - start);
    PathState state = z.state;
    const bool within = advance(state, at_z, s_.limits);
    (void)within;
    return value * (weight / alpha) *
           passage(context, {start, (end - start) / free, 0.0f, free * (1.0f - 1e-4f), out.left_instance, out.left_strand},
                   visibility_of(state.kind), state, s_.limits.transparent);
  }

  // Light subpaths that came here too, all as if to the same point. [Georgiev et al. 2012, eq. 8]
  Rgb merge(const RenderContext& context, const EyeVertex& z) const {
    const Heuristic h = s_.heuristic;
    const Vec3 position = z.point.position;
    const float radius = merge_.radius() * s_.footprint(position);
    struct Merged {
      Rgb light;
      bool is_direct;
    };
    static thread_local std::vector<Merged> merged;
    static thread_local std::vector<Vec3> places;
    merged.clear(), places.clear();
    float weighed = 0.0f, all = 0.0f;
    merge_.near(position, z.point.ng, radius, [&](const MergeVertex& y, Vec3 place, Rgb power_per_area) {
      const Vec3 wi = y.wi.unpack();
      BounceCount bounces = y.bounces();
      bounces.add(bounces_of(z.state));
      if (!y.is_first) bounces.add(bounce_flags(z.bsdf, z.point, wi));
      if (!bounces.within(s_.limits) || bounces.total > y.max_bounces) return;
      const LobeEval e = eval_seen_by(z.bsdf, z.point.wo, wi, y.seen_by);
      const float cosine = abs_dot(y.normal.unpack(), wi);
      if (is_black(e.value) || !(cosine > 1e-4f)) return;
      float weight = 1.0f;
      if (!merge_.is_alone()) {  // [Georgiev 2012, eq. 37 to 39]
        const float pdf_reverse = z.weights.vc > 0.0f ? reverse(context, z, wi).pdf_dir : 0.0f;
        const float others = y.weights.vcm + h(e.pdf_dir) * y.weights.vc + z.weights.vcm + h(pdf_reverse) * z.weights.vc;
        weight = z.merged / (z.merged + others);
      }
      const Rgb light = power_per_area * e.value / cosine;
      weighed += average(light) * weight, all += average(light);
      merged.push_back({light * weight, y.is_first && z.state.depth == 0}), places.push_back(place);
    });
    // Looking down costs as much as a few connections: what other ways do better is seldom worth it, nor are few vertices, noisy as they
    // are.
    const float chance = std::min(1.0f, 4.0f * safe_divide(weighed, all)) * std::clamp(float(places.size()) / 16.0f, 0.25f, 1.0f);
    const std::vector<float>& counts = counts_in_sight(context.scene, position, z.point.ng, radius, places, chance);
    Rgb direct, indirect;
    for (size_t k = 0; k < merged.size(); ++k) (merged[k].is_direct ? direct : indirect) += merged[k].light * counts[k];
    return clamp_contribution(direct, clamp_direct_) + clamp_contribution(indirect, clamp_indirect_);
  }

  // Past its last bounce the path only looks for luminaires.
  static bool ends_unlit(const RenderContext& context, const CameraPath& path, const Hit& hit) {
    const Program& program = context.scene.material(context.scene.material_of(hit.instance, hit.triangle)).program;
    return !path.seen_from_camera && !program.has_transparency() && !program.has_emission();
  }

  // Russian roulette before the shadow ray of a connection, by its weight: little is lost where other ways do better.
  static float worth_a_look(float weight) { return std::min(1.0f, weight * 20.0f); }

  static BounceCount bounces_of(const PathState& eye) { return {eye.depth, eye.diffuse_depth, eye.glossy_depth, eye.transmission_depth}; }

  // The density with which light that comes to z from w would go on to where z was seen from.
  static LobeEval reverse(const RenderContext& context, const EyeVertex& z, Vec3 w) {
    return eval_turned(context, z.point, z.bsdf, w, unknown_state());
  }

  // Of light subpaths; those of lamps that throw no shadow are not followed.
  static float pdf_emit(const RenderContext& context, uint32_t emitter, Vec3 position, Vec3 wi) {
    if (emitter == kNoId) return 0.0f;
    const LampData* lamp = context.lights.lamp(emitter);
    return lamp && !lamp->cast_shadow ? 0.0f : context.lights.pdf_emit(emitter, position, wi);
  }

  template <class Found>
  static Rgb lamps_along(const RenderContext& context, const CameraPath& path, float t_surface, uint32_t visibility, const Found& found) {
    Rgb sum;
    if (!context.lights.has_findable_lamps()) return sum;
    Ray ray = path.ray;
    ray.t_max = t_surface;
    for (auto hit = context.lights.intersect_lamp(ray, visibility); hit; hit = context.lights.intersect_lamp(ray, visibility, &*hit)) {
      const LightEval e = context.lights.eval_lamp(path.origin.query, ray, *hit);
      sum += found(e.radiance * passed_by_absorbers(context, ray, hit->t, path.state), e.pdf_dir, hit->lamp);
    }
    return sum;
  }

  // Suns and the world.
  template <class Found>
  static Rgb leave(const RenderContext& context, const Film& film, const CameraPath& path, const Found& found, PixelSample& sample) {
    if (path.seen_from_camera && film.spec().transparent) {
      sample.alpha -= average(path.throughput);
      return Rgb();
    }
    path.record_world(context, sample);
    const uint32_t visibility = visibility_of(path.state.kind);
    Rgb sum;
    for (uint32_t sun = 0; sun < context.lights.sun_count(); ++sun) {
      const LightEval e = context.lights.eval_sun(sun, path.origin.query, path.ray.direction, visibility);
      sum += found(e.radiance, e.pdf_dir, context.lights.light_of_sun(sun));
    }
    if (context.scene.data().world.visibility & visibility) {
      const Rgb radiance = context.scene.world_radiance(path.ray.direction, path.state);
      if (!is_black(radiance))
        sum += found(radiance, context.lights.pdf_world(path.origin.query, path.ray.direction), context.lights.world_light());
    }
    if (path.seen_from_camera) sample.environment += path.throughput * sum;
    return sum;
  }

  SubpathSettings s_;
  int connections_;
  Strategies strategies_;
  LightMerge merge_;
  int min_bounces_;
  float clamp_direct_, clamp_indirect_;
  EmissionGuide aim_;
  Trials trials_;                    // of light subpaths, by what the lens saw of them
  std::vector<Trials> tile_trials_;  // of the pass
};

using Kind = Parameter::Kind;

// Those of both, and others.
std::vector<Parameter> with(std::vector<Parameter> others) {
  std::vector<Parameter> all{
      {"heuristic",
       "Heuristic",
       Kind::kChoice,
       0,
       0,
       1,
       "How the ways to make a path are weighed against one another: the picture is the same, its noise is not",
       "",
       {{"POWER", "Power", "By the squares of their densities"}, {"BALANCE", "Balance", "By their densities"}}},
      {"min_bounces", "Minimum Bounces", Kind::kInt, 0, 0, 1024, "Bounces before roulette begins"},
      {"max_bounces", "Total", Kind::kInt, 12, 0, 1024, "Bounces of any kind"},
      {"diffuse_bounces", "Diffuse", Kind::kInt, 4, 0, 1024, "Diffuse reflections"},
      {"glossy_bounces", "Glossy", Kind::kInt, 4, 0, 1024, "Glossy and mirror reflections"},
      {"transmission_bounces", "Transmission", Kind::kInt, 12, 0, 1024, "Refractions"},
      {"transparent_bounces", "Transparent", Kind::kInt, 8, 0, 1024, "Transparent surfaces passed by one ray"},
      {"clamp_direct", "Clamp Direct", Kind::kFloat, 0, 0, 1e9, "Largest radiance that one sample may add directly; 0 is off. Loses light"},
      {"clamp_indirect", "Clamp Indirect", Kind::kFloat, 0, 0, 1e9,
       "Largest radiance that one sample may add after a bounce; 0 is off. Loses light"},
      {"connections", "Connections", Kind::kInt, 3, 1, 64,
       "Vertices from the light that each vertex from the eye is joined to, of all those of 16 light paths: more make a pass less noisy, "
       "and slower"},
  };
  all.insert(all.end(), std::make_move_iterator(others.begin()), std::make_move_iterator(others.end()));
  return all;
}

}  // namespace

const Descriptor& bdpt_descriptor() {
  static const Descriptor descriptor{
      "bdpt",
      "Bidirectional Path Tracing",
      "Paths from the eye and from the lights, joined in every way: for light that comes around corners and through glass; unbiased. "
      "Light Path nodes see diffuse rays where light arrives from a lamp's side",
      with({
          {"only_s", "Only s", Kind::kInt, -1, -1, 1024, "Shows only paths with this many vertices from the light; -1: all"},
          {"only_t", "Only t", Kind::kInt, -1, -1, 1024,
           "Shows only paths with this many vertices from the eye, the lens among them; -1: all"},
          {"weighted", "Weighted", Kind::kBool, 1, 0, 1, "Off: every way counts in full, to look at one of them alone"},
      }),
      [](const Parameters& p) -> std::unique_ptr<Integrator> {
        return std::make_unique<BdptIntegrator>(p, Strategies{p.integer("only_s"), p.integer("only_t"), p.on("weighted")}, MergeSettings{});
      },
      /*bakes=*/false,
      /*kept_version=*/0,
      /*kept_by_place=*/false,
      kCarriesAbsorption | kCarriesPortals | kCarriesStrands};
  return descriptor;
}

const Descriptor& vcm_descriptor() {
  static const Descriptor descriptor{
      "vcm",
      "Vertex Connection and Merging",
      "Bidirectional path tracing and progressive photon mapping as one: also caustics that are seen in mirrors and through glass. A "
      "little "
      "blurred at first, right in the end",
      with({
          {"terms",
           "Terms",
           Kind::kChoice,
           0,
           0,
           2,
           "Ways that are taken to make a path",
           "",
           {{"ALL", "All", "Vertices are connected and merged"},
            {"CONNECT", "Connection", "Bidirectional path tracing alone"},
            {"MERGE", "Merging",
             "Progressive photon mapping alone; lights come to diffuse and glossy surfaces as photons only, which ray portals stop"}}},
          {"photons", "Photons", Kind::kInt, 1000000, 1, 1e9,
           "Most light paths that are sent out in each pass for merging, no more than pixels: more make caustics seen in glass smooth "
           "sooner"},
          {"radius", "Radius", Kind::kFloat, 3, 0.1, 1000,
           "Within which vertices are merged in the first pass: caustics are blurred by as much at first, and noisier where it is small",
           "px"},
          {"alpha", "Alpha", Kind::kFloat, 0.75, 0.05, 1, "How much of a disc's photons the next pass keeps: less is sharper and noisier"},
      }),
      [](const Parameters& p) -> std::unique_ptr<Integrator> {
        const int terms = p.integer("terms");
        const MergeSettings merging{terms == 1 ? 0 : p.integer("photons"), p.real("radius"), p.number("alpha"), terms == 2};
        return std::make_unique<BdptIntegrator>(p, Strategies{-1, -1, true}, merging);
      },
      /*bakes=*/false,
      /*kept_version=*/0,
      /*kept_by_place=*/false,
      kCarriesAbsorption | kCarriesPortals | kCarriesStrands};
  return descriptor;
}

}  // namespace gi
