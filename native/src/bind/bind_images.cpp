// Images for Python: reading scene_data.Image tiles (shapes and dtypes are checked here, pixels are shared with NumPy), making
// bytes of floats, and the tables of sky models.
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include "bind/bind.h"
#include "core/check.h"
#include "shading/images.h"
#include "shading/sky/sky.h"

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
  if (bytes)
    t.bytes = static_cast<const uint8_t*>(data);
  else
    t.floats = static_cast<const float*>(data);
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

using Floats = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Bytes = nb::ndarray<uint8_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;

void quantize(Floats values, Bytes out) {
  require(values.size() == out.size(), "quantize: both arrays must have the same size");
  const float* from = values.data();
  uint8_t* to = out.data();
  const size_t n = values.size();
  const nb::gil_scoped_release release;
  for (size_t i = 0; i < n; ++i) to[i] = uint8_t(int(std::min(std::max(from[i], 0.0f), 1.0f) * 255.0f + 0.5f));
}

// (H, W, 4) float32 pixels, and the sun's radiance at the lower and the upper edge of its disc.
nb::tuple sky(bool multiple, float sun_elevation, float sun_size, float altitude, float air, float aerosol, float ozone) {
  const Atmosphere a{altitude, air, aerosol, ozone};
  SunDisc sun;
  std::vector<float>* pixels = nullptr;
  SkyTable table;
  {
    const nb::gil_scoped_release release;
    table = multiple ? multiple_scattering_sky(sun_elevation, a) : single_scattering_sky(sun_elevation, a);
    sun = multiple ? multiple_scattering_sun(sun_elevation, sun_size, a) : single_scattering_sun(sun_elevation, sun_size, a);
    pixels = new std::vector<float>();
    pixels->reserve(table.pixels.size() * 4);
    for (const Rgb& c : table.pixels) pixels->insert(pixels->end(), {c.r(), c.g(), c.b(), 1.0f});
  }
  nb::capsule owner(pixels, [](void* p) noexcept { delete static_cast<std::vector<float>*>(p); });
  nb::ndarray<nb::numpy, float> array(pixels->data(), {size_t(table.height), size_t(table.width), 4}, owner);
  return nb::make_tuple(array, nb::make_tuple(sun.bottom.r(), sun.bottom.g(), sun.bottom.b()),
                        nb::make_tuple(sun.top.r(), sun.top.g(), sun.top.b()));
}

// The 30 floats of a HosekWilkieSky.
nb::list hosek_wilkie(float turbidity, float albedo, float sun_elevation) {
  const HosekWilkieSky sky = hosek_wilkie_sky(turbidity, albedo, sun_elevation);
  nb::list numbers;
  for (const HosekWilkieSky::Channel& c : sky.xyz) {
    numbers.append(c.radiance);
    for (const float x : c.shape) numbers.append(x);
  }
  return numbers;
}

}  // namespace

void bind_images(nb::module_& m) {
  m.def("quantize", quantize, nb::arg("values"), nb::arg("out"), "Writes floats of [0, 1] as bytes, rounded; both arrays are flat.");
  m.def("sky", sky, nb::arg("multiple"), nb::arg("sun_elevation"), nb::arg("sun_size"), nb::arg("altitude"), nb::arg("air"),
        nb::arg("aerosol"), nb::arg("ozone"),
        "The table of a sky model, (H, W, 4) float32, and the sun's radiance at its lower and upper edge.");
  m.def("sky_hosek_wilkie", hosek_wilkie, nb::arg("turbidity"), nb::arg("albedo"), nb::arg("sun_elevation"),
        "Hosek and Wilkie's sky: for X, Y, Z each the mean radiance and nine shape parameters.");
}

std::unique_ptr<ShaderResources> read_resources(nb::handle scene) {
  std::vector<Image> images;
  for (nb::handle tiles : scene.attr("images")) images.push_back(read_image(tiles));
  auto resources = std::make_unique<ShaderResources>();
  resources->images = std::make_shared<const ImageSet>(std::move(images));
  return resources;
}

}  // namespace gi::bind
