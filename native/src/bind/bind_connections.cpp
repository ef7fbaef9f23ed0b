// How paths are joined, for the tests: which light vertices an eye vertex is joined to, and points to the lens.
// Leaves out what lies between.
#include <nanobind/ndarray.h>

#include "bind/bind.h"
#include "bind/read_scene.h"
#include "scene/camera_lens.h"
#include "transport/light_choice.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

using Rows = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Pairs = nb::ndarray<const float, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using Column = nb::ndarray<const float, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Table = nb::ndarray<nb::numpy, float, nb::ndim<2>>;

Vec3 vec3_of(const Rows& a, size_t i) { return {a(i, 0), a(i, 1), a(i, 2)}; }
Vec2 vec2_of(const Pairs& a, size_t i) { return {a(i, 0), a(i, 1)}; }

template <size_t N>
Table table_of(const std::vector<std::array<float, N>>& rows) {
  auto* data = new float[rows.size() * N];
  for (size_t i = 0; i < rows.size(); ++i) std::copy(rows[i].begin(), rows[i].end(), data + i * N);
  return Table(data, {rows.size(), N}, nb::capsule(data, [](void* p) noexcept { delete[] static_cast<float*>(p); }));
}

class TestLightChoice {
 public:
  // Of light vertices: positions, normals towards the light, power, whether they scatter to both sides.
  TestLightChoice(Rows positions, Rows normals, Column powers, Column both_sides) {
    for (size_t i = 0; i < positions.shape(0); ++i)
      choice_.add(vec3_of(positions, i), vec3_of(normals, i), powers(i), both_sides(i) > 0.0f, uint32_t(i));
  }

  // One draw for each u. Columns: number of the draw, vertex, how often it is drawn on average, what is left of u.
  Table draw(Rows position, Rows normal, bool both_sides, int count, Column u) const {
    std::vector<std::array<float, 4>> rows;
    for (size_t i = 0; i < u.shape(0); ++i)
      choice_.draw(vec3_of(position, 0), vec3_of(normal, 0), both_sides, count, u(i),
                   [&](uint32_t k, float times, float left) { rows.push_back({float(i), float(k), times, left}); });
    return table_of(rows);
  }

 private:
  LightChoice choice_;
};

class TestLens {
 public:
  explicit TestLens(nb::handle camera) : camera_(read_camera(camera)) {}

  // Origins and directions.
  Table rays(Pairs film, Pairs u_lens) const {
    std::vector<std::array<float, 6>> rows;
    for (size_t i = 0; i < film.shape(0); ++i) {
      const Ray r = camera_.sample(vec2_of(film, i), {1e-3f, 1e-3f}, vec2_of(u_lens, i)).ray;
      rows.push_back({r.origin.x, r.origin.y, r.origin.z, r.direction.x, r.direction.y, r.direction.z});
    }
    return table_of(rows);
  }

  // Columns: direction to the lens, how far the camera's ray goes, film, density, and the same as the camera's ray has it; density 0
  // where the camera does not see the point.
  Table join(Rows positions, Pairs u_lens) const {
    std::vector<std::array<float, 8>> rows;
    for (size_t i = 0; i < positions.shape(0); ++i) {
      const Vec3 p = vec3_of(positions, i);
      const auto s = sample_lens(camera_, p, vec2_of(u_lens, i));
      if (!s) {
        rows.push_back({});
        continue;
      }
      const float by_ray = lens_density(camera_, {p + s->wi * s->free, -s->wi}, s->free);
      rows.push_back({s->wi.x, s->wi.y, s->wi.z, s->free, s->film.x, s->film.y, s->density, by_ray});
    }
    return table_of(rows);
  }

 private:
  Camera camera_;
};

}  // namespace

void bind_connections(nb::module_& m) {
  nb::class_<TestLightChoice>(m, "TestLightChoice")
      .def(nb::init<Rows, Rows, Column, Column>(), nb::arg("positions"), nb::arg("normals"), nb::arg("powers"), nb::arg("both_sides"))
      .def("draw", &TestLightChoice::draw, nb::arg("position"), nb::arg("normal"), nb::arg("both_sides"), nb::arg("count"), nb::arg("u"));
  nb::class_<TestLens>(m, "TestLens")
      .def(nb::init<nb::handle>(), nb::arg("camera"))
      .def("rays", &TestLens::rays, nb::arg("film"), nb::arg("u_lens"))
      .def("join", &TestLens::join, nb::arg("positions"), nb::arg("u_lens"));
}

}  // namespace gi::bind
