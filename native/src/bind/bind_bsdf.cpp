// One shaded point for the tests: a program run at a point whose normal is z, and the mix of lobes it makes evaluated and
// sampled over arrays. Leaves out geometry, attributes and images.
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "bind/bind.h"
#include "shading/program.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

using Input = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Output = nb::ndarray<nb::numpy, float>;
using Triple = std::tuple<float, float, float>;

Vec3 vec(const Triple& t) { return {std::get<0>(t), std::get<1>(t), std::get<2>(t)}; }
Triple triple(Rgb c) { return {c.r(), c.g(), c.b()}; }
Vec3 row(const Input& a, size_t i) { return {a(i, 0), a(i, 1), a(i, 2)}; }

class ShadedPoint {
 public:
  ShadedPoint(std::vector<int32_t> code, std::vector<float> constants, int registers, std::vector<float> tables, Triple wo, bool backfacing)
      : wo_(normalize(vec(wo))) {
    const Program program("test", std::move(code), std::move(constants), registers, std::move(tables));
    ShadingPoint point;
    point.wo = wo_, point.ng = point.ns = {0, 0, 1}, point.backfacing = backfacing;
    const ShaderResources nothing{};
    bsdf_.clear(point.ng, point.ns);
    program.run(point, nothing, &bsdf_);
    bsdf_.finish(wo_);
  }

  Output eval(Input wi) const {  // columns: value, pdf
    Output out = make(wi.shape(0), 4);
    for (size_t i = 0; i < wi.shape(0); ++i) {
      const LobeEval e = bsdf_.eval(wo_, row(wi, i));
      float* r = out.data() + 4 * i;
      r[0] = e.value.r(), r[1] = e.value.g(), r[2] = e.value.b(), r[3] = e.pdf_dir;
    }
    return out;
  }
  Output sample(Input u) const {  // columns: wi, value, pdf, flags, roughness; zero rows where there is no sample
    Output out = make(u.shape(0), 9);
    for (size_t i = 0; i < u.shape(0); ++i) {
      const Vec3 x = row(u, i);
      const auto s = bsdf_.sample(wo_, {x.x, x.y}, x.z);
      if (!s) continue;
      const float values[9] = {s->wi.x,      s->wi.y,    s->wi.z,         s->value.r(), s->value.g(),
                               s->value.b(), s->pdf_dir, float(s->flags), s->roughness};
      std::copy(values, values + 9, out.data() + 9 * i);
    }
    return out;
  }
  const Bsdf& bsdf() const { return bsdf_; }
  Vec3 wo() const { return wo_; }

 private:
  static Output make(size_t rows, size_t columns) {
    float* data = new float[rows * columns]();
    nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<float*>(p); });
    return Output(data, {rows, columns}, owner);
  }
  Bsdf bsdf_;
  Vec3 wo_;
};

}  // namespace

void bind_bsdf(nb::module_& m) {
  nb::class_<ShadedPoint>(m, "ShadedPoint")
      .def(nb::init<std::vector<int32_t>, std::vector<float>, int, std::vector<float>, Triple, bool>(), nb::arg("code"),
           nb::arg("constants"), nb::arg("register_count"), nb::arg("tables"), nb::arg("wo"), nb::arg("backfacing") = false)
      .def("eval", &ShadedPoint::eval)
      .def("sample", &ShadedPoint::sample)
      .def_prop_ro("albedo", [](const ShadedPoint& p) { return triple(p.bsdf().albedo(p.wo())); })
      .def_prop_ro("emission", [](const ShadedPoint& p) { return triple(p.bsdf().emission); })
      .def_prop_ro("transparency", [](const ShadedPoint& p) { return triple(p.bsdf().transparency); })
      .def_prop_ro("lobe_count", [](const ShadedPoint& p) { return p.bsdf().lobe_count(); });
}

}  // namespace gi::bind
