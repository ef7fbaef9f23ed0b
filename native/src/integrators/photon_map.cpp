// Photon mapping in two passes [Jensen 1996; Jensen 2001, ch. 9]: photons are sent out once and stored; eye paths then find direct light by
// sampling, follow what is specular, read caustics from their own map at diffuse surfaces, and gather all other light from the surfaces
// that they see there, where it is known from the photons; or find it in an irradiance cache, whose records have gathered so.
#include "transport/photon_map.h"

#include "core/check.h"
#include "integrators/integrator.h"
#include "transport/diffuse_end.h"
#include "transport/irradiance_records.h"
#include "transport/photon_irradiance.h"

namespace gi {
namespace {

// The share of a time limit that each map gets.
constexpr double kTimeShare = 0.15;

// A radius that `count` photons lie well within, at most of the places.
float typical_spread(const PhotonMap& map, const std::vector<PathEnd>& places, size_t count) {
  const size_t probes = std::min<size_t>(256, places.size());
  std::vector<float> found;
  for (size_t i = 0; i < probes; ++i) found.push_back(map.spread(places[i * places.size() / probes].position, count));
  if (found.empty()) return 0.0f;
  const auto most = found.begin() + ptrdiff_t(found.size() * 3 / 4);
  std::nth_element(found.begin(), most, found.end());
  return 2.0f * *most;
}

constexpr int kBatches = 16;  // of photons

// A map, and how it came to be.
struct Stock {
  PhotonMap map;
  double paths = 0;  // sent for it
  size_t count = 0;  // neighbours
  float reach = 0;  // farther away they are not looked for
  int batches = 0;  // sent of those that are wanted at least
  LargeVector<Photon> loose = {};  // of all batches, where the map does not have them all yet
  double seconds_traced = 0, seconds_settled = 0;

  bool is_complete() const { return batches >= kBatches && loose.empty(); }
  bool is_begun() const { return batches > 0; }
  void settle(const RenderContext& context) {
    const double start = context.seconds();
    map = PhotonMap(loose, paths, context.pool);
    LargeVector<Photon>().swap(loose);
    seconds_settled += context.seconds() - start;
  }
  KeptTable keep() const;
};

// Photons of an earlier render.
Stock photons_of(const Kept& kept, const std::string& name);

// How light between diffuse surfaces is found.
enum class GlobalLight { kGathered, kCached, kPhotons, kNone };

class PhotonMapIntegrator final : public Integrator {
 public:
  explicit PhotonMapIntegrator(const Parameters& p)
      : global_photons_(p.integer("global_photons")),
        caustic_photons_(p.integer("caustic_photons")),
        global_count_(size_t(p.integer("global_count"))),
        caustic_count_(size_t(p.integer("caustic_count"))),
        filter_(PhotonFilter(p.integer("caustic_filter"))),
        radius_(p.real("radius")),
        goal_(0.01 * p.number("photon_error")),
        most_bytes_(size_t(p.integer("photon_memory")) << 20),
        way_(GlobalLight(p.integer("global_light"))),
        s_(settings(p, gathers())),
        records_({p.real("record_error"), p.integer("record_samples"), 1, kRefinement, kSmoothing, kSpacing, s_.limits}) {}

  void render_pass(const RenderContext& context, int pass, Film& film) override {
    if (!built_) build(context, film);
    if (context.cancelled) return;
    if (caches_) {
      records_.before_pass(context, film, pass, [&](const CameraRay& from, const PathState& state, Sampler& sampler) -> GatheredRay {
        EndingPath ending{CameraPath(from), true};
        ending.path.state = state;
        ending.path.state.without = s_.without;
        ending.path.seen_from_camera = false;
        PixelSample found;
        trace(context, film, from, ending, sampler, found);
        return {found.radiance, ending.first_distance};
      });
      if (context.cancelled) return;
    }
    for_each_pixel(context, pass, film, [&](const CameraRay& camera, Sampler& sampler, PixelSample& result) {
      EndingPath ending{CameraPath(camera)};
      trace(context, film, camera, ending, sampler, result);
    });
  }
  void finish_pass(const RenderContext& context, int pass) override {
    if (caches_) records_.after_pass(context, pass);
  }

