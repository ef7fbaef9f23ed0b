// Particle tracing: light is carried from the luminaires by particles that are absorbed or go on at every surface and leave their power
// in its texels [Pattanaik & Mudur 1992]; the eye then reads the texels' irradiance at the first diffuse surface of its paths.
#include "integrators/integrator.h"
#include "transport/diffuse_end.h"
#include "transport/emission_guide.h"
#include "transport/subpath.h"
#include "transport/texels.h"

namespace gi {
namespace {

constexpr uint32_t kParticleStream = 0x70617274u, kAimStream = 0x61696d65u, kWayStream = 0x77617973u;
constexpr int kRoundsOfAPass = 8;      // a round, to learn where to aim, has this part of a pass's particles
constexpr int kLeastRound = 1 << 12;   // but no fewer than these
constexpr int kLeastRounds = 3, kMostRounds = 24;
constexpr size_t kMostTrials = 1 << 19;  // that a guide is made of, about
constexpr size_t kWellAimed = 20000;      // trials that brought something end the learning before the first pass
constexpr size_t kEnoughOnTheWay = 5000;
constexpr size_t kLost = 32;  // with fewer in the first round, the way to what is seen is looked for first
constexpr int kMostLookers = 1 << 14;     // paths from the eye that show what is seen
constexpr uint8_t kAllLobes = kDiffuse | kGlossy | kSpecular | kTransparent;
constexpr uint32_t kMostLayers = 64;  // that light without shadows passes
constexpr int kBatch = 1024;  // particles that a thread takes at a time

using Trials = std::vector<EmissionGuide::Trial>;

enum class DirectLight { kRays, kTexels };

struct ParticleSettings {
  int particles;
  double texel_size;
  size_t texel_memory;
  DirectLight direct;
  bool gather, aim;
  BounceLimits limits;
  uint8_t without;  // CausticFlags
};

// Where the power of one pass went, watts, channels added up. At every surface a particle goes on with the probability that keeps
// its power what it was, so emitted = absorbed + escaped, but for shading normals, which may create power.
struct Ledger {
  double emitted = 0, absorbed = 0, escaped = 0, created = 0;
  void add(const Ledger& o) { emitted += o.emitted, absorbed += o.absorbed, escaped += o.escaped, created += o.created; }
};

double sum(Rgb c) { return double(c.r()) + double(c.g()) + double(c.b()); }

// Bounces on a particle's way to a surface, counted as a path from the eye would: there the surface itself is the first bounce, and
// the one nearest to the light only receives.
struct ParticleBounces {
  PathState counted;
  int scattered = 0;
  bool within = true;
  uint8_t last = 0;  // flags of the lobe that sent it here

  void scatter(uint8_t flags, const BounceLimits& limits) {
    if (scattered++ > 0) within = advance(counted, flags, limits) && within;
    last = flags;
  }
  // Whether a diffuse surface that it arrives at still sees it.
  bool reaches_diffuse(const BounceLimits& limits) const {
    PathState state = counted;
    return within && (scattered == 0 || advance(state, kReflection | kDiffuse, limits));
  }
};

struct Particle {
  Sampler sampler;
  Ray ray;
  Rgb power;
  float seen = 1;  // of what it lights: in glass light is n² times as dense [Veach 1997, §5.2], which paths from the eye leave out
  ParticleBounces bounces;
  PathState state;
  uint32_t bounce = 0;
};

class ParticleIntegrator final : public Integrator {
 public:
  explicit ParticleIntegrator(const Parameters& p)
      : s_{p.integer("particles"),
           p.number("texel_size"),
           size_t(p.number("texel_memory") * 0x1p20),
           DirectLight(p.integer("direct")),
           p.on("gather"),
           p.on("aim"),
           {p.integer("max_bounces"), p.integer("diffuse_bounces"), p.integer("glossy_bounces"), p.integer("transmission_bounces"),
            p.integer("transparent_bounces")},
           no_caustics(p)} {}

