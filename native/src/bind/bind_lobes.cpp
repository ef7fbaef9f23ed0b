// One lobe at a time for the tests: made by name and parameters, then evaluated and sampled over arrays of directions.
// Directions are local, z the normal; those of whole mixes (Bsdf) are in the world.
#include "bind/bind.h"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <map>

#include "core/check.h"
#include "shading/bsdf.h"
#include "shading/lobes/lobes.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

using Input = nb::ndarray<const float, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Output = nb::ndarray<nb::numpy, float>;

struct Parameters {
  std::map<std::string, std::vector<float>> values;
  float f(const char* name, float otherwise) const {
    const auto it = values.find(name);
    return it == values.end() ? otherwise : it->second.at(0);
  }
  Rgb c(const char* name, Rgb otherwise) const {
    const auto it = values.find(name);
    if (it == values.end()) return otherwise;
    const auto& v = it->second;
    return v.size() == 1 ? Rgb(v[0]) : Rgb(v.at(0), v.at(1), v.at(2));
  }
};

Fresnel bare_fresnel(const Parameters& p) {
  const float ior = p.f("ior", 1.0f);
  switch (int(p.f("fresnel", 0.0f))) {
    case 1: return Fresnel::dielectric(ior);
    case 2:
      return Fresnel::schlick(ior, p.c("f0", Rgb(f0_from_ior(ior))), p.c("f90", Rgb(1.0f)), p.c("reflection_tint", Rgb(1.0f)),
                              p.c("transmission_tint", Rgb(1.0f)), p.f("exponent", -1.0f));
    case 3: return Fresnel::f82_tint(p.c("f0", Rgb(0.8f)), p.c("edge_tint", Rgb(1.0f)));
    case 4: return Fresnel::conductor(p.c("n", Rgb(1.0f)), p.c("k", Rgb(1.0f)));
    default: return Fresnel::none(ior);
  }
}

Fresnel make_fresnel(const Parameters& p) { return bare_fresnel(p).with_film(p.f("film_thickness", 0.0f), p.f("film_ior", 1.33f)); }

template <class D>
Microfacet<D> make_microfacet(const std::string& side, const Parameters& p) {
  const Fresnel fresnel = make_fresnel(p);
  const float alpha = p.f("alpha", 0.25f);
  Microfacet<D> lobe = side == "reflection"   ? Microfacet<D>::reflection(p.f("alpha_x", alpha), p.f("alpha_y", alpha), fresnel)
                       : side == "refraction" ? Microfacet<D>::refraction(alpha, fresnel)
                                              : Microfacet<D>::glass(alpha, fresnel);
  const float cos_o = p.f("preserve_energy_at", -1.0f);
  if (cos_o >= 0.0f && p.values.contains("mean"))
    lobe.preserve_energy(cos_o, p.c("mean", Rgb(1.0f)));
  else if (cos_o >= 0.0f)
    lobe.preserve_energy(cos_o);
  return lobe;
}

Lobe make_lobe(const std::string& name, const Parameters& p) {
  if (name == "lambert") return Lambert{};
  if (name.starts_with("ggx_")) return make_microfacet<Ggx>(name.substr(4), p);
  if (name.starts_with("beckmann_")) return make_microfacet<Beckmann>(name.substr(9), p);
  if (name == "oren_nayar") return OrenNayar(p.c("color", Rgb(0.8f)), p.f("roughness", 1.0f), p.f("transmits", 0.0f) != 0.0f);
  if (name == "translucent") return Translucent{};
  if (name == "thin_transmission") return ThinTransmission(p.f("alpha", 0.25f), p.f("cos_o", 1.0f));
  if (name == "sheen") return Sheen(p.f("roughness", 0.5f), p.f("cos_o", 1.0f));
  if (name == "velvet") return Velvet(p.f("sigma", 0.5f));
  if (name == "toon") return Toon(p.f("size", 0.5f), p.f("smooth", 0.0f), p.f("glossy", 0.0f) != 0.0f);
  if (name.starts_with("hair_strand"))
    return HairStrand::make({1, 0, 0}, p.f("along", 0.1f), p.f("around", 0.3f), p.f("offset", 0.0f), name == "hair_strand_through");
  if (name == "hair_chiang")
    return HairChiang::make(p.c("sigma", Rgb()), p.f("along", 0.3f), p.f("around", 0.3f), p.f("coat", 0.0f), p.f("offset", 0.035f),
                            p.f("ior", 1.55f), p.f("h", 0.0f));
  if (name == "hair_huang")
    return HairHuang::make({p.c("sigma", Rgb()), p.f("roughness", 0.3f), p.f("offset", 0.035f), p.f("ior", 1.55f), p.f("aspect", 1.0f),
                            p.f("r", 1.0f), p.f("tt", 1.0f), p.f("trt", 1.0f)});
  if (name == "ashikhmin_shirley") return AshikhminShirley::make(p.f("alpha_x", 0.25f), p.f("alpha_y", 0.25f));
  throw InputError("unknown lobe: " + name);
}

