// Texel lookups. Interpolation works on what the file holds (encoded bytes, colour times alpha); decoding comes last.
#include "shading/images.h"

#include <array>

#include "core/check.h"
#include "shading/voxels.h"

namespace gi {
namespace {

struct alignas(16) Rgba {
  float v[4] = {0, 0, 0, 0};
};
Rgba operator*(float s, Rgba a) {
  for (float& x : a.v) x *= s;
  return a;
}
Rgba& operator+=(Rgba& a, Rgba b) {
  for (int i = 0; i < 4; ++i) a.v[i] += b.v[i];
  return a;
}

// Decoding by a table fine enough that linear interpolation in it errs by less than 1e-6.
constexpr int kDecodeSteps = 2048;
const auto kDecoded = [] {
  std::array<float, kDecodeSteps + 2> t;
  for (int i = 0; i < kDecodeSteps + 2; ++i) {
    const double e = double(i) / kDecodeSteps;
    t[size_t(i)] = float(e <= 0.04045 ? e / 12.92 : std::pow((e + 0.055) / 1.055, 2.4));
  }
  return t;
}();
float srgb_to_linear(float x) {
  if (x > 1.00001f) return std::pow((x + 0.055f) / 1.055f, 2.4f);  // premultiplied colours that exceed their alpha
  const float position = clamp01(x) * float(kDecodeSteps);
  const int i = int(position);
  return lerp(kDecoded[size_t(i)], kDecoded[size_t(i) + 1], position - float(i));
}

// One texel in the units of its format, with its colour times alpha; bytes are rounded down, as in Cycles.
Rgba texel(const uint8_t* p, AlphaMode alpha) {
  Rgba c{{float(p[0]), float(p[1]), float(p[2]), float(p[3])}};
  if (alpha == AlphaMode::kNone) c.v[3] = 255.0f;
  if (alpha == AlphaMode::kStraight && p[3] != 255)
    for (int i = 0; i < 3; ++i) c.v[i] = float(p[i] * p[3] / 255);
  return c;
}
Rgba texel(const float* p, AlphaMode alpha) {
  Rgba c{{p[0], p[1], p[2], p[3]}};
  if (alpha == AlphaMode::kNone) c.v[3] = 1.0f;
  if (alpha == AlphaMode::kStraight)
    for (int i = 0; i < 3; ++i) c.v[i] *= p[3];
  return c;
}

// Index of texel x of n after extension; -1 is outside a clipped image.
int extend(int x, int n, Extension e) {
  switch (e) {
    case Extension::kRepeat: {
      const int r = x % n;
      return r < 0 ? r + n : r;
    }
    case Extension::kExtend: return std::clamp(x, 0, n - 1);
    case Extension::kMirror: {
      const int m = (x < 0 ? -1 - x : x) % (2 * n);
      return m < n ? m : 2 * n - 1 - m;
    }
    case Extension::kClip: return x < 0 || x >= n ? -1 : x;
  }
  return -1;
}

// Uniform cubic B-spline: smooth, does not pass through the texels.
void cubic_weights(float t, float w[4]) {
  const float s = 1.0f - t;
  w[0] = s * s * s / 6.0f;
  w[1] = ((0.5f * t - 1.0f) * t) * t + 2.0f / 3.0f;
  w[2] = ((0.5f * s - 1.0f) * s) * s + 2.0f / 3.0f;
  w[3] = t * t * t / 6.0f;
}

// The texels that an interpolation needs along one axis, and their weights.
struct Taps {
  int count = 1;
  int index[4];
  float weight[4] = {1, 0, 0, 0};

