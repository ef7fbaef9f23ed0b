// The lights of a scene for the tests: chosen, sampled and found along rays over arrays of points.
// Leaves out what lies between: nothing is in shadow here.
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <ctime>

#include "bind/bind.h"
#include "bind/read_scene.h"
#include "core/sampler.h"
#include "lights/lights.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

using Rows = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
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

class TestLights {
 public:
  TestLights(nb::handle data, const std::string& embree, int threads) {
    SceneData native = read_scene(data);
    std::unique_ptr<ShaderResources> resources = read_resources(data);
    std::vector<std::string> warnings;
    validate(native, warnings);
    scene_ = std::make_unique<Scene>(std::move(native), std::move(resources), embree, threads);
    const std::clock_t start = std::clock();
    lights_ = std::make_unique<LightSet>(*scene_, threads);
    build_seconds = double(std::clock() - start) / CLOCKS_PER_SEC;
  }

  // u: choice and two of the direction. Columns: wi, distance, radiance, pdf_dir, delta, light; light −1 where there is none.
  Table sample(Rows position, Rows normal, Rows u, int light, bool transmission) const {
    float* data;
    Table out = make_table(u.shape(0), 10, &data);
    for (size_t i = 0; i < u.shape(0); ++i) {
      const LightQuery query = make_query(position, normal, i, transmission);
      const Vec3 r = row_of(u, i);
      const auto s = light < 0 ? lights_->sample(query, r.x, {r.y, r.z}) : lights_->sample_light(uint32_t(light), query, {r.y, r.z});
      float* row = data + 10 * i;
      row[9] = -1;
      if (!s) continue;
      const float values[10] = {s->wi.x,         s->wi.y,         s->wi.z,    s->distance,        s->radiance.r(),
                                s->radiance.g(), s->radiance.b(), s->pdf_dir, float(s->is_delta), float(s->light)};
      std::copy(values, values + 10, row);
    }
    return out;
  }

  // Everything that rays from `position` meet, as diffuse rays do. Columns: radiance, and the densities summed.
  Table eval(Rows position, Rows normal, Rows wi, bool transmission, uint32_t visibility) const {
    float* data;
    Table out = make_table(wi.shape(0), 4, &data);
    for (size_t i = 0; i < wi.shape(0); ++i) {
      const LightQuery query = make_query(position, normal, i, transmission);
      const LightEval e = everything(query, {query.position, row_of(wi, i)}, visibility);
      const float values[4] = {e.radiance.r(), e.radiance.g(), e.radiance.b(), e.pdf_dir};
      std::copy(values, values + 4, data + 4 * i);
    }
    return out;
  }

  Table pick_probabilities(Rows position, Rows normal, bool transmission) const {
    float* data;
    Table out = make_table(position.shape(0), lights_->count(), &data);
    for (size_t i = 0; i < position.shape(0); ++i) {
      const LightQuery query = make_query(position, normal, i, transmission);
      for (uint32_t k = 0; k < lights_->count(); ++k) data[i * lights_->count() + k] = lights_->pick_probability(query, k);
    }
    return out;
  }

  float world_share_above(float radiance) const { return lights_->world_share_above(radiance); }

  // u_choice; u: place and direction, in turns. Columns: origin, direction, power, light (−1: none), the power by the ray's density at
  // a point `along` metres further on, and pdf_dir there.
  Table emit(Rows u_place, Rows u_direction, float along) const {
    float* data;
    Table out = make_table(u_place.shape(0), 14, &data);
    for (size_t i = 0; i < u_place.shape(0); ++i) {
      const Vec3 a = row_of(u_place, i), b = row_of(u_direction, i);
      const auto r = lights_->emit(a.x, {a.y, a.z}, {b.x, b.y});
      float* row = data + 14 * i;
      row[9] = -1;
      if (!r) continue;
      const Vec3 o = r->ray.origin, d = r->ray.direction;
      const float values[10] = {o.x, o.y, o.z, d.x, d.y, d.z, r->power.r(), r->power.g(), r->power.b(), float(r->light)};
      std::copy(values, values + 10, row);
      const LightQuery query{o + d * along, -d, false, {}};
      const auto s = lights_->arriving(*r, query);
      if (!s) continue;
      const Rgb power = s->radiance / lights_->pdf_emit(r->light, o + d * along, -d);
      row[10] = power.r(), row[11] = power.g(), row[12] = power.b(), row[13] = s->pdf_dir * lights_->pick_probability(query, r->light);
    }
    return out;
  }