Output make_output(size_t rows, size_t columns, float** data) {
  *data = new float[rows * columns]();
  nb::capsule owner(*data, [](void* p) noexcept { delete[] static_cast<float*>(p); });
  return Output(*data, {rows, columns}, owner);
}
void store(float* row, Rgb c) { row[0] = c.r(), row[1] = c.g(), row[2] = c.b(); }
Vec3 row_of(const Input& a, size_t i) { return {a(i, 0), a(i, 1), a(i, 2)}; }

using Values = std::map<std::string, std::vector<float>>;

// Columns: value r g b, pdf.
Output lobe_eval(const std::string& name, const Values& values, Input wo, Input wi) {
  const Lobe lobe = make_lobe(name, {values});
  float* data;
  Output out = make_output(wi.shape(0), 4, &data);
  std::visit(
      [&](const auto& l) {
        for (size_t i = 0; i < wi.shape(0); ++i) {
          const LobeEval e = l.eval(row_of(wo, wo.shape(0) == 1 ? 0 : i), row_of(wi, i));
          store(data + 4 * i, e.value), data[4 * i + 3] = e.pdf_dir;
        }
      },
      lobe);
  return out;
}

// `u` is three numbers a sample. Columns: wi, value, pdf, flags, roughness; zero rows where there is no sample.
Output lobe_sample(const std::string& name, const Values& values, Input wo, Input u) {
  const Lobe lobe = make_lobe(name, {values});
  float* data;
  Output out = make_output(u.shape(0), 9, &data);
  std::visit(
      [&](const auto& l) {
        for (size_t i = 0; i < u.shape(0); ++i) {
          const Vec3 r = row_of(u, i);
          const auto s = l.sample(row_of(wo, wo.shape(0) == 1 ? 0 : i), {r.x, r.y}, r.z);
          if (!s) continue;
          float* row = data + 9 * i;
          store(row, {s->wi.x, s->wi.y, s->wi.z}), store(row + 3, s->value);
          row[6] = s->pdf_dir, row[7] = s->flags, row[8] = s->roughness;
        }
      },
      lobe);
  return out;
}

Output lobe_albedo(const std::string& name, const Values& values, Input wo) {
  const Lobe lobe = make_lobe(name, {values});
  float* data;
  Output out = make_output(wo.shape(0), 3, &data);
  std::visit(
      [&](const auto& l) {
        for (size_t i = 0; i < wo.shape(0); ++i) store(data + 3 * i, l.albedo(row_of(wo, i)));
      },
      lobe);
  return out;
}

// A mix of lobes: each of name, parameters, weight and normal, as rows of equal length.
struct Mix {
  Bsdf bsdf;
  void begin(std::vector<float> ng, std::vector<float> ns, std::vector<float> transparency) {
    bsdf.clear(vec(ng), vec(ns));
    bsdf.transparency = Rgb(vec(transparency));
  }
  void add(const std::string& name, const Values& values, std::vector<float> weight, std::vector<float> normal) {
    std::visit([&](const auto& lobe) { bsdf.add(Rgb(vec(weight)), lobe, Frame::from_normal(vec(normal))); }, make_lobe(name, {values}));
  }
  // Columns as lobe_eval and lobe_sample; a single wo.
  Output eval(std::vector<float> wo, Input wi, int flags) {
    bsdf.finish(vec(wo));
    float* data;
    Output out = make_output(wi.shape(0), 4, &data);
    for (size_t i = 0; i < wi.shape(0); ++i) {
      const LobeEval e = flags ? bsdf.eval(vec(wo), row_of(wi, i), uint8_t(flags)) : bsdf.eval(vec(wo), row_of(wi, i));
      store(data + 4 * i, e.value), data[4 * i + 3] = e.pdf_dir;
    }
    return out;
  }
  Output sample(std::vector<float> wo, Input u) {
    bsdf.finish(vec(wo));
    float* data;
    Output out = make_output(u.shape(0), 9, &data);
    for (size_t i = 0; i < u.shape(0); ++i) {
      const Vec3 r = row_of(u, i);
      const auto s = bsdf.sample(vec(wo), {r.x, r.y}, r.z);
      if (!s) continue;
      float* row = data + 9 * i;
      store(row, {s->wi.x, s->wi.y, s->wi.z}), store(row + 3, s->value);
      row[6] = s->pdf_dir, row[7] = s->flags, row[8] = s->roughness;
    }
    return out;
  }
  std::vector<float> albedo(std::vector<float> wo) {
    const Rgb a = bsdf.albedo(vec(wo));
    return {a.r(), a.g(), a.b()};
  }
  static Vec3 vec(const std::vector<float>& v) { return {v.at(0), v.at(1), v.at(2)}; }
};

}  // namespace

void bind_lobes(nb::module_& m) {
  m.def("lobe_eval", &lobe_eval);
  m.def("lobe_sample", &lobe_sample);
  m.def("lobe_albedo", &lobe_albedo);
  nb::class_<Mix>(m, "TestBsdf")
      .def(nb::init<>())
      .def("begin", &Mix::begin)
      .def("add", &Mix::add)
      .def("eval", &Mix::eval, nb::arg("wo"), nb::arg("wi"), nb::arg("flags") = 0)
      .def("sample", &Mix::sample)
      .def("albedo", &Mix::albedo);
}

}  // namespace gi::bind
