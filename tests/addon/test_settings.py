"""Scenes follow their Cycles settings until one of ours is set."""

from __future__ import annotations

import bpy
import pytest

from gi_engine import native
from gi_engine.export.film import frame_size, region
from gi_engine.export.settings import SHARED, copy_from_cycles, resolve, samples_of, value_of


def fill_cycles(cycles) -> None:
    cycles.samples, cycles.seed, cycles.time_limit = 77, 5, 12.5
    cycles.film_exposure, cycles.pixel_filter_type, cycles.filter_width = 2.0, "GAUSSIAN", 2.5
    cycles.film_transparent_glass, cycles.film_transparent_roughness = True, 0.25
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces, cycles.transmission_bounces = 9, 8, 7, 6
    cycles.transparent_max_bounces, cycles.min_light_bounces, cycles.blur_glossy = 5, 4, 0.5
    cycles.sample_clamp_direct, cycles.sample_clamp_indirect = 3.0, 2.0
    cycles.caustics_reflective, cycles.caustics_refractive = False, True


def test_a_scene_without_own_settings_follows_cycles(scene):
    fill_cycles(scene.cycles)
    for name, theirs in SHARED.items():
        if hasattr(scene.gi_engine, name):
            assert value_of(scene, name) == getattr(scene.cycles, theirs), name
    scene.cycles.samples = 78
    assert value_of(scene, "samples") == 78


def test_setting_one_takes_the_others_over_from_cycles(scene):
    fill_cycles(scene.cycles)
    scene.gi_engine.samples = 3
    assert scene.gi_engine.is_own
    assert (value_of(scene, "samples"), value_of(scene, "film_exposure"), value_of(scene, "seed")) == (3, 2.0, 5)
    scene.cycles.samples = scene.cycles.seed = 1000
    assert (value_of(scene, "samples"), value_of(scene, "seed")) == (3, 5)


def test_copying_again_and_following_again(scene):
    scene.gi_engine.samples = 3
    fill_cycles(scene.cycles)
    assert bpy.ops.gi_engine.copy_from_cycles() == {"FINISHED"}
    assert value_of(scene, "samples") == 77
    scene.gi_engine.samples = 4
    bpy.ops.gi_engine.follow_cycles()
    assert value_of(scene, "samples") == 77 and not scene.gi_engine.is_own


def test_settings_survive_saving(scene, tmp_path):
    scene.gi_engine.samples = 3
    path = str(tmp_path / "saved.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert bpy.context.scene.gi_engine.samples == 3 and bpy.context.scene.gi_engine.is_own


def test_view_layers_override_the_samples(scene):
    layer = scene.view_layers[0]
    assert samples_of(scene, layer, 10) == 10
    layer.samples = 20
    for mode, expected in (("USE", 20), ("BOUNDED", 10), ("IGNORE", 10)):
        scene.cycles.use_layer_samples = mode
        assert samples_of(scene, layer, 10) == expected


def test_an_animated_seed_changes_with_the_frame(scene):
    scene.cycles.use_animated_seed = True
    seeds = set()
    for frame in (1, 2, 3):
        scene.frame_set(frame)
        seeds.add(resolve(scene, scene.view_layers[0]).seed)
    assert len(seeds) == 3 and all(0 <= seed < 2**31 for seed in seeds)


@pytest.mark.parametrize("size", [(1920, 1080), (33, 7), (1, 1)])
@pytest.mark.parametrize("percentage", [100, 50, 33])
def test_frame_size_and_border_are_blenders(scene, render_export, size, percentage):
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = *size, percentage
    exported = render_export()  # is told the size by Blender
    assert frame_size(render) == (exported.scene.film.width, exported.scene.film.height)
    assert region(render, *frame_size(render)) == (0, 0, *frame_size(render))


def test_threads(scene, render_export):
    assert render_export().settings.threads == 0
    scene.render.threads_mode, scene.render.threads = "FIXED", 3
    assert render_export().settings.threads == 3


def test_every_parameter_of_every_integrator_has_a_property(scene, render_export):
    descriptors = native.integrators()
    assert {"whitted", "distributed", "path"} <= {d["id"] for d in descriptors}
    for descriptor in descriptors:
        scene.gi_engine.integrator = descriptor["id"]
        settings = render_export().settings
        assert settings.integrator == descriptor["id"]
        assert set(settings.parameters) == {p["name"] for p in descriptor["parameters"]}
    copy_from_cycles(scene)
    scene.gi_engine.path.light_sampling = "OFF"
    scene.gi_engine.integrator = "path"
    scene.gi_engine.max_bounces = 3
    parameters = render_export().settings.parameters
    assert parameters["light_sampling"] == "OFF" and parameters["max_bounces"] == 3
