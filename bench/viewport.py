"""The viewport without its window: seconds until the first picture after each kind of change, and what of them reading the scene took.

    python bench/viewport.py FILE.blend [--integrators path,…] [--size WxH] [--rounds N] [--table]

The window's part of it (drawing) is left out; reading the scene is what holds Blender up meanwhile. Medians over the rounds. A camera
moves while a picture is being refined, as a user moves it."""

from __future__ import annotations

import argparse
import dataclasses
import os
import statistics
import sys
import time
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
import gi_engine
from gi_engine import native, viewport
from gi_engine.export.film import export_film
from gi_engine.export.settings import resolve
from gi_engine.refine import Refiner
from gi_engine.sync import Sync

PATIENCE = 120.0  # seconds
REFINING = 0.7  # seconds between a picture and the next change


class Bench:
    def __init__(self, integrator: str, size: tuple[int, int]):
        self.scene, self.size = bpy.context.scene, size
        self.scene.gi_engine.is_own = True
        self.scene.gi_engine.integrator = integrator
        self.scene.gi_engine.preview_samples = 1 << 16
        self.scene.update_tag()  # of scripts' changes of settings nobody would know
        bpy.context.view_layer.update()
        self.sync, self.synced = Sync(), 0.0
        self.first: dict = {}  # when the first picture of a job came, by the job's id()
        self.refiner = Refiner(self.seen)
        bpy.app.handlers.depsgraph_update_post.append(self.changed)

    def close(self):
        bpy.app.handlers.depsgraph_update_post.remove(self.changed)
        self.refiner.close()

    def changed(self, scene, depsgraph):
        start = time.perf_counter()
        self.sync.update(depsgraph)
        self.synced += time.perf_counter() - start

    def seen(self) -> bool:
        picture = self.refiner.picture
        if picture:
            self.first.setdefault(id(picture.job), (time.perf_counter(), picture))
        return True

    def show(self) -> tuple[float, tuple]:
        """Seconds from handing the wish over to the first picture, and that picture's size."""
        depsgraph = bpy.context.evaluated_depsgraph_get()
        scene, layer = depsgraph.scene_eval, depsgraph.view_layer_eval
        resolved = resolve(scene, layer)
        film = dataclasses.replace(export_film(scene, layer, resolved, self.size), region=(0, 0, *self.size))
        camera = dataclasses.replace(
            self.sync.exported.scene.camera, matrix=np.array(self.scene.camera.matrix_world.normalized(), np.float32)
        )
        job = viewport.make_job(self.sync.exported, camera, film, self.scene.gi_engine, resolved)
        start = time.perf_counter()
        self.refiner.show(job)
        while id(job) not in self.first:
            time.sleep(0.001)
            if self.refiner.error or time.perf_counter() - start > PATIENCE:
                raise RuntimeError(self.refiner.error or "no picture came")
        seconds, picture = self.first.pop(id(job))
        self.first.clear()
        self.kept = picture  # or id() may come again
        return seconds - start, picture.pixels.shape[1::-1]

    def after(self, change) -> tuple[float, float, tuple]:
        change()
        self.synced = 0.0
        bpy.context.view_layer.update()
        synced = self.synced
        shown, size = self.show()
        time.sleep(REFINING)
        return synced, shown, size


def turn_camera():
    camera = bpy.context.scene.camera
    camera.matrix_world = camera.matrix_world @ Matrix.Rotation(0.02, 4, "Y")


def objects(kind):
    return [item for item in bpy.context.view_layer.objects if item.type == kind and not item.hide_render]


def biggest():
    return max((o for o in objects("MESH")), key=lambda o: len(o.data.polygons))


def move_object():
    item = biggest()
    item.matrix_world = Matrix.Translation((0.001, 0, 0)) @ item.matrix_world


def bend_mesh():
    data = biggest().data
    data.vertices[0].co.z += 0.001
    data.update()


def dim_light():
    objects("LIGHT")[0].data.energy *= 1.01


def paint():
    material = biggest().material_slots[0].material
    node = next(n for n in material.node_tree.nodes if any(s.type == "RGBA" for s in n.inputs))
    socket = next(s for s in node.inputs if s.type == "RGBA")
    socket.default_value = [0.98 * c for c in socket.default_value[:3]] + [1.0]


def turn_world():
    tree = bpy.context.scene.world.node_tree
    node = next(n for n in tree.nodes if n.type == "BACKGROUND")
    node.inputs["Strength"].default_value = 1.01 * node.inputs["Strength"].default_value + 0.01


def set_settings():
    bpy.context.scene.gi_engine.clamp_direct += 0.5
    bpy.context.scene.render.film_transparent = not bpy.context.scene.render.film_transparent


CHANGES = {
    "camera": turn_camera,
    "object moved": move_object,
    "lamp": dim_light,
    "material": paint,
    "world": turn_world,
    "mesh": bend_mesh,
    "settings": set_settings,
}


def complete() -> None:
    """Each scene has a lamp and a world to change."""
    scene = bpy.context.scene
    if not objects("LIGHT"):
        lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
        lamp.matrix_world = scene.camera.matrix_world
        scene.collection.objects.link(lamp)
    scene.world = scene.world or bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0, 0):
        scene.world.use_nodes = True


def measure(integrator: str, size, rounds: int, kinds) -> None:
    complete()
    bench = Bench(integrator, size)
    start = time.perf_counter()
    bench.sync.update(bpy.context.evaluated_depsgraph_get())
    read = time.perf_counter() - start
    shown, first_size = bench.show()
    print_row(integrator, "the whole scene", [(read, shown, first_size)])
    time.sleep(REFINING)
    for kind in kinds:
        try:
            print_row(integrator, kind, [bench.after(CHANGES[kind]) for _ in range(rounds)])
        except (StopIteration, RuntimeError) as error:
            print(f"| {integrator} | {kind} | {error} |  |  |", flush=True)
    bench.close()


def print_row(integrator: str, kind: str, found) -> None:
    synced, shown = (1e3 * statistics.median(f[i] for f in found) for i in (0, 1))
    worst = 1e3 * max(f[0] + f[1] for f in found)
    width, height = found[0][2]
    print(
        f"| {integrator} | {kind} | {synced:.1f} | {shown:.0f} | {synced + shown:.0f} | {worst:.0f} | {width}x{height} |",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--integrators", default="path,irradiance_cache,photon_map")
    parser.add_argument("--changes", default=",".join(CHANGES))
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    gi_engine.register()
    print(
        "| integrator | what changed | read, ms | first picture, ms | both | worst | its size |\n|---|---|---|---|---|---|---|"
    )
    for integrator in options.integrators.split(","):
        bpy.ops.wm.open_mainfile(filepath=str(options.file), load_ui=False, use_scripts=False)
        measure(integrator, tuple(map(int, options.size.split("x"))), options.rounds, options.changes.split(","))
    sys.stdout.flush()
    os._exit(0)  # Blender's module can hang at exit


if __name__ == "__main__":
    assert native.available()
    main()
