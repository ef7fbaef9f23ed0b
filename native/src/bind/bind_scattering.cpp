// How light is spread below surfaces and by particles in water, for the tests.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "bind/bind.h"
#include "shading/diffusion_profile.h"
#include "shading/fournier_forand.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

using Numbers = nb::ndarray<const float, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Floats = nb::ndarray<nb::numpy, float, nb::shape<-1>>;

template <class Function>
Floats of_each(const Numbers& x, const Function& f) {
  auto* data = new float[x.size()];
  for (size_t i = 0; i < x.size(); ++i) data[i] = float(f(x(i)));
  return Floats(data, {x.size()}, nb::capsule(data, [](void* p) noexcept { delete[] static_cast<float*>(p); }));
}

}  // namespace

void bind_scattering(nb::module_& m) {
  nb::class_<DiffusionProfile>(m, "TestDiffusionProfile")
      .def(nb::init<float>(), nb::arg("d"))
      .def("density", [](const DiffusionProfile& p, Numbers r) { return of_each(r, [&](float v) { return p.density(v); }); })
      .def("sample", [](const DiffusionProfile& p, Numbers u) { return of_each(u, [&](float v) { return p.sample(v); }); });
  nb::class_<FournierForand>(m, "TestFournierForand")
      .def(nb::init<float, float>(), nb::arg("backscatter"), nb::arg("ior"))
      .def("density", [](const FournierForand& p, Numbers c) { return of_each(c, [&](float v) { return p.density(v); }); })
      .def("part_within", [](const FournierForand& p, Numbers c) { return of_each(c, [&](float v) { return p.part_within(v); }); })
      .def("sample", [](const FournierForand& p, Numbers u) { return of_each(u, [&](float v) { return p.sample(v); }); });
}

}  // namespace gi::bind
