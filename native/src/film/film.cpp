// Accumulating and reading the film.
#include "film/film.h"

#include <algorithm>
#include <numeric>

#include "core/check.h"

namespace gi {

namespace {

void add_number(float x, float* sum) { *sum += std::isfinite(x) ? x : 0.0f; }
void add_rgb(Rgb c, float* sum) { add_number(c.r(), sum), add_number(c.g(), sum + 1), add_number(c.b(), sum + 2); }
void add_vec(Vec3 v, float* sum) { add_number(v.x, sum), add_number(v.y, sum + 1), add_number(v.z, sum + 2); }
void add_combined(const PixelSample& s, float exposure, float* sum) {  // known to be finite
  const Rgb c = s.radiance * exposure;
  sum[0] += c.r(), sum[1] += c.g(), sum[2] += c.b(), sum[3] += s.alpha;
}

template <LightTerm term>
void add_term(const PixelSample& s, float exposure, float* sum) {
  add_rgb(s.terms[term] * exposure, sum);
}

const PassRule kPassRules[] = {
    {"Combined", 4, Keep::kLight, add_combined},
    {"Depth", 1, Keep::kFirst, [](const PixelSample& s, float, float* o) { add_number(s.depth, o); }},
    {"Position", 3, Keep::kFirst, [](const PixelSample& s, float, float* o) { add_vec(s.position, o); }},
    {"Normal", 3, Keep::kMean, [](const PixelSample& s, float, float* o) { add_vec(s.normal, o); }},
    {"UV", 3, Keep::kMean, [](const PixelSample& s, float, float* o) { add_vec({s.uv.x, s.uv.y, s.has_uv ? 1.0f : 0.0f}, o); }},
    {"Denoising Albedo", 3, Keep::kMean, [](const PixelSample& s, float, float* o) { add_rgb(s.albedo, o); }},
    {"Denoising Normal", 3, Keep::kMean, [](const PixelSample& s, float, float* o) { add_vec(s.normal, o); }},
    {"Object Index", 1, Keep::kFirst, [](const PixelSample& s, float, float* o) { add_number(s.object_index, o); }},
    {"Material Index", 1, Keep::kFirst, [](const PixelSample& s, float, float* o) { add_number(s.material_index, o); }},
    {"Cache Samples", 1, Keep::kMean, [](const PixelSample& s, float, float* o) { add_number(s.cache_record, o); }},
    {"Photons", 1, Keep::kMean, [](const PixelSample& s, float, float* o) { add_number(s.photons, o); }},
    {"Photon Density", 1, Keep::kMean, [](const PixelSample& s, float, float* o) { add_number(s.photon_density, o); }},
    {"Photon Radius", 1, Keep::kMean, [](const PixelSample& s, float, float* o) { add_number(s.photon_radius, o); }},
    {"Direct", 3, Keep::kLight, add_term<kDirectTerm>},
    {"Specular", 3, Keep::kLight, add_term<kSpecularTerm>},
    {"Caustic", 3, Keep::kLight, add_term<kCausticTerm>},
    {"Global", 3, Keep::kLight, add_term<kGlobalTerm>},
    {"Emission", 3, Keep::kLight, [](const PixelSample& s, float exposure, float* o) { add_rgb(s.emission * exposure, o); }},
    {"Environment", 3, Keep::kLight, [](const PixelSample& s, float exposure, float* o) { add_rgb(s.environment * exposure, o); }},
};
constexpr const char* kSampleCount = "Debug Sample Count";

const PassRule* find_rule(const std::string& name) {
  for (const PassRule& rule : kPassRules)
    if (name == rule.name) return &rule;
  return nullptr;
}

}  // namespace

int Film::channels(const std::string& pass) const {
  if (pass == kSampleCount) return 1;
  for (const Aov& aov : spec_.aovs)
    if (pass == aov.name) return aov.channels;
  const PassRule* rule = find_rule(pass);
  return rule ? rule->channels : 0;
}

Film::Film(FilmSpec spec) : spec_(std::move(spec)), filter_(spec_.filter, spec_.filter_width) {
  require(spec_.width > 0 && spec_.height > 0,
          "the image must have at least one pixel, not " + std::to_string(spec_.width) + " x " + std::to_string(spec_.height));
  require(
      spec_.x0 >= 0 && spec_.y0 >= 0 && spec_.x1 <= spec_.width && spec_.y1 <= spec_.height && spec_.x0 < spec_.x1 && spec_.y0 < spec_.y1,
      "the render region is empty or lies outside the image");
  const int w = spec_.region_width(), h = spec_.region_height();
  // From the top down, as people read pictures.
  for (int y = h; y > 0; y -= kTileSize)
    for (int x = 0; x < w; x += kTileSize) tiles_.push_back({x, std::max(0, y - kTileSize), std::min(w, x + kTileSize), y});
  tile_mutex_ = std::make_unique<std::mutex[]>(tiles_.size());
  const size_t pixels = size_t(w) * size_t(h);
  for (const std::string& name : spec_.passes) {
    if (name == kSampleCount) continue;  // count_ is always there
    const PassRule* rule = find_rule(name);
    require(rule, "there is no pass named '" + name + "'");
    has_data_passes_ = has_data_passes_ || rule->keep != Keep::kLight;
    layers_.push_back({rule, 0, std::vector<float>(pixels * size_t(rule->channels), 0.0f)});
  }
  for (const Aov& aov : spec_.aovs) {
    require(!find_rule(aov.name) && aov.name != kSampleCount, "an AOV has the name of a pass, '" + aov.name + "'");
    require(aov.channels == 1 || aov.channels == 4, "the AOV '" + aov.name + "' must have 1 or 4 channels");
    aov_rules_.push_back({aov.name.c_str(), aov.channels, Keep::kMean, nullptr});
    layers_.push_back({&aov_rules_.back(), 4 * (aov_rules_.size() - 1), std::vector<float>(pixels * size_t(aov.channels), 0.0f)});
    has_data_passes_ = true;
  }
  moments_.resize(pixels);
}

bool Film::wants(const std::string& pass) const { return std::find(spec_.passes.begin(), spec_.passes.end(), pass) != spec_.passes.end(); }

bool Film::add_moments(Moments& m, const PixelSample& s) {
  ++m.count;
  const Rgb light = s.radiance * spec_.exposure;
  if (!is_finite(light) || !std::isfinite(s.alpha)) {
    ++bad_samples_;  // its light is left out of sums and counts; what it hit is still good
    return false;
  }
  ++m.light_count;
  const float y = luminance(light);
  m.luminance += y, m.luminance_square += y * y;
  return true;
}

void Film::add_row(int tile, int y, int pass, const PixelSample* samples) {
  const Tile& t = tiles_[size_t(tile)];
  const int width = t.x1 - t.x0;
  const size_t first = size_t(y) * size_t(spec_.region_width()) + size_t(t.x0);
  const std::lock_guard lock(tile_mutex_[size_t(tile)]);
  bool good[kTileSize];
  for (int i = 0; i < width; ++i) good[i] = add_moments(moments_[first + size_t(i)], samples[i]);
  for (Layer& layer : layers_) {
    const PassRule& rule = *layer.rule;
    if (rule.keep == Keep::kFirst && pass > 0) continue;
    float* sum = layer.sum.data() + first * size_t(rule.channels);
    for (int i = 0; i < width; ++i, sum += rule.channels)
      if (!rule.add) {
        for (int k = 0; k < rule.channels; ++k) add_number(samples[i].aovs[layer.aov + size_t(k)], sum + k);
      } else if (good[i] || rule.keep != Keep::kLight)
        rule.add(samples[i], spec_.exposure, sum);
  }
}

void Film::start_splats(double unit) {
  const std::lock_guard lock(splats_mutex_);
  splats_ = std::make_unique<Splats>(moments_.size(), unit);
}

void Film::end_splats(bool finished) { finished ? splats_->fold() : splats_->drop(); }

bool Film::splat(Vec2 at, bool wraps, Rgb value, Vec2 u) {
  const PixelFilter::Share x = filter_.choose(at.x * float(spec_.width), u.x), y = filter_.choose(at.y * float(spec_.height), u.y);
  int column = x.pixel, row = y.pixel;
  if (wraps) {
    const bool over_pole = row < 0 || row >= spec_.height;
    if (over_pole) row = row < 0 ? -1 - row : 2 * spec_.height - 1 - row, column += spec_.width / 2;
    column = (column % spec_.width + spec_.width) % spec_.width;
  }
  if (column < spec_.x0 || column >= spec_.x1 || row < spec_.y0 || row >= spec_.y1) return false;
  value *= x.weight * y.weight * spec_.exposure;
  if (!is_finite(value)) {
    ++bad_samples_;
    return false;
  }
  splats_->add(size_t(row - spec_.y0) * size_t(spec_.region_width()) + size_t(column - spec_.x0), value);
  return true;
}

void Film::read(const std::string& pass, float* out) const {
  const size_t w = size_t(spec_.region_width());
  const Layer* layer = nullptr;
  for (const Layer& l : layers_)
    if (pass == l.rule->name) layer = &l;
  require(layer || pass == kSampleCount, "the pass '" + pass + "' is not part of this render");
  const bool mean = layer && layer->rule->keep != Keep::kFirst;
  const auto count = [&, light = layer && layer->rule->keep == Keep::kLight](size_t i) {
    return light ? moments_[i].light_count : moments_[i].count;
  };
  for (size_t tile = 0; tile < tiles_.size(); ++tile) {
    const Tile& t = tiles_[tile];
    const std::lock_guard lock(tile_mutex_[tile]);
    for (int y = t.y0; y < t.y1; ++y) {
      for (int x = t.x0; x < t.x1; ++x) {
        const size_t pixel = size_t(y) * w + size_t(x);
        if (!layer) {
          out[pixel] = float(count(pixel));
          continue;
        }
        const size_t c = size_t(layer->rule->channels);
        const float scale = !mean ? 1.0f : count(pixel) ? 1.0f / float(count(pixel)) : 0.0f;
        for (size_t k = 0; k < c; ++k) out[pixel * c + k] = layer->sum[pixel * c + k] * scale;
      }
    }
  }
  if (pass == "Combined") add_splats(out);
}

void Film::add_splats(float* out) const {
  const std::lock_guard lock(splats_mutex_);
  if (!splats_) return;
  const std::lock_guard sums(splats_->mutex());
  for (size_t p = 0; p < moments_.size(); ++p) {
    const Rgb mean = splats_->mean(p);
    for (size_t k = 0; k < 3; ++k) out[4 * p + k] += mean[int(k)];
  }
}

float Film::relative_error() const {
  const size_t pixels = moments_.size();
  double total = 0;
  for (size_t i = 0; i < pixels; ++i) {
    const Moments& m = moments_[i];
    if (m.count < 2) return kInf;
    total += m.luminance / float(std::max(m.light_count, 1u));
    if (splats_) total += double(luminance(splats_->mean(i)));
  }
  const float floor = std::max(float(0.1 * total / double(pixels)), 1e-12f);
  std::vector<float> error(pixels);
  for (size_t i = 0; i < pixels; ++i) {
    const Moments& m = moments_[i];
    if (m.light_count < 2) continue;  // no light to judge by: it would keep the render from ending
    const double n = m.light_count;
    double mean = m.luminance / n;
    double variance = std::max(0.0, m.luminance_square / n - mean * mean) / (n - 1);  // of the mean
    if (splats_) mean += double(luminance(splats_->mean(i))), variance += splats_->variance_of_mean(i);
    error[i] = float(std::sqrt(variance) / std::max(std::abs(mean), double(floor)));
  }
  const size_t rank = std::min(pixels - 1, size_t(0.95 * double(pixels)));
  std::nth_element(error.begin(), error.begin() + ptrdiff_t(rank), error.end());
  return error[rank];
}

size_t Film::memory_bytes() const {
  size_t bytes = moments_.size() * sizeof(Moments);
  if (splats_) bytes += splats_->memory_bytes();
  for (const Layer& layer : layers_) bytes += layer.sum.size() * 4;
  return bytes;
}

}  // namespace gi
