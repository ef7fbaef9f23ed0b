// From the dataclasses of gi_engine/scene_data.py to the native scene. Messages name the object and the field.
#pragma once
#include <nanobind/nanobind.h>

#include "film/film.h"
#include "render/session.h"
#include "scene/camera.h"
#include "scene/scene_data.h"

namespace gi::bind {

SceneData read_scene(nanobind::handle scene);
Camera read_camera(nanobind::handle camera);
FilmSpec read_film(nanobind::handle film);
RenderSettings read_settings(nanobind::handle settings);
std::optional<LightmapSpec> read_lightmap(nanobind::handle lightmap);  // None: none

}  // namespace gi::bind
