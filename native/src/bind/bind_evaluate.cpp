// What a program emits at given points, for the tests of textures and other values: images but no geometry or attributes.
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "bind/bind.h"
#include "shading/program.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

using Positions = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;

nb::ndarray<nb::numpy, float> emission(nb::handle scene, int program, Positions positions, std::tuple<float, float, float> normal) {
  const std::unique_ptr<ShaderResources> resources = read_resources(scene);
  const nb::object data = scene.attr("programs")[program];
  const auto list = [&data](const char* field) { return data.attr(field).attr("tolist")(); };
  const Program compiled("test", nb::cast<std::vector<int32_t>>(list("code")), nb::cast<std::vector<float>>(list("constants")),
                         nb::cast<int>(data.attr("register_count")), nb::cast<std::vector<float>>(list("tables")));
  const size_t n = positions.shape(0);
  float* values = new float[3 * n]();
  nb::capsule owner(values, [](void* p) noexcept { delete[] static_cast<float*>(p); });
  for (size_t i = 0; i < n; ++i) {
    ShadingPoint point;
    point.position = point.object_position = {positions(i, 0), positions(i, 1), positions(i, 2)};
    point.ng = point.ns = point.wo = {std::get<0>(normal), std::get<1>(normal), std::get<2>(normal)};
    Bsdf bsdf;
    bsdf.clear(point.ng, point.ns);
    compiled.run(point, *resources, &bsdf);
    for (int k = 0; k < 3; ++k) values[3 * i + size_t(k)] = bsdf.emission[k];
  }
  return nb::ndarray<nb::numpy, float>(values, {n, 3}, owner);
}

}  // namespace

void bind_evaluate(nb::module_& m) {
  m.def("emission", emission, nb::arg("scene"), nb::arg("program"), nb::arg("positions"), nb::arg("normal"),
        "Radiance, (n, 3), that a program of a scene_data.Scene emits at positions (n, 3) seen along their normal.");
}

}  // namespace gi::bind
