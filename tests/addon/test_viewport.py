"""The viewport without a window: its camera, its pictures, and what it takes over of a scene that changes."""

from __future__ import annotations

import dataclasses
import random
import threading
import time

import bpy
import numpy as np
import pytest
from mathutils import Matrix

import gi_engine
from gi_engine import native, viewport
from gi_engine.export import export
from gi_engine.export.film import frame_size
from gi_engine.look import border_region, camera_of, reduced
from gi_engine.refine import Refiner, scales
from gi_engine.scene_data import Film
from gi_engine.sync import Sync, mark_of

from .conftest import add, mesh

EDITS_A_SEED = 40


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_the_view_of_a_camera_is_the_cameras(scene, render_export, kind):
    camera = scene.camera
    camera.data.type, camera.data.shift_x, camera.data.shift_y = kind, 0.2, -0.1
    camera.rotation_euler, camera.scale = (0.4, 0.2, 1.0), (2, 2, 2)
    add(scene, "Square", mesh())
    depsgraph = bpy.context.evaluated_depsgraph_get()
    window = camera.calc_matrix_camera(depsgraph, x=16, y=12)
    found = camera_of(np.array(camera.matrix_world.normalized().inverted()), np.array(window))
    wanted = render_export().scene.camera
    np.testing.assert_allclose(found.view_plane, wanted.view_plane, rtol=1e-4)
    np.testing.assert_allclose(found.matrix[:3, :3], wanted.matrix[:3, :3], atol=1e-5)
    # An orthographic camera may stand elsewhere along its view, as long as it sees the same depths.
    back = (found.matrix[:3, 3] - wanted.matrix[:3, 3]) @ wanted.matrix[:3, 2]
    assert found.clip_start - back == pytest.approx(wanted.clip_start, abs=2e-3)
    assert found.clip_end - back == pytest.approx(wanted.clip_end, rel=1e-3)


def test_borders_and_reduced_films_keep_within_the_view():
    assert border_region(((0.25, 0.5), (0.75, 2.0)), 400, 100) == (100, 50, 300, 100)
    assert border_region(((1.5, -1), (1.2, -1)), 10, 10) == (9, 0, 10, 1)
    film = Film(width=401, height=99, region=(0, 0, 401, 99))
    assert scales(film)[-1] == 1 and scales(film) == sorted(scales(film), reverse=True)
    small = reduced(film, 8)
    assert small.region == (0, 0, 50, 12) and (small.width, small.height) == (50, 12)


@pytest.fixture
def lit(scene):
    add(scene, "Square", mesh(), location=(-2, -2, 0), scale=(4, 4, 4))
    add(scene, "Lamp", bpy.data.lights.new("Lamp", "POINT"), location=(0, 0, 2)).data.energy = 100
    return scene


