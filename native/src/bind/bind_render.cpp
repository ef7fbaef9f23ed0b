// Scene, Session and the integrators' descriptors, for Python. The GIL is released while native code works or waits.
#include "bind/bind.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <map>
#include <optional>

#include "bind/read_scene.h"
#include "core/check.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

// The end of a scene or a session frees much memory, and may wait for threads: Python's others go on meanwhile.
struct BoundScene {
  std::unique_ptr<const LitScene> scene;
  std::vector<std::string> warnings;
  std::vector<nb::object> meshes;  // of a movable scene: what each was read from, held so that it is not taken for another

  BoundScene() = default;
  BoundScene(BoundScene&&) = default;
  ~BoundScene() {
    if (!scene) return;
    const nb::gil_scoped_release release;
    scene.reset();
  }
};

struct EndsWithoutGil {
  std::optional<nb::gil_scoped_release> release;
};

struct BoundSession : private EndsWithoutGil, Session {  // bases end in the opposite order
  using Session::Session;
  ~BoundSession() { release.emplace(); }
};

BoundScene* make_scene(nb::handle data, const std::string& embree, int threads, bool movable, const BoundScene* before) {
  auto bound = std::make_unique<BoundScene>();
  KnownMeshes known;
  if (movable && before && !before->meshes.empty()) {
    known.data = &before->scene->scene().data();
    for (size_t m = 0; m < before->meshes.size(); ++m) known.index[before->meshes[m].ptr()] = int32_t(m);
  }
  SceneData native = read_scene(data, known);
  if (movable)
    for (nb::handle mesh : data.attr("meshes")) bound->meshes.push_back(nb::borrow(mesh));
  std::unique_ptr<ShaderResources> resources = read_resources(data);
  const nb::gil_scoped_release release;
  validate(native, bound->warnings);
  const Editing editing{movable, known.data ? &before->scene->scene() : nullptr};
  bound->scene = std::make_unique<LitScene>(std::make_unique<Scene>(std::move(native), std::move(resources), embree, threads, editing));
  return bound.release();
}

// What a pinhole in the middle of each pixel sees of emission alone.
nb::ndarray<nb::numpy, float> emission_seen(const BoundScene& bound, nb::handle data, size_t width, size_t height) {
  const Scene& scene = bound.scene->scene();
  const Camera camera = read_camera(data);
  auto* pixels = new std::vector<float>(width * height * 3);
  nb::capsule owner(pixels, [](void* p) noexcept { delete static_cast<std::vector<float>*>(p); });
  scene.resources().camera = &camera;
  const Vec2 pixel{1.0f / float(width), 1.0f / float(height)};
  for (size_t i = 0; i < width * height; ++i) {
    const Vec2 film{(float(i % width) + 0.5f) * pixel.x, (float(i / width) + 0.5f) * pixel.y};
    const CameraRay r = camera.sample(film, pixel, {0.5f, 0.5f});
    Rgb seen;
    if (const auto hit = scene.intersect(r.ray, kRayCamera)) {
      ShadingPoint point = scene.shading_point(r.ray, *hit, {}, r.footprint + r.spread * hit->t);
      seen = scene.emission(point);
    } else {
      seen = scene.world_radiance(r.ray.direction, {});
    }
    for (int k = 0; k < 3; ++k) (*pixels)[3 * i + size_t(k)] = seen[k];
  }
  scene.resources().camera = nullptr;
  return nb::ndarray<nb::numpy, float>(pixels->data(), {height, width, 3}, owner);
}

nb::dict progress_dict(const BoundSession& session) {
  Progress p;
  {
    const nb::gil_scoped_release release;
    p = session.progress();
  }
  nb::dict d;
  d["passes"] = p.passes;
  d["stage"] = session.log().stage();
  d["note"] = session.log().note();
  d["samples_per_pixel"] = p.passes;
  d["fraction"] = p.fraction;
  d["seconds"] = p.seconds;
  d["remaining"] = p.remaining;
  d["rays"] = p.rays;
  d["noise"] = p.noise;
  d["bad_samples"] = p.bad_samples;
  d["memory"] = p.memory;
  d["done"] = p.done;
  d["cancelled"] = p.cancelled;
  d["error"] = p.error;
  return d;
}

nb::ndarray<nb::numpy, float> read_pass(const BoundSession& session, const std::string& pass) {
  const FilmSpec& spec = session.film().spec();
  const int channels = session.film().channels(pass);
  require(channels > 0, "there is no pass named '" + pass + "'");
  const size_t h = size_t(spec.region_height()), w = size_t(spec.region_width()), c = size_t(channels);
  auto* pixels = new std::vector<float>(h * w * c);
  nb::capsule owner(pixels, [](void* p) noexcept { delete static_cast<std::vector<float>*>(p); });
  {
    const nb::gil_scoped_release release;
    session.film().read(pass, pixels->data());
  }
  return nb::ndarray<nb::numpy, float>(pixels->data(), {h, w, c}, owner);
}