  Taps(float x, int n, Interpolation interpolation, Extension extension) {
    // Far-away and NaN coordinates would overflow integers; nothing sensible is out there.
    if (!(std::abs(x) < 1e9f)) x = 0;
    const float centred = interpolation == Interpolation::kClosest ? x : x - 0.5f;
    const float floor = std::floor(centred), t = centred - floor;
    int first = int(floor);
    if (interpolation == Interpolation::kLinear) count = 2, weight[0] = 1.0f - t, weight[1] = t;
    if (interpolation == Interpolation::kCubic) count = 4, first -= 1, cubic_weights(t, weight);
    index[0] = extend(first, n, extension);
    for (int i = 1; i < count; ++i) {
      if (extension == Extension::kRepeat)
        index[i] = index[i - 1] + 1 == n ? 0 : index[i - 1] + 1;
      else
        index[i] = extend(first + i, n, extension);
    }
  }
};

template <class T>
Rgba sum_of_texels(const T* pixels, const ImageTile& t, const Taps& column, const Taps& row) {
  Rgba sum;
  for (int j = 0; j < row.count; ++j) {
    if (row.index[j] < 0) continue;
    const T* line = pixels + 4 * size_t(row.index[j]) * size_t(t.width);
    for (int i = 0; i < column.count; ++i)
      if (column.index[i] >= 0) sum += (row.weight[j] * column.weight[i]) * texel(line + 4 * column.index[i], t.alpha);
  }
  return sum;
}

Rgba interpolate(const ImageTile& t, Vec2 uv, Interpolation interpolation, Extension extension) {
  const Taps column(uv.x * float(t.width), t.width, interpolation, extension);
  const Taps row(uv.y * float(t.height), t.height, interpolation, extension);
  return t.bytes ? (1.0f / 255.0f) * sum_of_texels(t.bytes, t, column, row) : sum_of_texels(t.floats, t, column, row);
}

// The tile under `uv`, which becomes relative to it. Null where there is none.
const ImageTile* find_tile(const Image& image, Vec2& uv) {
  if (!image.tiled) return &image.tiles.front();
  if (!(uv.x >= 0.0f && uv.x < 10.0f && uv.y >= 0.0f && uv.y < 1000.0f)) return nullptr;
  const int column = int(uv.x), row = int(uv.y), number = 1001 + 10 * row + column;
  for (const ImageTile& tile : image.tiles) {
    if (tile.number != number) continue;
    uv = {uv.x - float(column), uv.y - float(row)};
    return &tile;
  }
  return nullptr;
}

}  // namespace

Texel lookup_voxels(const Image& image, int side, Vec3 p, Interpolation interpolation) {
  const ImageTile& t = image.tiles.front();
  if (!t.floats || t.width != side || int64_t(t.height) != int64_t(side) * side) return {Rgb(), 0.0f};
  const Taps x(p.x * float(side), side, interpolation, Extension::kClip), y(p.y * float(side), side, interpolation, Extension::kClip);
  const Taps z(p.z * float(side), side, interpolation, Extension::kClip);
  Rgba sum;
  for (int k = 0; k < z.count; ++k) {
    if (z.index[k] < 0) continue;
    const float* layer = t.floats + 4 * size_t(z.index[k]) * size_t(side) * size_t(side);
    sum += z.weight[k] * sum_of_texels(layer, t, x, y);
  }
  return {Rgb(sum.v[0], sum.v[1], sum.v[2]), sum.v[3]};
}

ImageSet::ImageSet(std::vector<Image> images) : images_(std::move(images)) {
  for (const Image& image : images_) {
    require(!image.tiles.empty(), "image '" + image.name + "' has no pixels");
    for (const ImageTile& t : image.tiles)
      require(t.width > 0 && t.height > 0 && (t.bytes || t.floats), "image '" + image.name + "' has a tile without pixels");
  }
}

Texel ImageSet::lookup(int index, Vec2 uv, Interpolation interpolation, Extension extension, bool unassociate) const {
  const ImageTile* tile = size_t(index) < images_.size() ? find_tile(images_[size_t(index)], uv) : nullptr;
  if (!tile) return {Rgb(kMissingColor[0], kMissingColor[1], kMissingColor[2]), kMissingColor[3]};
  Rgba c = interpolate(*tile, uv, interpolation, extension);
  const float alpha = c.v[3];
  const bool associated = tile->alpha == AlphaMode::kStraight || tile->alpha == AlphaMode::kPremultiplied;
  if (unassociate && associated && alpha != 1.0f && alpha != 0.0f) c = (1.0f / alpha) * c;
  if (tile->bytes && tile->srgb)
    for (int i = 0; i < 3; ++i) c.v[i] = srgb_to_linear(c.v[i]);
  return {Rgb(c.v[0], c.v[1], c.v[2]), alpha};
}

bool ImageSet::same_as(const ImageSet& other) const {
  const auto same_tile = [](const ImageTile& a, const ImageTile& b) {
    return a.bytes == b.bytes && a.floats == b.floats && a.srgb == b.srgb && a.alpha == b.alpha && a.number == b.number;
  };
  const auto same = [&](const Image& a, const Image& b) {
    return a.tiled == b.tiled && std::equal(a.tiles.begin(), a.tiles.end(), b.tiles.begin(), b.tiles.end(), same_tile);
  };
  return std::equal(images_.begin(), images_.end(), other.images_.begin(), other.images_.end(), same);
}

size_t ImageSet::memory_bytes() const {
  size_t n = 0;
  for (const Image& image : images_)
    for (const ImageTile& t : image.tiles) n += t.byte_size();
  return n;
}

}  // namespace gi