  void prepare(const RenderContext& context) override {
    texels_ = std::make_unique<Texels>(context.scene, s_.texel_size, s_.texel_memory, context.pool, context.cancelled);
    context.log.say(texels_->description());
    if (const std::string dark = context.lights.unsampled(); !dark.empty())
      context.log.say("set not to be sampled as lights, so they send no particles and light no surface but are seen themselves: " + dark);
  }

  void render_pass(const RenderContext& context, int pass, Film& film) override {
    if (pass == 0 && s_.aim) aim(context, film);
    texels_->clear(context.lights.emitted_power());
    trace_particles(context, {kParticleStream, uint32_t(pass) * uint32_t(s_.particles), s_.particles}, &ledger_,
                    learned_from_ > 0 ? &trials_ : nullptr);
    if (context.cancelled) return;
    if (learned_from_ > 0 && trials_.size() > 2 * learned_from_) learn(std::move(trials_)), trials_.clear();
    if (learned_from_ > kMostTrials) learned_from_ = 0, texels_->forget_worth();
    log_ledger(context.log, pass + 1);
    for_each_pixel(context, pass, film,
                   [&](const CameraRay& camera, Sampler& sampler, PixelSample& result) { look(context, film, camera, sampler, result); });
  }

 private:
  // Particles that start with these numbers.
  struct Batch {
    uint32_t stream, first;
    int count;
  };
  void trace_particles(const RenderContext& context, const Batch& all, Ledger* ledger, Trials* trials);
  EmissionGuide::Trial trace_particle(const RenderContext& context, Sampler sampler, float share, Ledger& ledger);
  double carry(const RenderContext& context, const EmittedRay& emitted, Particle p, Ledger& ledger);
  void log_ledger(Log& log, int passes) const;
  void aim(const RenderContext& context, const Film& film);
  void find_the_way(const RenderContext& context, const Film& film, int count);
  void learn(Trials trials) {
    learned_from_ = std::max(trials.size(), size_t(1));
    guide_ = EmissionGuide(std::move(trials));
  }
  void look_around(const RenderContext& context, const Film& film, int round, std::vector<Vec3>* seen) const;
  void look(const RenderContext& context, const Film& film, const CameraRay& camera, Sampler& sampler, PixelSample& result,
            std::vector<Vec3>* seen = nullptr) const;
  Rgb read(const ShadingPoint& point, const Bsdf& bsdf) const;

  // A bake of indirect light alone must be able to tell it apart.
  bool direct_in_texels(const RenderContext& context) const {
    return s_.direct == DirectLight::kTexels && !(context.lightmap && context.lightmap->first_depth() > 0);
  }
  bool is_caustic(uint8_t last) const {
    if (!(last & (kGlossy | kSpecular))) return false;
    return s_.without & (last & kTransmission ? kNoRefractiveCaustics : kNoReflectiveCaustics);
  }

