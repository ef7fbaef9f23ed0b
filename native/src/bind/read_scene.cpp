// Reading scene_data's dataclasses, field by field. Arrays are shared with NumPy, which keeps them alive.
#include "bind/read_scene.h"

#include "bind/bind.h"

#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "core/check.h"

namespace nb = nanobind;

namespace gi::bind {
namespace {

// One dataclass instance, and what to call it in messages.
struct Record {
  nb::object object;
  std::string who;

  nb::object at(const char* field) const {
    if (!nb::hasattr(object, field)) throw InputError(who + " lacks the field '" + field + "'");
    return object.attr(field);
  }
  template <class T>
  T get(const char* field) const {
    nb::object value = at(field);
    try {
      return nb::cast<T>(value);
    } catch (const nb::cast_error&) {
      throw InputError(who + ": '" + field + "' has the wrong type: " + nb::cast<std::string>(nb::str(value.type())));
    }
  }
  float real(const char* field) const { return float(get<double>(field)); }
  std::vector<float> reals(const char* field, size_t n) const {
    const nb::object list = nb::steal<nb::object>(PySequence_List(at(field).ptr()));
    if (!list.is_valid()) {
      PyErr_Clear();
      throw InputError(who + ": '" + field + "' must be a sequence of numbers");
    }
    std::vector<float> values;
    for (nb::handle x : list) values.push_back(float(nb::cast<double>(nb::float_(x))));
    require(values.size() == n,
            who + ": '" + field + "' must hold " + std::to_string(n) + " numbers, not " + std::to_string(values.size()));
    return values;
  }
  Rgb rgb(const char* field) const {
    const auto v = reals(field, 3);
    return {v[0], v[1], v[2]};
  }
  template <class E>
  E choice(const char* field, std::initializer_list<std::pair<const char*, E>> items) const {
    const auto id = get<std::string>(field);
    std::string valid;
    for (const auto& [name, value] : items) {
      if (id == name) return value;
      valid += (valid.empty() ? "" : ", ") + std::string(name);
    }
    throw InputError(who + ": '" + field + "' must be one of " + valid + ", not '" + id + "'");
  }
  Affine matrix(const char* field) const {
    const auto all = matrices(field);
    require(all.size() == 1, who + ": '" + field + "' must be a 4 x 4 matrix");
    return all[0];
  }
  std::vector<Affine> matrices(const char* field) const {
    const auto a = array<const float>(field, true);  // any number type will do
    require(a.size % 16 == 0, who + ": '" + field + "' must hold 4 x 4 matrices");
    std::vector<Affine> all(a.size / 16);
    for (size_t k = 0; k < all.size(); ++k)
      for (size_t i = 0; i < 12; ++i) all[k].m[i / 4][i % 4] = a[16 * k + i];
    return all;
  }
  // A contiguous array of any shape; None is empty.
  template <class T>
  Array<T> array(const char* field, bool convert = false) const {
    return array_of<T>(at(field), field, convert);
  }
  template <class T>
  Array<T> array_of(nb::object value, const char* field, bool convert = true) const {
    if (value.is_none()) return {};
    using Nd = nb::ndarray<T, nb::c_contig, nb::device::cpu>;
    Nd nd;
    if (!nb::try_cast<Nd>(value, nd, convert))
      throw InputError(who + ": '" + field + "' must be a contiguous array of " + type_name<T>() + ", not " +
                       nb::cast<std::string>(nb::str(nb::type_name(value.type()))));
    auto* keep = new Nd(nd);
    return {nd.data(), nd.size(), std::shared_ptr<void>(keep, [](void* p) {
              const nb::gil_scoped_acquire gil;
              delete static_cast<Nd*>(p);
            })};
  }
  std::vector<Record> list(const char* field, const std::string& kind) const {
    std::vector<Record> records;
    nb::object items = at(field);
    for (nb::handle item : items) {
      std::string name = nb::hasattr(item, "name") ? nb::cast<std::string>(nb::str(item.attr("name"))) : "?";
      records.push_back({nb::borrow(item), kind + " '" + name + "'"});
    }
    return records;
  }