  void take_over(const Kept& kept) override {
    Kept records = kept;
    caustic_ = photons_of(kept, kCaustic);
    if (way_ != GlobalLight::kNone) global_ = photons_of(kept, kGlobal);
    records.erase(kGlobal), records.erase(kCaustic);
    records_.take_over(records);
  }
  Kept keep() const override {
    if (!built_) return {};
    Kept kept = records_.keep();
    kept[kCaustic] = caustic_.keep();
    if (way_ != GlobalLight::kNone) kept[kGlobal] = global_.keep();
    return kept;
  }
  // Photons go on where they were stopped. What was read from fewer than all of them is worked out anew.
  void continue_from(Integrator& other) override {
    auto& earlier = static_cast<PhotonMapIntegrator&>(other);
    global_ = std::move(earlier.global_), caustic_ = std::move(earlier.caustic_);
    continues_ = true;
    if (!has_all_photons()) return;
    irradiance_ = std::move(earlier.irradiance_);
    records_.continue_from(earlier.records_);
  }

 private:
  static constexpr const char *kGlobal = "global", *kCaustic = "caustic";
  static constexpr float kRefinement = 0.25f;  // of the cache, which is the same as that of irradiance caching
  static constexpr float kSmoothing = 3.0f;  // standard deviations, the same
  static constexpr IrradianceSpacing kSpacing{1.5f, 40.0f, 0.0f, 0.0f};

  static constexpr int kRecordsAcross = 192;  // paths across the picture whose ends know irradiance

  static DiffuseEndSettings settings(const Parameters& p, bool gathers) {
    DiffuseEndSettings s;
    s.limits = {p.integer("max_bounces"), p.integer("diffuse_bounces"), p.integer("glossy_bounces"), p.integer("transmission_bounces"),
                p.integer("transparent_bounces")};
    s.without = no_caustics(p);
    s.direct_gathered = s.caustics_known = gathers;
    return s;
  }
  bool gathers() const { return way_ == GlobalLight::kGathered || way_ == GlobalLight::kCached; }

  void trace(const RenderContext& context, const Film& film, const CameraRay& camera, EndingPath& ending, Sampler& sampler,
             PixelSample& result) const {
    const bool shows_photons = film.wants("Photons") || film.wants("Photon Density") || film.wants("Photon Radius");
    trace_to_diffuse(
        context, film, s_, camera, ending, sampler, result,
        [&](const ShadingPoint& point, const Bsdf& bsdf) { return caustics(point, bsdf); },
        [&](const ShadingPoint& point, const Bsdf& bsdf, bool gathered) -> std::optional<KnownLight> {
          if (shows_photons && point.path.depth == 0) show_photons(point, result);
          const auto global = global_light(context.scene, point, bsdf, ending, result);
          if (!global) return {};
          return KnownLight{gathered ? Rgb() : caustics(point, bsdf), *global};
        });
  }

  // Of the diffuse lobes; nothing where it has to be gathered.
  std::optional<Rgb> global_light(const Scene& scene, const ShadingPoint& point, const Bsdf& bsdf, const EndingPath& ending,
                                  PixelSample& result) const {
    if (ending.gathered)
      return light_of(point, bsdf,
                      [&](Vec3 normal) { return irradiance_.at(global_.map, scene, point.position, normal, ending.last_distance); });
    switch (way_) {
      case GlobalLight::kGathered: return {};
      case GlobalLight::kCached: return caches_ ? records_.read(point, bsdf, result) : std::optional<Rgb>();
      case GlobalLight::kPhotons:
        return light_of(point, bsdf, [&](Vec3 normal) {
          return std::optional(global_.map.irradiance(point.position, normal, global_.reach, global_.count, point.path, &scene));
        });
      case GlobalLight::kNone: break;
    }
    return Rgb();
  }

  bool has_all_photons() const { return caustic_.is_complete() && (way_ == GlobalLight::kNone || global_.is_complete()); }

