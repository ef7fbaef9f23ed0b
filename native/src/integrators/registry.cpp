// The list of integrators and what they share: parameters and the walk over pixels.
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

const std::vector<Descriptor>& integrators() {
  static const std::vector<Descriptor> all{
      whitted_descriptor(),
      distributed_descriptor(),
      path_descriptor(),
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

void for_each_pixel(const RenderContext& context, int pass, Film& film, const PixelFunction& f) {
  const FilmSpec& spec = film.spec();
  const Vec2 pixel{1.0f / float(spec.width), 1.0f / float(spec.height)};
  context.pool.for_each(int(film.tiles().size()), context.cancelled, [&](int index) {
    const Tile& tile = film.tiles()[size_t(index)];
    static thread_local std::vector<PixelSample> samples;
    samples.clear();
    for (int y = tile.y0; y < tile.y1; ++y) {
      for (int x = tile.x0; x < tile.x1; ++x) {
        // Keyed by the place in the full frame: a region shows what the whole picture would.
        const int px = spec.x0 + x, py = spec.y0 + y;
        Sampler sampler(context.seed, uint32_t(py) * uint32_t(spec.width) + uint32_t(px), uint32_t(pass));
        const Vec2 offset = film.filter().sample(sampler.next_2d());
        const Vec2 lens = sampler.next_2d();
        const Vec2 at{(float(px) + 0.5f + offset.x) * pixel.x, (float(py) + 0.5f + offset.y) * pixel.y};
        samples.push_back(f(context.camera.sample(at, pixel, lens), sampler));
      }
    }
    film.add_tile(index, pass, samples);
    ++context.tiles_done;
  });
}

}  // namespace gi