 private:
  template <class T>
  static std::string type_name() {
    using Number = std::remove_const_t<T>;
    return std::is_same_v<Number, float> ? "float32" : std::is_same_v<Number, uint8_t> ? "uint8" : "int32";
  }
};

// Embree reads 4 bytes past the last vertex: arrays that do not have them are copied.
Array<float> padded_positions(const Record& mesh) {
  Array<const float> a = mesh.array<const float>("positions");
  nb::object base = mesh.at("positions").attr("base");
  const bool padded = !base.is_none() && nb::hasattr(base, "nbytes") && nb::cast<size_t>(base.attr("nbytes")) >= (a.size + 1) * 4 &&
                      nb::cast<size_t>(base.attr("ctypes").attr("data")) == reinterpret_cast<size_t>(a.data);
  if (padded) return {const_cast<float*>(a.data), a.size, a.owner};
  auto copy = std::make_shared<std::vector<float>>(a.data, a.data + a.size);
  copy->push_back(0.0f);
  return {copy->data(), a.size, copy};
}

Domain read_domain(const Record& r, const char* field) {
  return r.choice<Domain>(field, {{"POINT", Domain::kPoint}, {"CORNER", Domain::kCorner}, {"FACE", Domain::kFace}});
}

// Attributes, and what goes with them.
void read_common(const Record& r, MeshData& m) {
  for (const Record& a : r.list("attributes", r.who + " attribute")) {
    AttributeData d;
    d.name = a.get<std::string>("name");
    d.domain = read_domain(a, "domain");
    d.data = a.array<const float>("data");
    const auto dims = nb::cast<size_t>(a.at("data").attr("ndim"));
    d.components = dims < 2 ? 1 : nb::cast<int>(a.at("data").attr("shape")[nb::int_(1)]);
    m.attributes.push_back(std::move(d));
  }
  m.active_uv = r.get<std::string>("active_uv");
  nb::object space = r.at("texture_space");
  for (int k = 0; k < 3; ++k) {
    m.texture_location[k] = float(nb::cast<double>(nb::float_(space[nb::int_(0)][nb::int_(k)])));
    m.texture_size[k] = float(nb::cast<double>(nb::float_(space[nb::int_(1)][nb::int_(k)])));
  }
}

MeshData read_mesh(const Record& r) {
  MeshData m;
  m.name = r.get<std::string>("name");
  m.positions = padded_positions(r);
  m.corner_vert = r.array<const int32_t>("corner_vert");
  m.triangulated = r.at("tri_corner").is_none();
  m.tri_corner = r.array<const int32_t>("tri_corner");
  m.tri_face = r.array<const int32_t>("tri_face");
  m.face_material = r.array<const int32_t>("face_material");
  m.normals_domain = read_domain(r, "normals_domain");
  m.normals = r.array<const float>("normals");
  m.sharp_face = r.array<const uint8_t>("sharp_face");
  read_common(r, m);
  return m;
}

// gi_engine/scene_data.py Strands.
MeshData read_strands(const Record& r) {
  MeshData m;
  m.name = r.get<std::string>("name");
  m.primitive = r.choice<Primitive>("shape", {{"RIBBON", Primitive::kRibbon},
                                              {"THICK", Primitive::kThick},
                                              {"THICK_LINEAR", Primitive::kThickLinear},
                                              {"SPHERE", Primitive::kSphere}});
  m.positions = padded_positions(r);
  m.radius = r.array<const float>("radius");
  m.first_vertex = r.array<const int32_t>("first_vertex");
  m.subdivisions = r.get<int>("subdivisions");
  read_common(r, m);
  return m;
}

// A record stands for as many instances as it has matrices.
void read_instances(const Record& r, std::vector<InstanceData>& all) {
  InstanceData i;
  i.name = r.get<std::string>("name");
  i.mesh = r.get<uint32_t>("mesh");
  i.materials = r.get<std::vector<int32_t>>("materials");
  i.visibility = r.get<uint32_t>("visibility");
  const auto color = r.reals("color", 4);
  std::copy(color.begin(), color.end(), i.color);
  i.object_index = r.get<int>("object_index");
  i.holdout = r.get<bool>("holdout");
  i.shadow_terminator_offset = r.real("shadow_terminator_offset");
  i.shadow_terminator_geometry_offset = r.real("shadow_terminator_geometry_offset");
  nb::dict attributes = r.get<nb::dict>("attributes");
  std::vector<std::pair<size_t, Array<const float>>> by_place;  // which of the attributes
  for (auto [name, value] : attributes) {
    InstanceAttribute a{nb::cast<std::string>(name), {0, 0, 0, 1}};
    if (nb::hasattr(value, "ndim") && nb::cast<int>(value.attr("ndim")) == 2) {
      by_place.emplace_back(i.attributes.size(), r.array_of<const float>(nb::borrow(value), "attributes"));
    } else {
      for (size_t k = 0; k < 4; ++k) a.value[k] = float(nb::cast<double>(nb::float_(nb::object(value[nb::int_(k)]))));
    }
    i.attributes.push_back(a);
  }
  const std::vector<Affine> matrices = r.matrices("matrix");
  const bool many = nb::hasattr(r.at("random"), "shape");
  const Array<const float> randoms = many ? r.array<const float>("random", true) : Array<const float>{};
  require(!many || randoms.size == matrices.size(), r.who + ": 'random' must have one number for each matrix");
  if (!many) i.random = r.real("random");
  for (const auto& place : by_place)
    require(place.second.size == 4 * matrices.size(), r.who + ": an attribute of places must have four numbers for each matrix");
  for (size_t k = 0; k < matrices.size(); ++k) {
    i.matrix = matrices[k];
    if (many) i.random = randoms[k];
    for (const auto& [which, values] : by_place) std::copy_n(values.data + 4 * k, 4, i.attributes[which].value);
    all.push_back(i);
  }
}

LampData read_lamp(const Record& r) {
  LampData l;
  l.name = r.get<std::string>("name");
  l.kind = r.choice<LampKind>("kind",
                              {{"POINT", LampKind::kPoint}, {"SPOT", LampKind::kSpot}, {"AREA", LampKind::kArea}, {"SUN", LampKind::kSun}});
  l.matrix = r.matrix("matrix");
  l.color = r.rgb("color");
  l.normalize = r.get<bool>("normalize");
  l.radius = r.real("radius");
  l.soft_falloff = r.get<bool>("soft_falloff");
  l.spot_size = r.real("spot_size"), l.spot_blend = r.real("spot_blend");
  l.ellipse = r.choice<bool>("shape", {{"RECTANGLE", false}, {"ELLIPSE", true}});
  const auto size = r.reals("size", 2);
  l.size_x = size[0], l.size_y = size[1];
  l.spread = r.real("spread"), l.angle = r.real("angle");
  l.program = r.get<int>("program");
  l.visibility = r.get<uint32_t>("visibility");
  l.cast_shadow = r.get<bool>("cast_shadow"), l.use_mis = r.get<bool>("use_mis");
  l.max_bounces = r.get<int>("max_bounces");
  return l;
}

MaterialData read_program(const Record& r) {
  const auto code = r.array<const int32_t>("code");
  const auto constants = r.array<const float>("constants"), tables = r.array<const float>("tables");
  MaterialData m;
  m.program = Program(r.get<std::string>("name"), {code.data, code.data + code.size}, {constants.data, constants.data + constants.size},
                      r.get<int>("register_count"), {tables.data, tables.data + tables.size});
  m.pass_index = r.get<int>("pass_index");
  m.emission_sampling = r.choice<EmissionSampling>("emission_sampling", {{"NONE", EmissionSampling::kNone},
                                                                         {"AUTO", EmissionSampling::kAuto},
                                                                         {"FRONT", EmissionSampling::kFront},
                                                                         {"BACK", EmissionSampling::kBack},
                                                                         {"FRONT_BACK", EmissionSampling::kFrontBack}});
  m.transparent_shadows = r.get<bool>("transparent_shadows");
  m.bump_correction = r.get<bool>("bump_correction");
  m.volume = r.get<int>("volume");
  m.only_volume = r.get<bool>("only_volume");
  m.displacement = r.get<int>("displacement");
  m.bumps_displacement = r.get<bool>("bumps_displacement");
  return m;
}

}  // namespace

SceneData read_scene(nb::handle scene, const KnownMeshes& known) {
  const Record r{nb::borrow(scene), "the scene"};
  SceneData d;
  for (const Record& m : r.list("meshes", "mesh")) {
    const auto found = known.index.find(m.object.ptr());
    if (found == known.index.end() || known.data->meshes[size_t(found->second)].is_moved) {
      d.meshes.push_back(nb::hasattr(m.object, "first_vertex") ? read_strands(m) : read_mesh(m));
    } else {
      MeshData& mesh = d.meshes.emplace_back(known.data->meshes[size_t(found->second)]);
      mesh.before = found->second;
      if (mesh.undisplaced) mesh.positions = mesh.undisplaced->positions, mesh.normals = mesh.undisplaced->normals;
      mesh.undisplaced.reset();
    }
  }
  for (const Record& i : r.list("instances", "object")) read_instances(i, d.instances);
  for (const Record& l : r.list("lights", "light")) d.lamps.push_back(read_lamp(l));
  for (const Record& p : r.list("programs", "material")) d.materials.push_back(read_program(p));
  d.attribute_names = r.get<std::vector<std::string>>("attribute_names");
  const Record world{r.at("world"), "the world"};
  d.world.program = world.get<int>("program");
  d.world.visibility = world.get<uint32_t>("visibility");
  const auto sampling = world.get<std::string>("sampling");
  d.world.sampled = sampling != "NONE";
  d.world.map_resolution = sampling == "MANUAL" ? world.get<int>("map_resolution") : 0;
  d.world.max_bounces = world.get<int>("max_bounces");
  return d;
}

Camera read_camera(nb::handle camera) {
  const Record r{nb::borrow(camera), "the camera"};
  Camera c;
  c.name = r.get<std::string>("name");
  c.kind = r.choice<Camera::Kind>(
      "kind", {{"PERSP", Camera::Kind::kPerspective}, {"ORTHO", Camera::Kind::kOrthographic}, {"PANO", Camera::Kind::kPanoramic}});
  c.to_world = r.matrix("matrix");
  require(c.to_world.determinant() != 0.0f && std::isfinite(c.to_world.determinant()), "camera '" + c.name + "' has a singular transform");
  const auto plane = r.reals("view_plane", 4);
  c.left = plane[0], c.right = plane[1], c.bottom = plane[2], c.top = plane[3];
  c.clip_start = r.real("clip_start"), c.clip_end = r.real("clip_end");
  c.aperture_radius = r.real("aperture_radius"), c.focus_distance = r.real("focus_distance");
  c.aperture_blades = r.get<int>("aperture_blades");
  c.aperture_rotation = r.real("aperture_rotation"), c.aperture_ratio = r.real("aperture_ratio");
  require(c.aperture_ratio > 0.0f, "camera '" + c.name + "' has an aperture ratio that is not positive");
  const auto latitude = r.reals("latitude", 2), longitude = r.reals("longitude", 2);
  c.latitude[0] = latitude[0], c.latitude[1] = latitude[1];
  c.longitude[0] = longitude[0], c.longitude[1] = longitude[1];
  return c;
}

FilmSpec read_film(nb::handle film) {
  const Record r{nb::borrow(film), "the film"};
  FilmSpec f;
  f.width = r.get<int>("width"), f.height = r.get<int>("height");
  nb::object region = r.at("region");
  f.x1 = f.width, f.y1 = f.height;
  if (nb::len(region) != 0) {
    const auto v = r.get<std::vector<int>>("region");
    require(v.size() == 4, "the film: 'region' must be empty or hold 4 numbers");
    f.x0 = v[0], f.y0 = v[1], f.x1 = v[2], f.y1 = v[3];
  }
  f.filter = r.choice<FilterKind>(
      "filter", {{"BOX", FilterKind::kBox}, {"GAUSSIAN", FilterKind::kGaussian}, {"BLACKMAN_HARRIS", FilterKind::kBlackmanHarris}});
  f.filter_width = r.real("filter_width");
  f.exposure = r.real("exposure");
  f.transparent = r.get<bool>("transparent"), f.transparent_glass = r.get<bool>("transparent_glass");
  f.transparent_roughness = r.real("transparent_roughness");
  f.passes = r.get<std::vector<std::string>>("passes");
  for (const auto& [name, channels] : r.get<std::vector<std::pair<std::string, int>>>("aovs")) f.aovs.push_back({name, channels});
  return f;
}

RenderSettings read_settings(nb::handle settings) {
  const Record r{nb::borrow(settings), "the settings"};
  RenderSettings s;
  s.integrator = r.get<std::string>("integrator");
  s.samples = r.get<int>("samples");
  s.time_limit = r.get<double>("time_limit");
  s.noise_target = r.real("noise_target");
  s.seed = uint32_t(r.get<int64_t>("seed"));
  s.threads = r.get<int>("threads");
  nb::dict parameters = r.get<nb::dict>("parameters");
  for (auto [name, value] : parameters) s.parameters[nb::cast<std::string>(nb::str(name))] = nb::cast<std::string>(nb::str(value));
  return s;
}

std::optional<LightmapSpec> read_lightmap(nb::handle lightmap) {
  if (lightmap.is_none()) return {};
  const Record r{nb::borrow(lightmap), "the lightmap"};
  LightmapSpec s{r.get<std::string>("object"), r.get<std::string>("uv_map")};
  s.content = r.choice<LightmapContent>(
      "content",
      {{"IRRADIANCE", LightmapContent::kIrradiance}, {"INDIRECT", LightmapContent::kIndirect}, {"RADIOSITY", LightmapContent::kRadiosity}});
  return s;
}

}  // namespace gi::bind