  void build(const RenderContext& context, const Film& film) {
    const double start = context.seconds();
    // A first look at what another view has photons of: at once, with what there is.
    const bool has_global = way_ != GlobalLight::kNone;
    const bool glances = continues_ && context.time_limit > 0.0 && caustic_.is_begun() && (!has_global || global_.is_begun());
    // Few records would be worked out in that time, and slowly; one ray for each pixel is quicker.
    caches_ = way_ == GlobalLight::kCached && (!glances || records_.takes_over());
    if (glances) {
      if (has_global) glance(context, film, gathers(), global_count_, global_);
      glance(context, film, false, caustic_count_, caustic_);
      irradiance_.look_up_by(global_.count, global_.reach);
    } else {
      const auto seen_global = find_ends(context, film, s_.limits, gathers(), kLooksAcross),
                 seen_caustic = find_ends(context, film, s_.limits, false, kLooksAcross);
      const FilmSpec& spec = film.spec();
      SubpathSettings light;
      light.limits = s_.limits, light.without = s_.without, light.footprint = {context.camera, spec.width, spec.height},
      light.weighs = false;
      const uint8_t all = gathers() ? kAllPhotons : kGlobalPhoton;
      if (has_global) send(context, light, kGlobal, global_photons_, global_count_, all, seen_global, global_);
      light.only_by_mirrors = true;
      send(context, light, kCaustic, caustic_photons_, caustic_count_, kCausticPhoton, seen_caustic, caustic_);
    }
    if (context.cancelled) return;
    const double traced = context.seconds();
    context.log.stage("irradiance by photons");
    if (gathers() && !glances)
      irradiance_.cover(find_ends(context, film, s_.limits, true, kRecordsAcross), global_.map, global_.count, global_.reach, context,
                        kTimeShare);
    context.log.stage("");
    built_ = !context.cancelled;
    const size_t bytes = global_.map.memory_bytes() + caustic_.map.memory_bytes();
    context.log.set("global photons", double(global_.map.size()));
    context.log.set("caustic photons", double(caustic_.map.size()));
    context.log.set("photon seconds", traced - start);
    context.log.set("photon tracing seconds", global_.seconds_traced + caustic_.seconds_traced);
    context.log.set("photon tree seconds", global_.seconds_settled + caustic_.seconds_settled);
    context.log.set("photon bytes", double(bytes));
    context.log.say(std::to_string(global_.map.size()) + " global and " + std::to_string(caustic_.map.size()) + " caustic photons, " +
                    std::to_string((bytes + irradiance_.memory_bytes()) >> 20) + " MiB");
  }

  void glance(const RenderContext& context, const Film& film, bool gathered, size_t count, Stock& stock) const {
    if (stock.map.size() == 0 && !stock.loose.empty()) stock.settle(context);
    if (stock.count == 0) come_to_neighbours(stock, find_ends(context, film, s_.limits, gathered, kLooksAcross), count);
  }

  // Sends light paths that aim at what is seen: `paths` of them, and as many again until the error is as wished. Goes on with what is in
  // `stock`; where it is stopped, all that was sent stays there.
  void send(const RenderContext& context, SubpathSettings light, const std::string& name, int paths, size_t count, uint8_t classes,
            const std::vector<PathEnd>& seen, Stock& stock) const {
    context.log.stage(name + " photons");
    std::optional<EmissionGuide> guide;
    const double began = context.seconds();
    // False if it was stopped: then nothing has been added. Asked once, for the answer may be another a moment later.
    const auto trace = [&](int batch, int size) {
      if (!guide) guide = learn_emission(context, light, paths, classes, seen);
      light.guide = &*guide;
      const double start = context.seconds();
      const size_t before = stock.loose.size();
      trace_photons(context, light, batch, size, classes, stock.loose);
      if (before == 0) stock.loose.reserve(size_t(1.02 * kBatches * double(stock.loose.size())));  // about as many as there will be
      if (context.cancelled) return stock.loose.resize(before), false;
      stock.seconds_traced += context.seconds() - start;
      return true;
    };
    // Where light is gloss and more of it diffuse, caustic photons have any part of the power; those of a file are as they were.
    const auto settle = [&] {
      stock.settle(context);
      if (!guide || classes != kCausticPhoton) return;
      stock.loose = stock.map.equalised(hash_combine(context.seed, uint32_t(stock.paths)));
      stock.settle(context);
    };
    const bool was_complete = stock.is_complete();
    if (stock.loose.empty() && !was_complete) stock.loose = stock.map.photons();
    const int batch = (paths + kBatches - 1) / kBatches;
    while (stock.batches < kBatches && !(stock.batches > 0 && context.has_had(kTimeShare, began))) {
      if (!trace(stock.batches, batch)) return;
      stock.paths = double(++stock.batches) * batch;
    }
    if (!was_complete) settle();
    if (stock.batches < kBatches)
      context.log.say(name + " photons: time for " + std::to_string(stock.batches * batch) + " of " + std::to_string(paths) +
                      " light paths");
    while (!context.cancelled) {
      const PhotonError error = come_to_neighbours(stock, seen, count);
      if (goal_ <= 0.0) return;
      const char* reason = stock.map.size() == 0                                                                       ? "there are none"
                           : error.total() <= goal_                                                                    ? "as wished"
                           : 2 * stock.map.memory_bytes() > most_bytes_                                                ? "memory is used up"
                           : context.time_limit > 0.0 && 3.0 * (context.seconds() - began) > 0.25 * context.time_limit ? "time is used up"
                           : stock.paths > 5e8 ? "there are too many"
                                               : nullptr;
      const std::string state = name + " photons: error " + percent(error.total()) + " (noise " + percent(error.noise) + ", blur " +
                                percent(error.blur) + ") after " + std::to_string(int64_t(stock.paths)) + " light paths";
      context.log.stage(state);
      if (reason) {
        context.log.say(state + ", " + std::to_string(stock.count) + " neighbours: " + reason);
        context.log.set(name + " photon error", error.total());
        return;
      }
      stock.loose = stock.map.photons();
      if (!trace(1, int(stock.paths))) return stock.loose.clear();  // those of before are in the map
      stock.paths *= 2.0;
      settle();
    }
  }

