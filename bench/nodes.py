"""What a material of sixty nodes costs at equal samples, GI Engine's over Cycles': time of a picture with it less time with a plain one.

    python bench/nodes.py [--rounds N] [--pixels N] [--samples N]

Both engines in one process on one thread, taking turns; medians over the rounds of the processor's time, which other work on the machine
hardly changes. Every node changes what it is given: both engines leave out those that do not, such as a Mix of all of one side, which
the row "untouched" has many of. Writes bench/results/nodes.md."""

from __future__ import annotations

import argparse
import math
import os
import statistics
import sys
import tempfile
import time
from pathlib import Path

import bpy

import gi_engine

ROOT = Path(__file__).resolve().parents[1]
ENGINES = ("CYCLES", "GI_ENGINE")
AIM = 1.5
NODES = 60


def plain(tree):
    return tree.nodes.new("ShaderNodeBsdfPrincipled")


def numbers(tree):
    """Arithmetic on numbers and vectors: what the interpreter itself costs."""
    return finished(tree, ("ShaderNodeMath", "ShaderNodeVectorMath", "ShaderNodeMix", "ShaderNodeMapRange"))


PATTERNS = (
    "ShaderNodeTexNoise",
    "ShaderNodeMath",
    "ShaderNodeValToRGB",
    "ShaderNodeMix",
    "ShaderNodeMapping",
    "ShaderNodeVectorMath",
)


def patterns(tree):
    """As artists have it: some textures, ramps and arithmetic between them, into a Principled BSDF."""
    return finished(tree, PATTERNS)


def cells(tree):
    """The same with Voronoi textures."""
    return finished(tree, ("ShaderNodeTexVoronoi", *PATTERNS[1:]))


def untouched(tree):
    """Nodes as they are when they are new: many leave what they are given as it is."""
    return finished(tree, PATTERNS, touched=False)


def finished(tree, kinds, touched=True):
    value = tree.nodes.new("ShaderNodeTexCoord").outputs["Object"]
    for i in range(NODES - 2):
        node = tree.nodes.new(kinds[i % len(kinds)])
        if node.bl_idname == "ShaderNodeMix":
            node.data_type = "RGBA"
        enabled = [s for s in node.inputs if s.enabled and s.type in ("VALUE", "VECTOR", "RGBA")]
        target = next((s for s in enabled if s.name in ("Vector", "A", "Fac", "Value")), enabled[0])
        if touched:
            touch(node, i)
        tree.links.new(value, target)
        value = next(s for s in node.outputs if s.enabled)
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    tree.links.new(value, shader.inputs["Base Color"])
    return shader


def touch(node, i: int) -> None:
    """Other settings than those that a node comes with, so that it does something, and numbers stay within bounds."""
    wave = 0.1 * math.sin(i)
    if node.bl_idname == "ShaderNodeMix":
        node.inputs[0].default_value = 0.3 + wave
        next(s for s in node.inputs if s.enabled and s.name == "B").default_value = (0.2 + wave, 0.7, 0.5, 1.0)
    elif node.bl_idname == "ShaderNodeMath":
        node.operation = "MULTIPLY_ADD"
        node.inputs[1].default_value, node.inputs[2].default_value = 1.5, wave
    elif node.bl_idname == "ShaderNodeVectorMath":
        node.operation = "MULTIPLY_ADD"
        node.inputs[1].default_value, node.inputs[2].default_value = (1.5, 0.8, 1.2), (wave, 0.1, -wave)
    elif node.bl_idname == "ShaderNodeMapping":
        node.inputs["Rotation"].default_value, node.inputs["Location"].default_value = (
            (wave, 0.3, 0.2),
            (0.1, wave, 0.0),
        )
    elif node.bl_idname == "ShaderNodeMapRange":
        node.inputs["To Min"].default_value, node.inputs["To Max"].default_value = wave, 0.8


MATERIALS = {"plain": plain, "numbers": numbers, "patterns": patterns, "cells": cells, "untouched": untouched}


def stage(pixels: int, samples: int):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=4)
    bpy.ops.object.camera_add(location=(0, 0, 2))
    scene.camera = bpy.context.object
    bpy.ops.object.light_add(type="POINT", location=(0, 0, 2))
    scene.render.resolution_x = scene.render.resolution_y = pixels
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    cycles = scene.cycles
    cycles.samples, cycles.max_bounces, cycles.use_adaptive_sampling, cycles.use_denoising = samples, 1, False, False
    scene.render.filepath = os.path.join(tempfile.mkdtemp(), "picture.png")
    return scene


def seconds(scene, engine: str, make) -> float:
    plane = next(o for o in scene.objects if o.type == "MESH")
    material = bpy.data.materials.new("material")
    if material.node_tree is None:
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader = make(tree)
    tree.links.new(shader.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    plane.data.materials.clear()
    plane.data.materials.append(material)
    scene.render.engine = engine
    start = time.process_time()
    bpy.ops.render.render()
    return time.process_time() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--pixels", type=int, default=160)
    parser.add_argument("--samples", type=int, default=48)
    options = parser.parse_args()
    gi_engine.register()
    scene = stage(options.pixels, options.samples)
    times = {(e, m): [] for e in ENGINES for m in MATERIALS}
    for _ in range(options.rounds):
        for name, make in MATERIALS.items():
            for engine in ENGINES:
                times[engine, name].append(seconds(scene, engine, make))
    middle = {key: statistics.median(values) for key, values in times.items()}
    lines = [
        "# A material of sixty nodes",
        "",
        f"`python bench/nodes.py`: Blender {bpy.app.version_string}, {options.pixels} x {options.pixels} pixels, {options.samples} samples, one thread,",
        f"medians of {options.rounds} rounds. Seconds of processor time for a picture; below, what the sixty nodes add to the plain material's. Aim: at most {AIM} times Cycles'.",
        "",
        "| | Cycles | GI Engine | ratio |",
        "|---|---|---|---|",
    ]
    for name in MATERIALS:
        theirs, ours = (middle[engine, name] for engine in ENGINES)
        lines.append(f"| {name} | {theirs:.2f} | {ours:.2f} | {ours / theirs:.2f} |")
    for name in list(MATERIALS)[1:]:
        theirs, ours = (middle[engine, name] - middle[engine, "plain"] for engine in ENGINES)
        lines.append(f"| {name}, added | {theirs:.2f} | {ours:.2f} | {ours / theirs:.2f} |")
    text = "\n".join(lines) + "\n"
    print(text)
    (ROOT / "bench" / "results" / "nodes.md").write_text(text)


if __name__ == "__main__":
    main()
    sys.stdout.flush()
    os._exit(0)