@pytest.fixture
def job(lit):
    """What a viewport of 320 x 200 pixels through the camera wants."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    exported = export(depsgraph, native.integrators(), None, (320, 200))
    film = dataclasses.replace(exported.scene.film, region=(0, 0, 320, 200))
    exported.settings = dataclasses.replace(exported.settings, threads=1)
    resolved = type("Resolved", (), {"preview_samples": 3, "preview_pause": False})
    return viewport.make_job(exported, exported.scene.camera, film, lit.gi_engine, resolved)


def wait_for(test, seconds=60):
    end = time.monotonic() + seconds
    while not test():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_pictures_come_coarse_first_and_end_with_all_samples(job):
    seen = []
    refiner = Refiner(lambda: seen.append(refiner.picture) or True)
    refiner.show(job)
    wait_for(lambda: refiner.picture and refiner.picture.samples == 3)
    sizes = [picture.pixels.shape[:2] for picture in seen]
    assert sizes[0] < (200, 320) and sizes[-1] == (200, 320) and sizes == sorted(sizes)
    brightness = [picture.pixels[..., :3].mean() for picture in (seen[0], seen[-1])]
    assert brightness[0] == pytest.approx(brightness[1], rel=0.1) and brightness[1] > 0.01
    refiner.close()
    assert "GI Engine viewport" not in [thread.name for thread in threading.enumerate()]


def test_what_is_newer_replaces_what_is_worked_on(job):
    refiner = Refiner(lambda: True)
    endless = dataclasses.replace(job, settings=dataclasses.replace(job.settings, samples=1 << 20))
    refiner.show(endless)
    wait_for(lambda: refiner.picture)
    refiner.show(job)
    wait_for(lambda: refiner.picture.job is job and refiner.picture.samples == 3)
    assert refiner.starts == 2 and not refiner.error
    refiner.close()


def test_a_viewport_that_is_gone_ends_its_thread(job):
    refiner = Refiner(lambda: False)
    refiner.show(dataclasses.replace(job, settings=dataclasses.replace(job.settings, samples=1 << 20)))
    refiner._thread.join(30)
    assert not refiner._thread.is_alive()


def test_the_same_job_is_not_begun_again(job):
    again = dataclasses.replace(job, camera=dataclasses.replace(job.camera, matrix=job.camera.matrix.copy()))
    assert viewport.same_job(again, job)
    again.camera.matrix[0, 3] += 1
    assert not viewport.same_job(again, job) and not viewport.same_job(job, None)


# Sync


class Watched:
    """A Sync that hears of each change of the scene, as a viewport does."""

    def __init__(self, scene):
        self.scene, self.sync, self.restarts = scene, Sync(), 0
        bpy.app.handlers.depsgraph_update_post.append(self.changed)
        self.sync.update(bpy.context.evaluated_depsgraph_get())
        self.restarts = 0

    def changed(self, scene, depsgraph):
        self.restarts += self.sync.update(depsgraph)

    def settle(self):
        bpy.context.view_layer.update()

    def close(self):
        bpy.app.handlers.depsgraph_update_post.remove(self.changed)


@pytest.fixture
def watched(lit):
    made = Watched(lit)
    yield made
    made.close()


def fresh():
    depsgraph = bpy.context.evaluated_depsgraph_get()
    size = frame_size(depsgraph.scene_eval.render)
    return export(depsgraph, native.integrators(), None, size, needs_camera=False)


def objects(kind):
    return sorted((o for o in bpy.context.scene.objects if o.type == kind), key=lambda o: o.name)


def test_only_what_changed_is_read(watched):
    scene, sync = watched.scene, watched.sync
    exports, reads = sync.exports, sync.meshes.reads
    scene.camera.location.x += 1
    watched.settle()
    assert (sync.exports, watched.restarts) == (exports, 0)
    scene.gi_engine.is_own = True
    scene.gi_engine.clamp_direct = 3
    scene.render.film_transparent = True  # of which every version tells
    watched.settle()
    assert (sync.exports, watched.restarts) == (exports, 1)
    objects("LIGHT")[0].data.energy = 5
    watched.settle()
    objects("MESH")[0].location.x += 1
    watched.settle()
    assert watched.restarts == 3 and sync.meshes.reads == reads
    objects("MESH")[0].data.vertices[0].co.z += 1
    objects("MESH")[0].data.update()
    watched.settle()
    assert watched.restarts == 4 and sync.meshes.reads == reads + 1


def move(rng):
    rng.choice(objects("MESH") + objects("LIGHT")).location = [rng.uniform(-2, 2) for _ in range(3)]


def turn(rng):
    rng.choice(objects("MESH")).matrix_world = Matrix.Rotation(rng.uniform(0, 6), 4, "Z")


def bend(rng):
    data = rng.choice(objects("MESH")).data
    data.vertices[0].co.z = rng.uniform(-1, 1)
    data.update()


def add_object(rng):
    data = mesh() if rng.random() < 0.5 or not objects("MESH") else rng.choice(objects("MESH")).data
    add(bpy.context.scene, "Added", data, location=[rng.uniform(-2, 2) for _ in range(3)])


def remove_object(rng):
    if len(objects("MESH")) > 1:
        bpy.data.objects.remove(rng.choice(objects("MESH")))


def hide(rng):
    item = rng.choice(objects("MESH"))
    item.hide_viewport = not item.hide_viewport


def rename(rng):
    rng.choice(objects("MESH") + objects("LIGHT")).name = f"Name {rng.randrange(1000)}"


def paint(rng):
    item = rng.choice(objects("MESH"))
    if not item.data.materials:
        item.data.materials.append(bpy.data.materials.new("Paint"))
    material = item.data.materials[0]
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (rng.random(), rng.random(), rng.random(), 1)


def lamp(rng):
    light = rng.choice(objects("LIGHT")).data
    light.energy, light.color = rng.uniform(1, 100), (rng.random(), rng.random(), rng.random())


def modify(rng):
    item = rng.choice(objects("MESH"))
    if item.modifiers:
        item.modifiers.clear()
    else:
        item.modifiers.new("Array", "ARRAY").count = rng.randrange(2, 4)


def world(rng):
    scene = bpy.context.scene
    scene.world = scene.world or bpy.data.worlds.new("World")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Strength"].default_value = rng.random()


def duplicate(rng):
    """Instances of one object on the vertices of another."""
    items = objects("MESH")
    if len(items) > 1 and not items[0].parent:
        items[1].parent = items[0]
        items[0].instance_type = rng.choice(["NONE", "VERTS"])


EDITS = (
    *(move, turn, bend, add_object, remove_object, hide, rename, paint, lamp, modify, world, duplicate),
)  # fmt: skip


def drive(watched, seed: int, edits: int) -> None:
    rng = random.Random(seed)
    for number in range(edits):
        done = [rng.choice(EDITS) for _ in range(rng.choice((1, 1, 1, 3)))]
        for edit in done:
            edit(rng)
        watched.settle()
        names = ", ".join(edit.__name__ for edit in done)
        assert mark_of(watched.sync.exported) == mark_of(fresh()), f"seed {seed}, edit {number}: {names}"


@pytest.mark.parametrize("seed", range(3))
def test_random_edits_leave_what_a_fresh_export_has(watched, seed):
    drive(watched, seed, EDITS_A_SEED)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 110))
def test_thousands_of_random_edits(watched, seed):
    drive(watched, seed, 300)


# The add-on as a whole


def traces() -> tuple:
    handlers = [
        len(getattr(bpy.app.handlers, n))
        for n in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, n), list)
    ]
    ours = [name for name in dir(bpy.types) if name.startswith(("GI_", "GIEngine"))]
    joined = [n for n in dir(bpy.types) if "GI_ENGINE" in getattr(getattr(bpy.types, n), "COMPAT_ENGINES", ())]
    owners = [t.__name__ for t in (bpy.types.Scene, bpy.types.ViewLayer, bpy.types.Object) if hasattr(t, "gi_engine")]
    return handlers, ours, joined, owners, sorted(t.name for t in threading.enumerate())


def test_registering_twice_leaves_no_trace(job):
    """Handlers, classes, panels joined, properties, threads; a viewport that is open is closed."""
    registered = traces()
    gi_engine.unregister()
    try:
        without = traces()
        assert without[1:4] == ([], [], [])
        gi_engine.register()
        gi_engine.unregister()
        assert traces() == without
    finally:
        gi_engine.register()
    assert traces() == registered
