// Irradiance records and caches for the tests: gathered over the emission of a scene's surfaces, inserted, looked up and timed.
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <ctime>

#include "bind/bind.h"
#include "bind/read_scene.h"
#include "core/sampler.h"
#include "transport/irradiance_gather.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

using Rows = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Numbers = nb::ndarray<const float, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<nb::numpy, float>;

Vec3 row_of(const Rows& a, size_t i) {
  if (a.shape(0) == 1) i = 0;
  return {a(i, 0), a(i, 1), a(i, 2)};
}

Table make_table(size_t rows, size_t columns, float** data) {
  *data = new float[rows * columns]();
  nb::capsule owner(*data, [](void* p) noexcept { delete[] static_cast<float*>(p); });
  return Table(*data, {rows, columns}, owner);
}

// Directions of a guide that rays from `seen` have met light along: x, y, z and weight for each row of `random` (cell, and two within it).
Table guided_directions(Rows seen, Numbers light, Rows random) {
  IrradianceGuide guide;
  for (size_t i = 0; i < seen.shape(0); ++i) {
    const Sighting s(row_of(seen, i), 1.0f, light(i));
    guide.add(s.local(), s.luminance());
  }
  guide.settle();
  float* data;
  Table out = make_table(random.shape(0), 4, &data);
  for (size_t i = 0; i < random.shape(0); ++i) {
    const Vec3 u = row_of(random, i);
    const IrradianceGuide::Direction d = guide.sample(u.x, {u.y, u.z});
    const float row[4] = {d.local.x, d.local.y, d.local.z, d.weight};
    std::copy(row, row + 4, data + 4 * i);
  }
  return out;
}

class TestIrradiance {
 public:
  TestIrradiance(nb::handle data, const std::string& embree, float error) : cache_({}, error) {
    SceneData native = read_scene(data);
    std::unique_ptr<ShaderResources> resources = read_resources(data);
    std::vector<std::string> warnings;
    validate(native, warnings);
    scene_ = std::make_unique<Scene>(std::move(native), std::move(resources), embree, 1);
    cache_ = IrradianceCache(scene_->bounds(), error);
  }

  // Columns: irradiance, radius, gradient by position (x, y, z), lateral vector irradiance (x, y, z), nearest distance; first channel.
  Table gather(Rows position, Rows normal, int samples, uint32_t seed) const {
    float* data;
    Table out = make_table(position.shape(0), 9, &data);
    for (size_t i = 0; i < position.shape(0); ++i) {
      const GatheredIrradiance g = gather_at(row_of(position, i), row_of(normal, i), samples, seed + uint32_t(i));
      const IrradianceRecord& r = g.record;
      const float values[9] = {
          r.irradiance.r(), r.radius, r.translation[0].r(), r.translation[1].r(), r.translation[2].r(), r.lateral[0].r(), r.lateral[1].r(),
          r.lateral[2].r(), g.nearest};
      std::copy(values, values + 9, data + 9 * i);
    }
    return out;
  }

  // Records by gathering, with radii of the caller's.
  void insert(Rows position, Rows normal, Numbers radius, int samples, uint32_t seed) {
    for (size_t i = 0; i < position.shape(0); ++i) {
      IrradianceRecord r = gather_at(row_of(position, i), row_of(normal, i), samples, seed + uint32_t(i)).record;
      r.radius = radius(i);
      cache_.insert(r);
    }
  }
  // Records of a linear function of the place: irradiance = 1 + gradient · position.
  void insert_linear(Rows position, Rows normal, Numbers radius, Rows gradient) {
    for (size_t i = 0; i < position.shape(0); ++i) {
      IrradianceRecord r;
      r.position = row_of(position, i), r.normal = row_of(normal, i), r.radius = radius(i);
      const Vec3 g = row_of(gradient, 0);
      r.irradiance = Rgb(1.0f + dot(g, r.position));
      for (int axis = 0; axis < 3; ++axis) r.translation[axis] = Rgb(g[axis]);
      cache_.insert(r);
    }
  }
  void freeze() { cache_.freeze(); }

  // Columns: irradiance (−1: none holds), records used, distance of the nearest, whether covered.
  Table find(Rows position, Rows normal, Rows bumped) const {
    float* data;
    Table out = make_table(position.shape(0), 4, &data);
    for (size_t i = 0; i < position.shape(0); ++i) {
      float* row = data + 4 * i;
      const auto found = cache_.find(row_of(position, i), row_of(normal, i), row_of(bumped, i));
      row[0] = found ? found->irradiance.r() : -1.0f;
      if (found) row[1] = float(found->records), row[2] = found->nearest;
      row[3] = cache_.covers(row_of(position, i), row_of(normal, i));
    }
    return out;
  }

  Table radii() const {
    float* data;
    Table out = make_table(cache_.records().size(), 1, &data);
    for (size_t i = 0; i < cache_.records().size(); ++i) data[i] = cache_.records()[i].radius;
    return out;
  }

  // Processor seconds of looking up all, in order.
  double time(Rows position, Rows normal) const {
    float sum = 0;
    const std::clock_t start = std::clock();
    for (size_t i = 0; i < position.shape(0); ++i) {
      const Vec3 n = row_of(normal, i);
      if (const auto found = cache_.find(row_of(position, i), n, n)) sum += found->irradiance.r();
    }
    const double seconds = double(std::clock() - start) / CLOCKS_PER_SEC;
    return sum >= 0.0f ? seconds : -1.0;
  }

 private:
  GatheredIrradiance gather_at(Vec3 position, Vec3 normal, int samples, uint32_t stream) const {
    return gather_irradiance(
        position, normal, samples, [&](int i) { return Sampler(1, stream, uint32_t(i)).next_2d(); },
        [&](int, Vec3 direction) -> GatheredRay {
          const Ray ray{position, direction, 1e-5f, kInf};
          const auto hit = scene_->intersect(ray, kRayDiffuse);
          if (!hit) return {};
          ShadingPoint point = scene_->shading_point(ray, *hit, {});
          return {scene_->emission(point), hit->t};
        });
  }

  std::unique_ptr<Scene> scene_;
  IrradianceCache cache_;
};

}  // namespace

void bind_irradiance(nb::module_& m) {
  m.def("guided_directions", &guided_directions, nb::arg("seen"), nb::arg("light"), nb::arg("random"));
  nb::class_<TestIrradiance>(m, "TestIrradiance")
      .def(nb::init<nb::handle, const std::string&, float>(), nb::arg("scene"), nb::arg("embree"), nb::arg("error"))
      .def("gather", &TestIrradiance::gather, nb::arg("position"), nb::arg("normal"), nb::arg("samples"), nb::arg("seed") = 1)
      .def("insert", &TestIrradiance::insert, nb::arg("position"), nb::arg("normal"), nb::arg("radius"), nb::arg("samples"),
           nb::arg("seed") = 1)
      .def("insert_linear", &TestIrradiance::insert_linear)
      .def("freeze", &TestIrradiance::freeze)
      .def("find", &TestIrradiance::find)
      .def("radii", &TestIrradiance::radii)
      .def("time", &TestIrradiance::time);
}

}  // namespace gi::bind