  // Sets how many neighbours are looked for, and how far away: `count`, or as many as the noise that is wished asks for.
  PhotonError come_to_neighbours(Stock& stock, const std::vector<PathEnd>& seen, size_t count) const {
    constexpr size_t kFewest = 10, kMost = 5000;
    stock.count = count, stock.reach = typical_spread(stock.map, seen, count);
    if (goal_ <= 0.0) return {};
    const PathState eye = gathers() ? gathering() : PathState();
    const double noise = stock.map.error(seen, stock.reach, count, eye).noise, wished = goal_ * std::sqrt(0.5);
    stock.count = std::clamp(size_t(double(count) * sqr(noise / wished)), kFewest, kMost);
    stock.reach = typical_spread(stock.map, seen, stock.count);
    return stock.map.error(seen, stock.reach, stock.count, eye);
  }

  static std::string percent(double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.1f %%", 100.0 * x);
    return text;
  }

  // Those that lie in the pixel, and what estimates near here come from.
  void show_photons(const ShadingPoint& point, PixelSample& result) const {
    result.photons =
        float(global_.map.count(point.position, point.ng, point.footprint) + caustic_.map.count(point.position, point.ng, point.footprint));
    result.photon_radius = global_.map.spread(point.position, global_.count);
    result.photon_density = float(std::min(global_.count, global_.map.size())) / (kPi * sqr(result.photon_radius));
  }

  Rgb caustics(const ShadingPoint& point, const Bsdf& bsdf) const {
    return caustic_.map.radiance(point, bsdf, radius_ * point.footprint, caustic_.count, filter_);
  }

  // What the diffuse lobes make of irradiance(normal of the side), as if it came from everywhere alike; nothing where that is not known.
  template <class Irradiance>
  static std::optional<Rgb> light_of(const ShadingPoint& point, const Bsdf& bsdf, const Irradiance& irradiance) {
    Rgb radiance;
    for (const uint8_t side : {kReflection, kTransmission}) {
      const Rgb albedo = bsdf.diffuse_albedo(point.wo, side);
      if (is_black(albedo)) continue;
      const std::optional<Rgb> found = irradiance(side == kReflection ? point.ng : -point.ng);
      if (!found) return {};
      radiance += albedo * *found * kInvPi;
    }
    return radiance;
  }

