// The parts of the extension module, one function for each family.
#pragma once
#include <nanobind/nanobind.h>

#include <memory>

#include "shading/resources.h"

namespace gi::bind {

void bind_render(nanobind::module_& m);
void bind_shading(nanobind::module_& m);
void bind_lobes(nanobind::module_& m);
void bind_images(nanobind::module_& m);
void bind_evaluate(nanobind::module_& m);
void bind_bsdf(nanobind::module_& m);
void bind_lights(nanobind::module_& m);
void bind_guide(nanobind::module_& m);
void bind_hash(nanobind::module_& m);
void bind_points(nanobind::module_& m);
void bind_scattering(nanobind::module_& m);
void bind_connections(nanobind::module_& m);
void bind_irradiance(nanobind::module_& m);

// The images of a scene_data.Scene.
std::unique_ptr<ShaderResources> read_resources(nanobind::handle scene);

}  // namespace gi::bind