  Table pdf_emit(Rows position, Rows wi, uint32_t light) const {
    float* data;
    Table out = make_table(position.shape(0), 1, &data);
    for (size_t i = 0; i < position.shape(0); ++i) data[i] = lights_->pdf_emit(light, row_of(position, i), row_of(wi, i));
    return out;
  }

  // Processor seconds that `count` samples take at the given points, and their densities at the same.
  nb::tuple time(Rows position, Rows normal, int count) const {
    Sampler sampler(1, 2, 3);
    float sum = 0;
    const std::clock_t start = std::clock();
    for (int i = 0; i < count; ++i) {
      const LightQuery query = make_query(position, normal, size_t(i) % position.shape(0), false);
      const auto s = lights_->sample(query, sampler.next_1d(), sampler.next_2d());
      sum += s ? s->pdf_dir : 0.0f;
    }
    const std::clock_t middle = std::clock();
    for (int i = 0; i < count; ++i) {
      const LightQuery query = make_query(position, normal, size_t(i) % position.shape(0), false);
      sum += lights_->pick_probability(query, hash32(uint32_t(i)) % lights_->count());
    }
    const std::clock_t end = std::clock();
    return nb::make_tuple(double(middle - start) / CLOCKS_PER_SEC, double(end - middle) / CLOCKS_PER_SEC, sum);
  }

  uint32_t count() const { return lights_->count(); }
  std::string description() const { return lights_->description(); }
  double build_seconds = 0;  // of the processor, all threads

 private:
  static LightQuery make_query(const Rows& position, const Rows& normal, size_t i, bool transmission) {
    return {row_of(position, i), row_of(normal, i), transmission, {}};
  }

  LightEval everything(const LightQuery& query, Ray ray, uint32_t visibility) const {
    LightEval sum;
    const auto add = [&](const LightEval& e) { sum.radiance += e.radiance, sum.pdf_dir += e.pdf_dir; };
    for (auto hit = lights_->intersect_lamp(ray, visibility); hit; hit = lights_->intersect_lamp(ray, visibility, &*hit)) {
      add(lights_->eval_lamp(query, ray, *hit));
    }
    for (uint32_t k = 0; k < lights_->sun_count(); ++k) add(lights_->eval_sun(k, query, ray.direction, visibility));
    const PathState path;
    while (const auto hit = scene_->intersect(ray, visibility)) {
      ShadingPoint point = scene_->shading_point(ray, *hit, path);
      add({scene_->emission(point), lights_->pdf_triangle(query, point)});
      ray.t_min = hit->t * 1.00001f + 1e-6f;
    }
    if (scene_->data().world.visibility & visibility) {
      add({scene_->world_radiance(ray.direction, path), lights_->pdf_world(query, ray.direction)});
    }
    return sum;
  }

  std::unique_ptr<Scene> scene_;
  std::unique_ptr<LightSet> lights_;
};

}  // namespace

void bind_lights(nb::module_& m) {
  nb::class_<TestLights>(m, "TestLights")
      .def(nb::init<nb::handle, const std::string&, int>(), nb::arg("scene"), nb::arg("embree"), nb::arg("threads") = 0)
      .def("sample", &TestLights::sample, nb::arg("position"), nb::arg("normal"), nb::arg("u"), nb::arg("light") = -1,
           nb::arg("transmission") = false)
      .def("eval", &TestLights::eval, nb::arg("position"), nb::arg("normal"), nb::arg("wi"), nb::arg("transmission") = false,
           nb::arg("visibility") = uint32_t(kRayDiffuse))
      .def("pick_probabilities", &TestLights::pick_probabilities, nb::arg("position"), nb::arg("normal"), nb::arg("transmission") = false)
      .def("emit", &TestLights::emit, nb::arg("u_place"), nb::arg("u_direction"), nb::arg("along") = 1.0f)
      .def("pdf_emit", &TestLights::pdf_emit)
      .def("world_share_above", &TestLights::world_share_above)
      .def("time", &TestLights::time)
      .def_prop_ro("count", &TestLights::count)
      .def_prop_ro("description", &TestLights::description)
      .def_ro("build_seconds", &TestLights::build_seconds);
}

}  // namespace gi::bind
