// Reading scene_data.Image tiles: shapes and dtypes are checked here, pixels are shared with NumPy.
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include "bind/bind.h"
#include "core/check.h"
#include "shading/images.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

AlphaMode read_alpha(const std::string& mode, const std::string& who) {
  if (mode == "STRAIGHT") return AlphaMode::kStraight;
  if (mode == "PREMULTIPLIED") return AlphaMode::kPremultiplied;
  if (mode == "CHANNEL_PACKED") return AlphaMode::kChannelPacked;
  require(mode == "NONE", who + ": 'alpha' must be one of STRAIGHT, PREMULTIPLIED, CHANNEL_PACKED, NONE, not '" + mode + "'");
  return AlphaMode::kNone;
}

ImageTile read_tile(nb::handle tile, const std::string& who) {
  using Pixels = nb::ndarray<nb::ro, nb::c_contig, nb::device::cpu>;
  Pixels pixels;
  require(nb::try_cast(nb::object(tile.attr("pixels")), pixels), who + ": 'pixels' must be a C-contiguous NumPy array");
  const bool bytes = pixels.dtype() == nb::dtype<uint8_t>();
  require(bytes || pixels.dtype() == nb::dtype<float>(), who + ": 'pixels' must be uint8 or float32");
  require(pixels.ndim() == 3 && pixels.shape(2) == 4, who + ": 'pixels' must have the shape (height, width, 4)");
  require(pixels.shape(0) < (1u << 30) && pixels.shape(1) < (1u << 30), who + " is too large");

  ImageTile t;
  t.height = int(pixels.shape(0)), t.width = int(pixels.shape(1));
  const void* data = pixels.data();
  if (bytes) t.bytes = static_cast<const uint8_t*>(data);
  else t.floats = static_cast<const float*>(data);
  t.srgb = nb::cast<bool>(tile.attr("srgb"));
  t.alpha = read_alpha(nb::cast<std::string>(tile.attr("alpha")), who);
  t.number = nb::cast<int>(tile.attr("tile"));
  // ndarray counts its references by itself, without the interpreter's lock.
  t.owner = std::make_shared<Pixels>(std::move(pixels));
  return t;
}

Image read_image(nb::handle tiles) {
  Image image;
  for (nb::handle tile : tiles) {
    image.name = nb::cast<std::string>(tile.attr("name"));
    image.tiles.push_back(read_tile(tile, "image '" + image.name + "'"));
  }
  image.tiled = image.tiles.size() > 1 || (image.tiles.size() == 1 && image.tiles[0].number != 1001);
  return image;
}

}  // namespace

std::unique_ptr<ShaderResources> read_resources(nb::handle scene) {
  std::vector<Image> images;
  for (nb::handle tiles : scene.attr("images")) images.push_back(read_image(tiles));
  auto resources = std::make_unique<ShaderResources>();
  resources->images = std::make_shared<const ImageSet>(std::move(images));
  return resources;
}

}  // namespace gi::bind
