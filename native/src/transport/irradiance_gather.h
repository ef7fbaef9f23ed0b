// One record of an irradiance cache: a stratified hemisphere of rays, and from the same rays how irradiance changes as the point moves
// and its normal turns. [Ward & Heckbert 1992] Leaves out what the rays bring home.
#pragma once
#include <functional>

#include "transport/irradiance_cache.h"
#include "transport/irradiance_guide.h"

namespace gi {

struct GatheredRay {
  Rgb radiance;
  float distance = kInf;  // to the first surface
};

// Strata of a hemisphere, equal in projected solid angle: rings about the normal, each of as many sectors, nearly square.
struct HemisphereStrata {
  int rings, sectors;
  explicit HemisphereStrata(int samples)
      : rings(std::max(2, int(std::sqrt(float(samples) * kInvPi) + 0.5f))), sectors(std::max(4, int(kPi * float(rings) + 0.5f))) {}
  int count() const { return rings * sectors; }
  // The least part of the distance along a ray that a wall may be away, of the rays towards it that meet it soonest.
  float least_aim() const { return std::sqrt(1.0f - 1.0f / float(rings)) * std::max(std::cos(2.0f * kPi / float(sectors)), 0.5f); }
};

// What rays see from a place: irradiance, its gradients, and how far off things are.
struct GatheredIrradiance {
  IrradianceRecord record;  // its radius is the harmonic mean
  float nearest = kInf;  // metres; no wall is nearer
  float wall = kInf;     // metres, to what is no mere chair's leg: a tenth of the rays meet something nearer
  Around around{};       // metres, to what a quarter of the rays that way do not get past
  float variance = 0;    // of the irradiance's luminance, (W/m²)²: by differences of neighbouring strata, rather too much
  std::vector<Sighting> seen;  // by each ray
};

// `ray(index, direction)`: about `samples` of them, one for each stratum; `jitter(index)` places it therein.
GatheredIrradiance gather_irradiance(Vec3 position, Vec3 normal, int samples, const std::function<Vec2(int)>& jitter,
                                     const std::function<GatheredRay(int, Vec3)>& ray);

// The same from rays that a guide sends, without gradients of moves or distances. `jitter(index)`: three numbers.
GatheredIrradiance gather_guided(Vec3 normal, int samples, const IrradianceGuide& guide, const std::function<Vec3(int)>& jitter,
                                 const std::function<GatheredRay(int, Vec3)>& ray);

}  // namespace gi
