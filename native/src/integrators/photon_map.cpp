// Photon mapping in two passes [Jensen 1996; Jensen 2001, ch. 9]: photons are sent out once and stored; eye paths then find direct light by
// sampling, follow what is specular, read caustics from their own map at diffuse surfaces, and gather all other light from the surfaces
// that they see there, where it is known from the photons.
#include "transport/photon_map.h"
#include <chrono>

#include "integrators/integrator.h"
#include "transport/diffuse_end.h"

namespace gi {
namespace {

// Irradiance at every few photons, looked up by the nearest. [Christensen 1999, "Faster photon map global illumination"]
class IrradianceMap {
 public:
  IrradianceMap() = default;
  IrradianceMap(const PhotonMap& map, size_t count, float radius, const RenderContext& context) : radius_(radius) {
    constexpr size_t kEvery = 4;
    std::vector<Vec3> positions;
    for (size_t k = 0; k < map.size(); k += kEvery) {
      records_.push_back({map.normal(k), Rgb()});
      positions.push_back(map.position(k));
    }
    constexpr size_t kBatch = 256;
    context.pool.for_each(int((records_.size() + kBatch - 1) / kBatch), context.cancelled, [&](int b) {
      for (size_t k = size_t(b) * kBatch; k < std::min((size_t(b) + 1) * kBatch, records_.size()); ++k)
        records_[k].irradiance = map.irradiance(positions[k], records_[k].normal, radius_, count);
    });
    tree_ = PointTree(positions, context.pool);
    std::vector<Record> in_order;
    for (const uint32_t i : tree_.order()) in_order.push_back(records_[i]);
    records_ = std::move(in_order);
  }

  // Power per square metre on the side of `normal`.
  Rgb at(Vec3 position, Vec3 normal) const {
    constexpr float kSlope = 0.9f, kThickness = 0.5f;
    float best = sqr(radius_);
    uint32_t nearest = kNoId;
    tree_.within(position, best, [&](uint32_t k, float d2) {
      if (dot(records_[k].normal, normal) < kSlope || sqr(dot(tree_.point(k) - position, normal)) > sqr(kThickness) * d2) return;
      if (d2 < best || k < nearest) best = d2, nearest = k;
    });
    return nearest == kNoId ? Rgb() : records_[nearest].irradiance;
  }
  size_t memory_bytes() const { return records_.size() * sizeof(Record) + tree_.memory_bytes(); }

 private:
  struct Record {
    Vec3 normal;
    Rgb irradiance;
  };

  std::vector<Record> records_;
  PointTree tree_;
  float radius_ = 0;
};

// A radius that `count` photons lie well within, where they are of the usual density.
float typical_spread(const PhotonMap& map, size_t count) {
  const size_t probes = std::min<size_t>(256, map.size());
  std::vector<float> found;
  for (size_t i = 0; i < probes; ++i) found.push_back(map.spread(map.position(i * map.size() / probes), count));
  if (found.empty()) return 0.0f;
  const auto most = found.begin() + ptrdiff_t(found.size() * 3 / 4);
  std::nth_element(found.begin(), most, found.end());
  return 2.0f * *most;
}

class PhotonMapIntegrator final : public Integrator {
 public:
  explicit PhotonMapIntegrator(const Parameters& p)
      : global_photons_(p.integer("global_photons")),
        caustic_photons_(p.integer("caustic_photons")),
        global_count_(size_t(p.integer("global_count"))),
        caustic_count_(size_t(p.integer("caustic_count"))),
        radius_(p.real("radius")) {
    s_.limits = {p.integer("max_bounces"), p.integer("diffuse_bounces"), p.integer("glossy_bounces"), p.integer("transmission_bounces"),
                 p.integer("transparent_bounces")};
    s_.without = no_caustics(p);
    s_.gathers = s_.direct_gathered = s_.caustics_known = p.on("gather");
  }

  void render_pass(const RenderContext& context, int pass, Film& film) override {
    if (!built_) build(context, film);
    if (context.cancelled) return;
    const bool shows_photons = film.wants("Photons") || film.wants("Photon Density") || film.wants("Photon Radius");
    for_each_pixel(context, pass, film, [&](const CameraRay& camera, Sampler& sampler, PixelSample& result) {
      trace_to_diffuse(
          context, film, s_, camera, sampler, result,
          [&](const ShadingPoint& point, const Bsdf& bsdf) {
            if (shows_photons && point.path.depth == 0) show_photons(point, result);
            return caustics(point, bsdf);
          },
          [&](const ShadingPoint& point, const Bsdf& bsdf, bool gathered) {
            if (shows_photons && point.path.depth == 0) show_photons(point, result);
            const Rgb global = light_of(point, bsdf, [&](Vec3 normal) {
              return s_.gathers ? irradiance_.at(point.position, normal)
                                : global_.irradiance(point.position, normal, reach_, global_count_);
            });
            return KnownLight{gathered ? Rgb() : caustics(point, bsdf), global};
          });
    });
  }