nb::ndarray<nb::numpy, float> coverage(const BoundSession& session) {
  require(session.lightmap(), "the session is not a bake");
  const size_t h = size_t(session.film().spec().height), w = size_t(session.film().spec().width);
  auto* texels = new std::vector<float>(h * w);
  nb::capsule owner(texels, [](void* p) noexcept { delete static_cast<std::vector<float>*>(p); });
  for (size_t i = 0; i < h * w; ++i) (*texels)[i] = session.lightmap()->coverage(int(i % w), int(i / w));
  return nb::ndarray<nb::numpy, float>(texels->data(), {h, w}, owner);
}

void take_over(BoundSession& session, nb::dict tables) {
  using Rows = nb::ndarray<const float, nb::shape<-1, -1>, nb::c_contig, nb::device::cpu>;
  std::map<std::string, Rows> given;
  for (auto [name, table] : tables) given[nb::cast<std::string>(name)] = nb::cast<Rows>(table);
  const nb::gil_scoped_release release;
  Kept kept;
  for (const auto& [name, rows] : given) kept[name] = {rows.shape(1), std::vector<float>(rows.data(), rows.data() + rows.size())};
  session.take_over(kept);
}

nb::dict kept_tables(const BoundSession& session) {
  Kept kept;
  {
    const nb::gil_scoped_release release;
    kept = session.kept();
  }
  nb::dict tables;
  for (auto& [name, table] : kept) {
    const size_t rows = table.rows();
    auto* numbers = new std::vector<float>(std::move(table.numbers));
    nb::capsule owner(numbers, [](void* p) noexcept { delete static_cast<std::vector<float>*>(p); });
    tables[name.c_str()] = nb::ndarray<nb::numpy, float>(numbers->data(), {rows, table.columns}, owner);
  }
  return tables;
}

nb::list describe_integrators() {
  nb::list all;
  for (const Descriptor& d : integrators()) {
    nb::list parameters;
    for (const Parameter& p : d.parameters) {
      static const char* const kKinds[] = {"INT", "FLOAT", "BOOL", "ENUM"};
      nb::dict q;
      q["name"] = p.name, q["label"] = p.label, q["type"] = kKinds[int(p.kind)];
      q["min"] = p.min, q["max"] = p.max, q["help"] = p.help, q["unit"] = p.unit;
      nb::list items;
      for (const Parameter::Item& item : p.items) items.append(nb::make_tuple(item.id, item.label, item.help));
      q["items"] = items;
      switch (p.kind) {
        case Parameter::Kind::kInt: q["default"] = int(p.value); break;
        case Parameter::Kind::kFloat: q["default"] = p.value; break;
        case Parameter::Kind::kBool: q["default"] = p.value != 0; break;
        case Parameter::Kind::kChoice: q["default"] = p.items[size_t(p.value)].id; break;
      }
      parameters.append(q);
    }
    nb::dict entry;
    entry["id"] = d.id, entry["label"] = d.label, entry["blurb"] = d.blurb, entry["parameters"] = parameters, entry["bakes"] = d.bakes;
    entry["kept_version"] = d.kept_version, entry["kept_by_place"] = d.kept_by_place;
    nb::list carries;
    if (d.carries & kCarriesSubsurface) carries.append("subsurface");
    if (d.carries & kCarriesAbsorption) carries.append("absorption");
    if (d.carries & kCarriesVolumes) carries.append("volumes");
    if (d.carries & kCarriesPortals) carries.append("portals");
    if (d.carries & kCarriesStrands) carries.append("strands");
    entry["carries"] = carries;
    all.append(entry);
  }
  return all;
}

}  // namespace

