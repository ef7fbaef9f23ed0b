// What an integrator is: passes that each add one estimate of the whole image. A new one is one .cpp file with its
// descriptor at the end, and one line in registry.cpp; panels, options and tests come from the descriptor.
#pragma once
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/kept.h"
#include "film/film.h"
#include "transport/render_context.h"

namespace gi {

// A value that the user sets. Numbers, switches and choices are all kept as a double (a choice by its index).
struct Parameter {
  enum class Kind { kInt, kFloat, kBool, kChoice };
  struct Item {
    const char* id;
    const char* label;
    const char* help;
  };
  const char* name;
  const char* label;
  Kind kind;
  double value, min, max;
  const char* help;
  const char* unit = "";
  std::vector<Item> items = {};
};

// The parameters of one render: what the user set, checked, and defaults for the rest.
class Parameters {
 public:
  // Values are numbers or, for choices, an item's id. Throws InputError naming the parameter and what it may be.
  Parameters(const std::vector<Parameter>& declared, const std::map<std::string, std::string>& given, const std::string& integrator);
  double number(const std::string& name) const { return values_.at(name); }
  float real(const std::string& name) const { return float(number(name)); }
  int integer(const std::string& name) const { return int(number(name)); }
  bool on(const std::string& name) const { return number(name) != 0.0; }

 private:
  std::map<std::string, double> values_;
};

// CausticFlags of the scene's switches, which integrators that have them call so.
inline uint8_t no_caustics(const Parameters& p) {
  return uint8_t((p.on("caustics_reflective") ? 0 : kNoReflectiveCaustics) | (p.on("caustics_refractive") ? 0 : kNoRefractiveCaustics));
}

class Integrator {
 public:
  virtual ~Integrator() = default;
  virtual void prepare(const RenderContext&) {}                               // once per scene: caches, tables
  virtual void render_pass(const RenderContext&, int pass, Film&) = 0;        // adds one estimate of the whole image
  virtual void finish_pass(const RenderContext&, int pass) { (void)pass; }    // learn, merge
  // For those whose descriptor has a `kept_version`: before the first pass, of the same version; and after the last.
  virtual void take_over(const Kept&) {}  // throws InputError where that is not what it keeps
  virtual Kept keep() const { return {}; }
  // Before the first pass: takes what `earlier`, of the same kind, parameters and scene, knows of the scene's light, whoever looked at it.
  // That one may have been stopped anywhere, and is not used any more.
  virtual void continue_from(Integrator& earlier) {
    if (const Kept kept = earlier.keep(); !kept.empty()) take_over(kept);
  }
};

// What paths may meet besides surfaces that scatter where they are met. Of the rest an integrator makes the surface's own fallback.
enum Carries : uint8_t { kCarriesSubsurface = 1, kCarriesVolumes = 2, kCarriesAbsorption = 4, kCarriesPortals = 8, kCarriesStrands = 16 };

struct Descriptor {
  const char* id;
  const char* label;
  const char* blurb;
  std::vector<Parameter> parameters;
  std::unique_ptr<Integrator> (*create)(const Parameters&);
  bool bakes = false;  // whether its paths from the eye may begin on a surface: heeds RenderContext::lightmap
  // What it keeps for further renders of the scene. The version changes with what the tables hold; 0: nothing is kept.
  // By place: their rows begin with a position and a normal, so that those near what has changed can be left out.
  int kept_version = 0;
  bool kept_by_place = false;
  uint8_t carries = kCarriesAbsorption;  // Carries
};

const std::vector<Descriptor>& integrators();
const Descriptor& find_integrator(const std::string& id);  // throws InputError naming the valid ids

}  // namespace gi