  int global_photons_, caustic_photons_;
  size_t global_count_, caustic_count_;
  PhotonFilter filter_;
  float radius_;
  double goal_;  // relative error; 0: none
  size_t most_bytes_;
  GlobalLight way_;
  DiffuseEndSettings s_;
  IrradianceRecords records_;
  Stock global_, caustic_;
  IrradianceMap irradiance_;
  bool built_ = false, continues_ = false;
  bool caches_ = false;  // has records, or is to have them
};

// A row for each photon; the first row says how many paths were sent for them.
KeptTable Stock::keep() const {
  const LargeVector<Photon> all = map.photons();
  KeptTable table{Photon::kNumbers, std::vector<float>((all.size() + 1) * Photon::kNumbers)};
  table.numbers[0] = float(paths);
  for (size_t i = 0; i < all.size(); ++i) all[i].write(&table.numbers[(i + 1) * Photon::kNumbers]);
  return table;
}

Stock photons_of(const Kept& kept, const std::string& name) {
  const auto found = kept.find(name);
  require(found != kept.end() && found->second.columns == Photon::kNumbers && found->second.rows() > 0,
          "there is no table '" + name + "' of photons");
  const KeptTable& table = found->second;
  Stock all;
  all.paths = table.numbers[0], all.batches = kBatches;
  require(all.paths >= 1.0 && std::isfinite(all.paths), "'" + name + "' does not say how many light paths were sent");
  for (size_t i = 1; i < table.rows(); ++i) {
    const auto photon = Photon::read(&table.numbers[i * table.columns]);
    require(photon.has_value(), "'" + name + "', row " + std::to_string(i) + ": no photon");
    all.loose.push_back(*photon);
  }
  return all;
}

}  // namespace

const Descriptor& photon_map_descriptor() {
  using Kind = Parameter::Kind;
  static const Descriptor descriptor{
      "photon_map",
      "Photon Mapping",
      "Photons are sent out and stored once; the picture reads caustics from them and gathers all other indirect light, at few places "
      "unless told otherwise. Free of most noise, blurred by the photons' distance",
      {
          {"global_photons", "Global Photons", Kind::kInt, 200000, 1, 1e9,
           "Sent out for light that diffuse surfaces throw on each other: more show finer changes of it"},
          {"caustic_photons", "Caustic Photons", Kind::kInt, 1000000, 1, 1e9,
           "Sent out for what mirrors, glass and glossy surfaces throw: more make caustics sharper"},
          {"global_count", "Global Neighbours", Kind::kInt, 100, 2, 10000,
           "Photons by which the light of a place is estimated: more are smoother, and blur it"},
          {"caustic_count", "Caustic Neighbours", Kind::kInt, 60, 2, 10000,
           "Photons by which a caustic is estimated: more are smoother, and blur it"},
          {"caustic_filter",
           "Caustic Filter",
           Kind::kChoice,
           1,
           0,
           2,
           "What photons count by their distance where a caustic is estimated",
           "",
           {{"DISC", "None", "All alike: least noise, most blur"},
            {"CONE", "Cone", "Less towards the border: sharper"},
            {"GAUSS", "Gaussian", "Between the two"}}},
          {"radius", "Caustic Radius", Kind::kFloat, 12, 0.1, 1000,
           "Farther away photons are not looked for: less keeps caustics from being blurred where photons are few", "px"},
          {"photon_error", "Photon Error", Kind::kFloat, 0, 0, 100,
           "Photons are sent and neighbours chosen until the estimated error is below; 0: the numbers above", "%"},
          {"photon_memory", "Photon Memory", Kind::kInt, 512, 1, 1 << 20,
           "Of each map, at most, where photons are sent until the error is met", "MiB"},
          {"global_light",
           "Global Light",
           Kind::kChoice,
           1,
           0,
           3,
           "How light that diffuse surfaces throw on each other is found",
           "",
           {{"GATHERED", "Final Gather", "Looks in all directions from every surface seen, and reads photons where light comes from"},
            {"CACHED", "Irradiance Cache", "Gathers at few places and interpolates between them: smooth soon"},
            {"PHOTONS", "Photons", "Reads photons where the eye looks: at once, and blotchy"},
            {"NONE", "Off", "Leaves it out"}}},
          {"record_error", "Cache Error", Kind::kFloat, 0.15, 0.01, 1,
           "Allowed between records of the irradiance cache: less shows finer changes of light, and takes longer"},
          {"record_samples", "Cache Samples", Kind::kInt, 256, 16, 1 << 20,
           "Rays of each record to begin with: some over all of the hemisphere, more where those found light. Refining adds as many as the "
           "latter"},
          {"max_bounces", "Total", Kind::kInt, 12, 0, 1024, "Bounces of any kind"},
          {"diffuse_bounces", "Diffuse", Kind::kInt, 4, 0, 1024, "Diffuse reflections"},
          {"glossy_bounces", "Glossy", Kind::kInt, 4, 0, 1024, "Glossy and mirror reflections"},
          {"transmission_bounces", "Transmission", Kind::kInt, 12, 0, 1024, "Refractions"},
          {"transparent_bounces", "Transparent", Kind::kInt, 8, 0, 1024, "Transparent surfaces passed by one ray"},
          {"caustics_reflective", "Reflective Caustics", Kind::kBool, 1, 0, 1, "Mirrors and glossy surfaces seen by diffuse ones"},
          {"caustics_refractive", "Refractive Caustics", Kind::kBool, 1, 0, 1, "Glass seen by diffuse surfaces"},
      },
      [](const Parameters& p) -> std::unique_ptr<Integrator> { return std::make_unique<PhotonMapIntegrator>(p); },
      /*bakes=*/false,
      /*kept_version=*/2};
  return descriptor;
}

}  // namespace gi
