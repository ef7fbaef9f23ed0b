// The scene's images and how they are looked up: texel formats, alpha, interpolation, extension, UDIM tiles.
// Leaves out mipmaps: rays are as many as pixels, and passes average.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "core/vec.h"

namespace gi {

enum class Interpolation { kClosest, kLinear, kCubic };
enum class Extension { kRepeat, kExtend, kClip, kMirror };
enum class AlphaMode {
  kStraight,       // colour is independent of alpha in the file; lookups multiply it in first, as Cycles does
  kPremultiplied,  // already multiplied in
  kChannelPacked,  // alpha is another channel
  kNone,           // ignored: opaque
};

// Pixels of one tile, RGBA, row 0 at the bottom; `owner` keeps them alive. One of the two pointers is set.
struct ImageTile {
  const uint8_t* bytes = nullptr;  // encoded
  const float* floats = nullptr;   // scene-linear
  std::shared_ptr<void> owner;
  int width = 0, height = 0;
  bool srgb = false;  // bytes are sRGB; decoded after interpolation, as Cycles does
  AlphaMode alpha = AlphaMode::kStraight;
  int number = 1001;  // UDIM
  size_t byte_size() const { return size_t(width) * size_t(height) * (bytes ? 4 : 16); }
};

struct Image {
  std::string name;
  std::vector<ImageTile> tiles;
  bool tiled = false;  // UDIM: the integer part of the coordinates chooses the tile
};

struct Texel {
  Rgb color;
  float alpha = 1;
};
inline constexpr float kMissingColor[4] = {1, 0, 1, 1};  // where there is no image to look up

class ImageSet {
 public:
  ImageSet() = default;
  // Throws InputError naming the image whose tiles are empty or without pixels.
  explicit ImageSet(std::vector<Image> images);

  // Scene-linear colour at `uv`, where (0, 0) is the lower left corner and (1, 1) the upper right one. With `unassociate`,
  // a straight image's colour is divided by the interpolated alpha again.
  Texel lookup(int image, Vec2 uv, Interpolation interpolation, Extension extension, bool unassociate) const;

  // Whether both hold the very same pixels.
  bool same_as(const ImageSet& other) const;
  size_t size() const { return images_.size(); }
  const Image& operator[](size_t i) const { return images_[i]; }
  size_t memory_bytes() const;

 private:
  std::vector<Image> images_;
};

}  // namespace gi
