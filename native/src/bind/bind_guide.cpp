// The tree that says where particles are worth sending, for the tests.
#include <nanobind/ndarray.h>

#include "bind/bind.h"
#include "transport/emission_guide.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

using Rows = nb::ndarray<const float, nb::shape<-1, kEmissionAxes>, nb::c_contig, nb::device::cpu>;
using Worths = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<nb::numpy, float, nb::ndim<2>>;

EmissionNumbers row_of(const Rows& rows, size_t i) {
  EmissionNumbers u;
  for (size_t a = 0; a < u.size(); ++a) u[a] = rows(i, a);
  return u;
}

class TestGuide {
 public:
  TestGuide(Rows numbers, Worths worths) {
    std::vector<EmissionGuide::Trial> trials;
    for (size_t i = 0; i < numbers.shape(0); ++i) trials.push_back({row_of(numbers, i), worths(i)});
    guide_ = EmissionGuide(std::move(trials));
  }

  // (n, axes + 1): guided numbers and their density.
  Table warp(Rows numbers) const {
    constexpr size_t kColumns = kEmissionAxes + 1;
    auto* data = new float[numbers.shape(0) * kColumns];
    for (size_t i = 0; i < numbers.shape(0); ++i) {
      EmissionNumbers u = row_of(numbers, i);
      data[(i + 1) * kColumns - 1] = 1.0f / guide_.warp(u);
      std::copy(u.begin(), u.end(), data + i * kColumns);
    }
    return Table(data, {numbers.shape(0), kColumns}, nb::capsule(data, [](void* p) noexcept { delete[] static_cast<float*>(p); }));
  }

 private:
  EmissionGuide guide_;
};

}  // namespace

void bind_guide(nb::module_& m) {
  nb::class_<TestGuide>(m, "TestGuide")
      .def(nb::init<Rows, Worths>(), nb::arg("numbers"), nb::arg("worths"))
      .def("warp", &TestGuide::warp, nb::arg("numbers"))
      .def_ro_static("even", &EmissionGuide::kEven);
}

}  // namespace gi::bind