 private:
  void build(const RenderContext& context, const Film& film) {
    const FilmSpec& spec = film.spec();
    const auto start = std::chrono::steady_clock::now();
    SubpathSettings light;
    light.limits = s_.limits, light.without = s_.without, light.footprint = {context.camera, spec.width, spec.height};
    const uint8_t all = s_.gathers ? kDirectPhoton | kCausticPhoton | kGlobalPhoton : uint8_t(kGlobalPhoton);
    const EmissionGuide to_all = learn_emission(context, light, global_photons_, all, find_seen(context, film, s_.limits, s_.gathers));
    light.guide = &to_all;
    global_ = PhotonMap(trace_photons(context, light, 0, global_photons_, all), global_photons_, context.pool);
    light.only_by_mirrors = true;
    const EmissionGuide to_casters =
        learn_emission(context, light, caustic_photons_, kCausticPhoton, find_seen(context, film, s_.limits, false));
    light.guide = &to_casters;
    caustic_ = PhotonMap(trace_photons(context, light, 0, caustic_photons_, kCausticPhoton), caustic_photons_, context.pool);
    if (context.cancelled) return;
    reach_ = typical_spread(global_, global_count_);
    if (s_.gathers) irradiance_ = IrradianceMap(global_, global_count_, reach_, context);
    built_ = !context.cancelled;
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
    context.log.set("global photons", double(global_.size()));
    context.log.set("caustic photons", double(caustic_.size()));
    context.log.set("photon seconds", took.count());
    context.log.set("photon bytes", double(global_.memory_bytes() + caustic_.memory_bytes()));
    context.log.say(std::to_string(global_.size()) + " global and " + std::to_string(caustic_.size()) + " caustic photons, " +
                    std::to_string((global_.memory_bytes() + caustic_.memory_bytes() + irradiance_.memory_bytes()) >> 20) + " MiB");
  }

  // Those that lie in the pixel, and what estimates near here come from.
  void show_photons(const ShadingPoint& point, PixelSample& result) const {
    result.photons =
        float(global_.count(point.position, point.ng, point.footprint) + caustic_.count(point.position, point.ng, point.footprint));
    result.photon_radius = global_.spread(point.position, global_count_);
    result.photon_density = float(std::min(global_count_, global_.size())) / (kPi * sqr(result.photon_radius));
  }

  Rgb caustics(const ShadingPoint& point, const Bsdf& bsdf) const {
    return caustic_.radiance(point, bsdf, radius_ * point.footprint, caustic_count_);
  }

  // What the diffuse lobes make of irradiance(normal of the side), as if it came from everywhere alike.
  template <class Irradiance>
  static Rgb light_of(const ShadingPoint& point, const Bsdf& bsdf, const Irradiance& irradiance) {
    Rgb radiance;
    for (const uint8_t side : {kReflection, kTransmission}) {
      const Rgb albedo = bsdf.diffuse_albedo(point.wo, side);
      if (!is_black(albedo)) radiance += albedo * irradiance(side == kReflection ? point.ng : -point.ng) * kInvPi;
    }
    return radiance;
  }

  int global_photons_, caustic_photons_;
  size_t global_count_, caustic_count_;
  float radius_;
  DiffuseEndSettings s_;
  PhotonMap global_, caustic_;
  IrradianceMap irradiance_;
  float reach_ = 0;
  bool built_ = false;
};

}  // namespace

const Descriptor& photon_map_descriptor() {
  using Kind = Parameter::Kind;
  static const Descriptor descriptor{
      "photon_map",
      "Photon Mapping",
      "Photons are sent out and stored once; the picture reads caustics from them and gathers all other indirect light. Free of most "
      "noise, "
      "blurred by the photons' distance",
      {
          {"global_photons", "Global Photons", Kind::kInt, 200000, 1, 1e9, "Sent out for light that diffuse surfaces throw on each other"},
          {"caustic_photons", "Caustic Photons", Kind::kInt, 1000000, 1, 1e9, "Sent out for what mirrors, glass and glossy surfaces throw"},
          {"global_count", "Global Neighbours", Kind::kInt, 100, 2, 10000, "Photons by which the light of a place is estimated"},
          {"caustic_count", "Caustic Neighbours", Kind::kInt, 60, 2, 10000, "Photons by which a caustic is estimated"},
          {"radius", "Caustic Radius", Kind::kFloat, 12, 0.1, 1000, "Farther away photons are not looked for, in pixels"},
          {"gather", "Final Gather", Kind::kBool, 1, 0, 1,
           "Looks for indirect light in all directions, and reads photons where it comes from; off: reads them where the eye looks"},
          {"max_bounces", "Total", Kind::kInt, 12, 0, 1024, "Bounces of any kind"},
          {"diffuse_bounces", "Diffuse", Kind::kInt, 4, 0, 1024, "Diffuse reflections"},
          {"glossy_bounces", "Glossy", Kind::kInt, 4, 0, 1024, "Glossy and mirror reflections"},
          {"transmission_bounces", "Transmission", Kind::kInt, 12, 0, 1024, "Refractions"},
          {"transparent_bounces", "Transparent", Kind::kInt, 8, 0, 1024, "Transparent surfaces passed by one ray"},
          {"caustics_reflective", "Reflective Caustics", Kind::kBool, 1, 0, 1, "Mirrors and glossy surfaces seen by diffuse ones"},
          {"caustics_refractive", "Refractive Caustics", Kind::kBool, 1, 0, 1, "Glass seen by diffuse surfaces"},
      },
      [](const Parameters& p) -> std::unique_ptr<Integrator> { return std::make_unique<PhotonMapIntegrator>(p); }};
  return descriptor;
}

}  // namespace gi