  ParticleSettings s_;
  std::unique_ptr<Texels> texels_;
  EmissionGuide guide_;
  SeenPoints seen_;
  bool finding_the_way_ = false;  // to these
  size_t learned_from_ = 0;                     // trials; 0: no longer learns
  Trials trials_;  // of passes since then
  Ledger ledger_;
};

// ---------------------------------------------------------------- from the light

void ParticleIntegrator::trace_particles(const RenderContext& context, const Batch& all, Ledger* ledger, Trials* trials) {
  const int batches = (all.count + kBatch - 1) / kBatch;
  std::vector<Ledger> ledgers{size_t(batches)};
  std::vector<Trials> found{size_t(batches)};
  context.pool.for_each(batches, context.cancelled, [&](int b) {
    for (int k = b * kBatch; k < std::min((b + 1) * kBatch, all.count); ++k) {
      const Sampler sampler(context.seed, all.stream, all.first + uint32_t(k));
      const EmissionGuide::Trial trial = trace_particle(context, sampler, 1.0f / float(all.count), ledgers[size_t(b)]);
      if (trials && trial.worth > 0.0f) found[size_t(b)].push_back(trial);
    }
  });
  if (ledger)
    for (const Ledger& l : ledgers) ledger->add(l);
  if (trials)
    for (const auto& part : found) trials->insert(trials->end(), part.begin(), part.end());
}

void ParticleIntegrator::log_ledger(Log& log, int passes) const {
  const std::pair<const char*, double> figures[] = {{"emitted power", ledger_.emitted},
                                                    {"absorbed power", ledger_.absorbed},
                                                    {"escaped power", ledger_.escaped},
                                                    {"created power", ledger_.created}};
  for (const auto& [name, sum_of_passes] : figures) log.set(name, sum_of_passes / passes);
}

// What irradiance as the diffuse lobes see it has more than power per area: they weigh light by their own normals.
float diffuse_share(const ShadingPoint& point, const Bsdf& bsdf) {
  const float cos_geometric = dot(point.ng, point.wo);
  if (!(cos_geometric > 1e-6f)) return 0.0f;
  const float albedo = average(bsdf.diffuse_albedo(point.ng, kReflection));
  if (albedo > 0.0f) return kPi * average(bsdf.eval(point.ng, point.wo, kReflection | kDiffuse).value) / (albedo * cos_geometric);
  return std::max(dot(bsdf.mean_normal(), point.wo), 0.0f) / cos_geometric;
}

// Shading normals make scattering lopsided: what radiance loses, particles gain. [Veach 1997, eq. 5.19]
float adjoint_factor(const ShadingPoint& point, const Bsdf& bsdf, Vec3 wi) {
  const Vec3 n = bsdf.mean_normal();
  const float shading = abs_dot(n, point.wo) * abs_dot(point.ng, wi), geometric = abs_dot(point.ng, point.wo) * abs_dot(n, wi);
  if (dot(n, point.wo) <= 0.0f) return 0.0f;
  return geometric > 1e-6f ? shading / geometric : 0.0f;
}

EmissionGuide::Trial ParticleIntegrator::trace_particle(const RenderContext& context, Sampler sampler, float share, Ledger& ledger) {
  const float u_choice = sampler.next_1d();
  const Vec2 u_place = sampler.next_2d(), u_direction = sampler.next_2d();
  EmissionNumbers u{u_choice, u_place.x, u_place.y, u_direction.x, u_direction.y};
  const float weight = guide_.warp(u);
  const auto emitted = context.lights.emit(u[0], {u[1], u[2]}, {u[3], u[4]});
  if (!emitted) return {u, 0.0f};
  Particle particle;
  particle.sampler = sampler, particle.ray = emitted->ray, particle.power = emitted->power * (share * weight);
  particle.state.kind = kRayDiffuse;
  ledger.emitted += sum(particle.power);
  const double worth = carry(context, *emitted, std::move(particle), ledger);
  return {u, float(worth / (double(share) * double(context.lights.emitted_power())))};
}

// Returns what the power that it leaves is worth.
double ParticleIntegrator::carry(const RenderContext& context, const EmittedRay& emitted, Particle p, Ledger& ledger) {
  double worth = 0;
  Bsdf bsdf;
  for (;; ++p.bounce) {
    p.sampler.jump_to(p.bounce + 1);
    const bool is_direct = p.bounces.scattered == 0;
    const auto hit = context.scene.intersect(p.ray, is_direct ? ~0u : uint32_t(kRayDiffuse));
    const double sent = sum(p.power);
    p.power *= passed_by_absorbers(context, p.ray, hit ? hit->t : kInf, p.state);
    ledger.absorbed += sent - sum(p.power);
    if (!hit) {
      ledger.escaped += sum(p.power);
      return worth;
    }
    ShadingPoint point = context.scene.shading_point(p.ray, *hit, p.state);
    if (point.strand != kNoId) {  // its light is found from where it is seen; what it lets through goes on
      const double before = sum(p.power);
      p.power *= context.scene.transparency(point);
      ledger.absorbed += before - sum(p.power);
      if (is_black(p.power) || !advance(p.state, kTransparent, s_.limits)) break;
      p.ray = ray_from(point, p.ray.direction);
      continue;
    }
    context.scene.shade(point, bsdf);
    const uint32_t visible = context.scene.instances()[point.instance].data->visibility;
    uint8_t kinds = kAllLobes;
    if (is_caustic(p.bounces.last)) kinds &= uint8_t(~kDiffuse);
    if (is_direct) {
      if (!(emitted.visibility & kRayDiffuse)) kinds &= uint8_t(~kDiffuse);
      if (!(emitted.visibility & kRayGlossy)) kinds &= uint8_t(~(kGlossy | kSpecular));
      // What throws no shadow is lit and lets the light pass.
      if ((!emitted.cast_shadow || !(visible & kRayShadow)) && p.bounce < kMostLayers) {
        Particle beyond = p;
        ++beyond.bounce;
        beyond.ray = ray_from(point, p.ray.direction);
        ledger.created += sum(p.power);
        worth += carry(context, emitted, std::move(beyond), ledger);
      }
    }
    if (kinds != kAllLobes) bsdf.choose(kinds, point.wo);

    // Leave the power, whether the particle goes on or not.
    const bool is_lit = !is_direct || context.lights.turns_to(emitted, point.position);
    if ((bsdf.flags() & kDiffuse) && is_lit && p.bounces.reaches_diffuse(s_.limits) && (!is_direct || direct_in_texels(context))) {
      worth += texels_->deposit(point, point.backfacing, p.power * (p.seen * diffuse_share(point, bsdf)));
      if (finding_the_way_) worth += double(average(p.power) * seen_.density(point.position));
    }

    // Go on with the probability of what is left, absorbed otherwise.
    const float u_lobe = p.sampler.next_1d(), u_absorb = p.sampler.next_1d();
    const auto next = bsdf.sample(point.wo, p.sampler.next_2d(), u_lobe);
    const bool transparent = next && (next->flags & kTransparent);
    if (next && (next->flags & kPortal)) break;  // absorbed: where it would come out there is no telling
    Rgb left;
    if (next && next->pdf_dir > 0.0f) left = p.power * next->value / next->pdf_dir;
    if (!transparent && (!is_lit || !(visible & kRayDiffuse))) left = Rgb();
    if (next && !transparent) left *= adjoint_factor(point, bsdf, next->wi);
    const double before = sum(p.power), after = sum(left), alpha = std::min(1.0, after / before);
    if (!(double(u_absorb) < alpha)) break;
    if (next->flags & kTransmission && !transparent) {
      const double made = sum(p.power * adjoint(context, point, bsdf, *next, p.state).factor);
      p.seen *= float(made / after);
    }
    p.power = left * float(1.0 / alpha);
    ledger.created += std::max(after - before, 0.0);

    // Follow it.
    const bool within = advance(p.state, next->flags, s_.limits);
    if (transparent && !within) break;
    if (!transparent) p.bounces.scatter(next->flags, s_.limits);
    if (!p.bounces.within || p.bounces.scattered > s_.limits.total) break;
    p.ray = ray_from(point, next->wi);
  }
  ledger.absorbed += sum(p.power);
  return worth;
}

// ---------------------------------------------------------------- where to aim

// The younger half of rounds: the older ones did not know yet what is bright.
Trials younger(const std::vector<Trials>& rounds) {
  Trials trials;
  for (size_t r = rounds.size() / 2; r < rounds.size(); ++r) trials.insert(trials.end(), rounds[r].begin(), rounds[r].end());
  return trials;
}

// Most particles may come to nothing that is seen: those of a sky to all but a room's windows, those of a lamp to all but the room it
// hangs in. Rounds of particles, thrown away, show which do not; those of passes that follow refine it for passes still to come.
void ParticleIntegrator::aim(const RenderContext& context, const Film& film) {
  texels_->clear(context.lights.emitted_power());
  texels_->watch();
  std::vector<Trials> rounds;
  int count = std::max(s_.particles / kRoundsOfAPass, kLeastRound);
  uint32_t first = 0;
  bool lost = false;
  while (int(rounds.size()) < (lost ? kRoundsOfAPass : kMostRounds)) {
    const int round = int(rounds.size());
    context.log.stage("aiming particles, round " + std::to_string(round + 1));
    if (round < kRoundsOfAPass) look_around(context, film, round, nullptr);
    texels_->appraise();
    trace_particles(context, {kAimStream, first, count}, nullptr, &rounds.emplace_back());
    first += uint32_t(count);
    if (context.cancelled) break;
    if (round == 0 && rounds[0].size() < kLost) {
      lost = true, count = std::max(s_.particles, kLeastRound);
      find_the_way(context, film, count);
      continue;
    }
    // What was learned on the way is better than what a few trials tell.
    if (Trials trials = younger(rounds); !lost || trials.size() > kEnoughOnTheWay) learn(std::move(trials));
    if (learned_from_ > kWellAimed && round + 1 >= kLeastRounds) break;
  }
  texels_->stop_watching();
  context.log.set("rounds of aim", double(rounds.size()));
  context.log.stage("");
}

// Where next to no particle comes to what is read, rounds before those count any that comes near what is seen. They are large: most of
// their particles are lost at once and cost little.
void ParticleIntegrator::find_the_way(const RenderContext& context, const Film& film, int count) {
  std::vector<Vec3> points;
  look_around(context, film, 0, &points);
  seen_ = SeenPoints(points, context.pool);
  finding_the_way_ = true;
  std::vector<Trials> rounds;
  while (int(rounds.size()) < kMostRounds && learned_from_ <= kWellAimed && !context.cancelled) {
    const uint32_t round = uint32_t(rounds.size());
    context.log.stage("aiming particles, finding the way, round " + std::to_string(round + 1));
    trace_particles(context, {kWayStream, round * uint32_t(count), count}, nullptr, &rounds.emplace_back());
    learn(younger(rounds));
    if (round >= 4 && 4 * rounds.back().size() < 5 * rounds[round / 2].size()) break;  // it grows no more
  }
  finding_the_way_ = false;
  context.log.set("rounds of finding the way", double(rounds.size()));
}

// Rows of pixels all over the picture. Adds what is seen there to `seen`.
void ParticleIntegrator::look_around(const RenderContext& context, const Film& film, int round, std::vector<Vec3>* seen) const {
  const FilmSpec& spec = film.spec();
  const int rows = int(film.tiles().size()) * Film::kTileSize, step = std::max(1, rows * Film::kTileSize / kMostLookers);
  std::vector<std::vector<Vec3>> found{size_t(rows / step)};
  context.pool.for_each(rows / step, context.cancelled, [&](int k) {
    const int row = k * step + int(hash32(uint32_t(round)) % uint32_t(step));
    const Tile& tile = film.tiles()[size_t(row / Film::kTileSize)];
    const int y = tile.y0 + row % Film::kTileSize;
    if (y >= tile.y1) return;
    const CameraRow cameras(context, film, spec.x0 + tile.x0, spec.y0 + y, round);
    for (int i = 0; i < tile.x1 - tile.x0; ++i) {
      if (context.lightmap && !context.lightmap->covers(spec.x0 + tile.x0 + i, spec.y0 + y)) continue;
      Sampler sampler = cameras.samplers.sampler(i);
      PixelSample unused;
      look(context, film, cameras.rays[i], sampler, unused, seen ? &found[size_t(k)] : nullptr);
    }
  });
  if (!seen) return;
  for (const auto& part : found) seen->insert(seen->end(), part.begin(), part.end());
}

// ---------------------------------------------------------------- from the eye

// Radiance of the diffuse lobes towards the eye.
Rgb ParticleIntegrator::read(const ShadingPoint& point, const Bsdf& bsdf) const {
  Rgb radiance;
  for (const uint8_t side : {kReflection, kTransmission}) {
    const Rgb albedo = bsdf.diffuse_albedo(point.wo, side);
    if (!is_black(albedo)) radiance += albedo * texels_->density(point, point.backfacing == (side == kReflection)) * kInvPi;
  }
  return radiance;
}

void ParticleIntegrator::look(const RenderContext& context, const Film& film, const CameraRay& camera, Sampler& sampler,
                              PixelSample& result, std::vector<Vec3>* seen) const {
  DiffuseEndSettings end;
  end.limits = s_.limits, end.without = s_.without;
  end.direct_known = end.direct_gathered = direct_in_texels(context);
  EndingPath ending{CameraPath(camera)};
  trace_to_diffuse(
      context, film, end, camera, ending, sampler, result, [](const ShadingPoint&, const Bsdf&) { return Rgb(); },
      [&](const ShadingPoint& point, const Bsdf& bsdf, bool gathered) -> std::optional<KnownLight> {
        if (s_.gather && !gathered) return {};
        if (seen) seen->push_back(point.position);
        return KnownLight{Rgb(), read(point, bsdf)};
      });
}

}  // namespace

const Descriptor& particle_descriptor() {
  using Kind = Parameter::Kind;
  static const Descriptor descriptor{
      "particle",
      "Particle Tracing",
      "Light is carried from the luminaires and left in the texels of diffuse surfaces; caustics included. Biased by the size of a texel, "
      "and by reading rough diffuse surfaces as if light came to them evenly",
      {
          {"particles", "Particles", Kind::kInt, 200000, 1, 1e9,
           "Sent out in each pass: more make light smooth in fewer passes, which take longer"},
          {"texel_size", "Texel Size", Kind::kFloat, 0.05, 1e-5, 1e4,
           "Wished size of the texels that light is gathered in: smaller shows finer shadows and caustics, with more noise", "LENGTH"},
          {"texel_memory", "Texel Memory", Kind::kInt, 512, 1, 1 << 20, "That texels may take; they become coarser where it is not enough",
           "MiB"},
          {"direct",
           "Direct Light",
           Kind::kChoice,
           0,
           0,
           1,
           "Where the light is from that comes straight from luminaires",
           "",
           {{"RAYS", "Rays", "Shadow rays: crisp shadows"}, {"TEXELS", "Texels", "The texels, as all other light"}}},
          {"gather", "Final Gather", Kind::kBool, 0, 0, 1, "Texels are read one diffuse bounce later: without their blur, but noisier"},
          {"aim", "Aim Particles", Kind::kBool, 1, 0, 1,
           "Learns, before the first pass, which particles come to what is seen, as through a window, and sends more of these"},
          {"max_bounces", "Total", Kind::kInt, 12, 0, 1024, "Bounces of any kind"},
          {"diffuse_bounces", "Diffuse", Kind::kInt, 4, 0, 1024, "Diffuse reflections"},
          {"glossy_bounces", "Glossy", Kind::kInt, 4, 0, 1024, "Glossy and mirror reflections"},
          {"transmission_bounces", "Transmission", Kind::kInt, 12, 0, 1024, "Refractions"},
          {"transparent_bounces", "Transparent", Kind::kInt, 8, 0, 1024, "Transparent surfaces passed by one ray"},
          {"caustics_reflective", "Reflective Caustics", Kind::kBool, 1, 0, 1, "Mirrors and glossy surfaces seen by diffuse ones"},
          {"caustics_refractive", "Refractive Caustics", Kind::kBool, 1, 0, 1, "Glass seen by diffuse surfaces"},
      },
      [](const Parameters& p) -> std::unique_ptr<Integrator> { return std::make_unique<ParticleIntegrator>(p); },
      true};
  return descriptor;
}

}  // namespace gi