void bind_render(nb::module_& m) {
  nb::class_<BoundScene>(m, "Scene", "A scene ready to be traced, made of a scene_data.Scene.")
      .def(
          "__init__",
          [](BoundScene* self, nb::handle data, const std::string& embree, int threads, bool movable, const BoundScene* before) {
            std::unique_ptr<BoundScene> made(make_scene(data, embree, threads, movable, before));
            new (self) BoundScene(std::move(*made));
          },
          nb::arg("data"), nb::arg("embree"), nb::arg("threads") = 0, nb::arg("movable") = false, nb::arg("before").none() = nb::none(),
          "`embree`: path of the Embree library. `movable`: for a scene that is edited. What `before`, movable as well, made of the same\n"
          "Mesh objects is used again; these must not have changed. Raises ValueError naming the object or material for bad input, "
          "RuntimeError\n"
          "where Embree or the machine fails, MemoryError.")
      .def_prop_ro("warnings", [](const BoundScene& s) { return s.warnings; })
      .def_prop_ro(
          "embree", [](const BoundScene& s) { return s.scene->scene().embree_description(); }, "The library in use and its version.")
      .def_prop_ro(
          "memory", [](const BoundScene& s) { return s.scene->scene().memory_bytes(); }, "Bytes.")
      .def("emission_seen", &emission_seen, nb::arg("camera"), nb::arg("width"), nb::arg("height"),
           "What is emitted towards the camera at the middle of each pixel: (height, width, 3) float32, row 0 at the bottom.")
      .def(
          "trace",
          [](const BoundScene& s, nb::ndarray<const float, nb::shape<-1, 6>, nb::c_contig, nb::device::cpu> rays) {
            const size_t n = rays.shape(0);
            auto* t = new std::vector<float>(n);
            for (size_t i = 0; i < n; ++i) {
              const float* r = rays.data() + 6 * i;
              const auto hit = s.scene->scene().intersect({{r[0], r[1], r[2]}, {r[3], r[4], r[5]}}, ~0u);
              (*t)[i] = hit ? hit->t : kInf;
            }
            nb::capsule owner(t, [](void* p) noexcept { delete static_cast<std::vector<float>*>(p); });
            return nb::ndarray<nb::numpy, float>(t->data(), {n}, owner);
          },
          nb::arg("rays"), "Distances (n,) along rays (n, 6: origin, unit direction); infinite where nothing is hit.");

  nb::class_<BoundSession>(m, "Session", "One render in the background.")
      .def(
          "__init__",
          [](BoundSession* self, const BoundScene& scene, nb::handle camera, nb::handle film, nb::handle settings, nb::handle lightmap) {
            const Camera eye = read_camera(camera);
            FilmSpec spec = read_film(film);
            RenderSettings wishes = read_settings(settings);
            const std::optional<LightmapSpec> bake = read_lightmap(lightmap);
            const nb::gil_scoped_release release;
            new (self) BoundSession(*scene.scene, eye, std::move(spec), std::move(wishes), bake);
          },
          nb::arg("scene"), nb::arg("camera"), nb::arg("film"), nb::arg("settings"), nb::arg("lightmap") = nb::none(),
          nb::keep_alive<1, 2>(), "Takes scene_data's Camera, Film, Settings and, for a bake, Lightmap. Raises ValueError for bad input.")
      .def("take_over", &take_over, nb::arg("tables"),
           "Before the start: what kept() of a render by the same integrator was. Raises ValueError.")
      .def(
          "look_along",
          [](BoundSession& s, nb::list cameras) {
            std::vector<Camera> path;
            for (nb::handle camera : cameras) path.push_back(read_camera(camera));
            s.look_along(std::move(path));
          },
          nb::arg("cameras"), "Before the start: where the camera will be in other frames.")
      .def("stay_steady", &Session::stay_steady, "Before the start: a frame among others; what it takes over is not made better.")
      .def(
          "continue_from", [](BoundSession& s, BoundSession& earlier) { s.continue_from(earlier); }, nb::arg("earlier"),
          nb::call_guard<nb::gil_scoped_release>(),
          "Before the start: what an earlier session of the same scene, integrator and parameters has worked out, be it cancelled, serves\n"
          "on. It must have ended, and keeps nothing. Raises ValueError.")
      .def("kept", &kept_tables, "Once ended: what another render of the scene may take over, float32 tables (rows, columns) by name.")
      .def("start", &Session::start, nb::call_guard<nb::gil_scoped_release>())
      .def("wait", &Session::wait, nb::arg("seconds"), nb::call_guard<nb::gil_scoped_release>(), "True once the render has ended.")
      .def("cancel", &Session::cancel, nb::call_guard<nb::gil_scoped_release>())
      .def("pause", &Session::pause, nb::arg("on"), nb::call_guard<nb::gil_scoped_release>(),
           "Stops after the pass under way, or goes on from there. What time it takes is not counted.")
      .def("progress", &progress_dict)
      .def(
          "messages", [](const BoundSession& s) { return s.log().texts(); }, "What the integrator has to say of the scene, for the user.")
      .def(
          "figures",
          [](const BoundSession& s) {
            nb::dict d;
            for (const auto& [name, value] : s.log().figures()) d[name.c_str()] = value;
            return d;
          },
          "What the integrator measured so far, by name.")
      .def("coverage", &coverage, "Of a bake: share of each texel that the surface covers, (height, width) float32.")
      .def("read", &read_pass, nb::arg("render_pass"), "The pass so far: (height, width, channels) float32, row 0 at the bottom.");

  m.def("integrators", &describe_integrators, "Descriptors of the integrators and their parameters.");
}

}  // namespace gi::bind
