// The tree of points, for the tests.
#include <nanobind/ndarray.h>

#include "bind/bind.h"
#include "core/point_tree.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

using Rows = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Indices = nb::ndarray<nb::numpy, int64_t, nb::ndim<2>>;

class TestPoints {
 public:
  TestPoints(Rows points, int threads) {
    ThreadPool pool(threads);
    tree_ = PointTree(vectors(points), pool);
  }

  // (n, count): the nearest within `radius` of each place, −1 where there are fewer.
  Indices nearest(Rows places, size_t count, float radius) const {
    const std::vector<Vec3> at = vectors(places);
    auto* data = new int64_t[at.size() * count];
    std::fill_n(data, at.size() * count, -1);
    std::vector<PointTree::Found> found;
    for (size_t i = 0; i < at.size(); ++i) {
      tree_.nearest(at[i], count, radius * radius, found);
      for (size_t k = 0; k < found.size(); ++k) data[i * count + k] = tree_.order()[found[k].point];
    }
    return Indices(data, {at.size(), count}, nb::capsule(data, [](void* p) noexcept { delete[] static_cast<int64_t*>(p); }));
  }

 private:
  static std::vector<Vec3> vectors(const Rows& rows) {
    std::vector<Vec3> out;
    for (size_t i = 0; i < rows.shape(0); ++i) out.push_back({rows(i, 0), rows(i, 1), rows(i, 2)});
    return out;
  }
  PointTree tree_;
};

}  // namespace

void bind_points(nb::module_& m) {
  nb::class_<TestPoints>(m, "TestPoints")
      .def(nb::init<Rows, int>(), nb::arg("points"), nb::arg("threads") = 1)
      .def("nearest", &TestPoints::nearest, nb::arg("places"), nb::arg("count"), nb::arg("radius") = 1e18f);
}

}  // namespace gi::bind
