"""How long GI Engine and Cycles take to read a scene out of Blender, in one process: medians over fresh meshes.

    python bench/export.py [--rounds N]

Both are timed by what they tell Blender of their state: from the first "Exporting" (Cycles: "Synchronizing object")
until the next stage begins. Every render gets meshes made anew, so that neither finds the other's normals and triangles
in Blender's caches. Exits with 1 if two million triangles in one mesh take longer than Cycles takes.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))
import gi_engine

# Engine -> where its reading begins and what comes after it.
STAGES = {"GI_ENGINE": ("Exporting", "Building"), "CYCLES": ("Synchronizing", "Initializing")}


def grid(n: int, **with_options):
    """n x n quads, bent and smooth."""
    x, y = np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, n + 1))
    vertices = np.stack([x, y, 0.1 * np.sin(7 * x) * np.cos(5 * y)], -1).reshape(-1, 3).astype(np.float32)
    corner = np.arange((n + 1) * (n + 1), dtype=np.int32).reshape(n + 1, n + 1)
    faces = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]], -1).reshape(-1, 4)
    mesh = bpy.data.meshes.new("Grid")
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", vertices.ravel())
    mesh.loops.add(faces.size)
    mesh.loops.foreach_set("vertex_index", faces.ravel())
    mesh.polygons.add(len(faces))
    mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 4, dtype=np.int32))
    if with_options.get("uv"):
        mesh.uv_layers.new(name="UVMap").uv.foreach_set("vector", vertices[faces.ravel(), :2].ravel())
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    if with_options.get("sharp"):
        mesh.edges[5].use_edge_sharp = True  # makes Blender compute normals by corner
    return mesh


def one_mesh(scene) -> None:
    link(scene, grid(1000))


def sharp_edges(scene) -> None:
    link(scene, grid(1000, sharp=True))


def textured(scene) -> None:
    mesh = grid(1000, uv=True)
    material = bpy.data.materials.new("Checker")
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    coordinates, checker = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeTexChecker")
    tree.links.new(coordinates.outputs["UV"], checker.inputs["Vector"])
    tree.links.new(checker.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    mesh.materials.append(material)
    link(scene, mesh)


def many_meshes(scene) -> None:
    for i in range(1000):
        link(scene, grid(32), (i, 0, 0))


def many_instances(scene) -> None:
    carrier, leaf = link(scene, grid(315)), link(scene, grid(2))
    carrier.instance_type, leaf.parent = "VERTS", carrier


def link(scene, mesh, location=(0, 0, 0)):
    item = bpy.data.objects.new("Object", mesh)
    item.location = location
    scene.collection.objects.link(item)
    return item


SCENES = {
    "2 M triangles in a mesh": one_mesh,
    "the same with a sharp edge": sharp_edges,
    "the same with a UV map": textured,
    "1,000 meshes, 2 M triangles": many_meshes,
    "99,856 instances": many_instances,
}


def seconds(build, engine: str) -> tuple[float, float]:
    """Wall and CPU time of one render's reading of the scene, in a new file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location = (0, 0, -5)  # looks away: nothing but reading is to take time
    scene.collection.objects.link(camera)
    scene.camera = camera
    build(scene)
    scene.render.engine = engine
    scene.render.resolution_x = scene.render.resolution_y = 4
    scene.cycles.samples, scene.cycles.use_denoising = 1, False
    bpy.context.view_layer.update()
    told: list[tuple[str, float, float]] = []

    def listen(status):
        told.append((status, time.perf_counter(), time.process_time()))

    bpy.app.handlers.render_stats.append(listen)
    try:
        bpy.ops.render.render()
    finally:
        bpy.app.handlers.render_stats.remove(listen)
    first, after = STAGES[engine]
    begin = next(i for i, (status, *_) in enumerate(told) if first in status)
    end = next(i for i, (status, *_) in enumerate(told) if i > begin and after in status)
    return told[end][1] - told[begin][1], told[end][2] - told[begin][2]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    gi_engine.register()
    print(f"Blender {bpy.app.version_string}, {os.cpu_count()} cores, medians of {rounds}")
    print(f"{'':30}{'GI Engine, wall (CPU)':>24}{'Cycles, wall (CPU)':>24}{'Cycles/ours':>14}")
    ratios = []
    for name, build in SCENES.items():
        times: dict[str, list[tuple[float, float]]] = {engine: [] for engine in STAGES}
        for i in range(rounds):
            for engine in sorted(STAGES, reverse=i % 2 == 1):
                times[engine].append(seconds(build, engine))
        medians = [
            [statistics.median(column) for column in zip(*times[e], strict=True)] for e in ("GI_ENGINE", "CYCLES")
        ]
        ratios.append(medians[1][0] / medians[0][0])
        cells = "".join(f"{wall * 1e3:11.1f} ms ({cpu * 1e3:6.0f})" for wall, cpu in medians)
        print(f"{name:30}{cells}{ratios[-1]:14.2f}", flush=True)
    return 0 if ratios[0] > 1 else 1


if __name__ == "__main__":
    status = main()
    sys.stdout.flush()
    os._exit(status)  # the module of Blender 4.5 may hang when the interpreter shuts down
