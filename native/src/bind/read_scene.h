// From the dataclasses of gi_engine/scene_data.py to the native scene. Messages name the object and the field.
#pragma once
#include <nanobind/nanobind.h>

#include <map>

#include "film/film.h"
#include "render/session.h"
#include "scene/camera.h"
#include "scene/scene_data.h"

namespace gi::bind {

// The scene_data.Mesh objects that an earlier scene was made of, and what it made of them.
struct KnownMeshes {
  const SceneData* data = nullptr;
  std::map<const PyObject*, int32_t> index;
};

SceneData read_scene(nanobind::handle scene, const KnownMeshes& known = {});
Camera read_camera(nanobind::handle camera);
FilmSpec read_film(nanobind::handle film);
RenderSettings read_settings(nanobind::handle settings);
std::optional<LightmapSpec> read_lightmap(nanobind::handle lightmap);  // None: none

}  // namespace gi::bind
