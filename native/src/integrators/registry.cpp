// The list of integrators and the reading of their parameters.
#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/check.h"
#include "integrators/integrator.h"

namespace gi {

// One line for each integrator.
const Descriptor& whitted_descriptor();
const Descriptor& distributed_descriptor();
const Descriptor& path_descriptor();
const Descriptor& light_descriptor();
const Descriptor& bdpt_descriptor();
const Descriptor& particle_descriptor();
const Descriptor& photon_map_descriptor();
const Descriptor& sppm_descriptor();
const Descriptor& vcm_descriptor();
const Descriptor& irradiance_cache_descriptor();

const std::vector<Descriptor>& integrators() {
  static const std::vector<Descriptor> all{
      whitted_descriptor(),  distributed_descriptor(), path_descriptor(), light_descriptor(), bdpt_descriptor(),
      particle_descriptor(), photon_map_descriptor(),  sppm_descriptor(), vcm_descriptor(),   irradiance_cache_descriptor(),
  };
  return all;
}

const Descriptor& find_integrator(const std::string& id) {
  std::string valid;
  for (const Descriptor& d : integrators()) {
    if (d.id == id) return d;
    valid += (valid.empty() ? "" : ", ") + std::string(d.id);
  }
  throw InputError("there is no integrator '" + id + "'; there are: " + valid);
}

namespace {

double parse(const Parameter& p, const std::string& text, const std::string& who) {
  if (p.kind == Parameter::Kind::kChoice) {
    std::string valid;
    for (size_t i = 0; i < p.items.size(); ++i) {
      if (text == p.items[i].id) return double(i);
      valid += (valid.empty() ? "" : ", ") + std::string(p.items[i].id);
    }
    throw InputError(who + " must be one of " + valid + ", not '" + text + "'");
  }
  if (p.kind == Parameter::Kind::kBool) {
    if (text == "true" || text == "True" || text == "1" || text == "on") return 1;
    if (text == "false" || text == "False" || text == "0" || text == "off") return 0;
    throw InputError(who + " must be true or false, not '" + text + "'");
  }
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  const bool whole = p.kind != Parameter::Kind::kInt || value == std::floor(value);
  if (text.empty() || *end != '\0' || !std::isfinite(value) || !whole || value < p.min || value > p.max) {
    auto shown = [](double x) {
      std::string s = std::to_string(x);
      while (s.find('.') != std::string::npos && (s.back() == '0' || s.back() == '.')) {
        const bool point = s.back() == '.';
        s.pop_back();
        if (point) break;
      }
      return s;
    };
    throw InputError(who + " must be a " + (p.kind == Parameter::Kind::kInt ? "whole number" : "number") + " from " + shown(p.min) +
                     " to " + shown(p.max) + ", not '" + text + "'");
  }
  return value;
}

}  // namespace

Parameters::Parameters(const std::vector<Parameter>& declared, const std::map<std::string, std::string>& given,
                       const std::string& integrator) {
  for (const Parameter& p : declared) values_[p.name] = p.value;
  for (const auto& [name, text] : given) {
    const auto it = std::find_if(declared.begin(), declared.end(), [&](const Parameter& p) { return name == p.name; });
    if (it == declared.end()) {
      std::string valid;
      for (const Parameter& p : declared) valid += (valid.empty() ? "" : ", ") + std::string(p.name);
      throw InputError("integrator '" + integrator + "' has no parameter '" + name + "'; it has: " + valid);
    }
    values_[name] = parse(*it, text, "parameter '" + name + "' of integrator '" + integrator + "'");
  }
}

}  // namespace gi
