"""Renders rows of the table of shader nodes and compares them: values pixel by pixel at one sample, closures (and values that are
random in themselves) by block means, as everything else here."""

from __future__ import annotations

from dataclasses import dataclass, field

import bpy
import numpy as np

from gi_engine.nodes.compile import Compiler
from gi_engine.scene_data import Scene

from . import compare
from .cases_materials import light as studio_light
from .cases_materials import small_ball
from .node_rows import Row, material_of
from .studio import Case, Unavailable, empty, link, sheet, tile_region

PER_SHEET = 100
TOLERANCE = 1e-3  # of a value, relative where it is larger than 1
OUTLIERS = 1e-3  # part of a row's pixels, and at least FEW_PIXELS
FEW_PIXELS = 4
SEEDS = range(11, 19)
JITTER = 0.04
COARSE, ENOUGH = 0.5, 0.3
RANDOM = {"ShaderNodeAmbientOcclusion", "ShaderNodeBevel"}  # Cycles traces rays of its own for these
VALUE_SAMPLES, CLOSURE_SAMPLES, MORE = 32, 64, 4
CYCLES, OURS = compare.ENGINES


@dataclass
class Result:
    """What one row came to."""

    idname: str
    name: str
    state: str  # agrees, differs, fallback (agrees or not, but a warning says so) or unavailable
    worst: float = 0.0  # largest relative difference of a pixel, or of a block in standard errors
    wrong: float = 0.0  # part of the pixels or blocks
    pixels: bool = True  # or blocks
    warnings: list = field(default_factory=list)


def results(rows: list[Row]) -> list[Result]:
    compare.register_once()
    by_values = [row for row in rows if not row.closure and row.idname not in RANDOM]
    closures = [row for row in rows if row.closure]
    at_random = [row for row in rows if not row.closure and row.idname in RANDOM]
    found = []
    for group, compare_sheet in ((by_values, value_sheet), (closures, block_sheet), (at_random, block_sheet)):
        for i in range(0, len(group), PER_SHEET):
            found += compare_sheet(group[i : i + PER_SHEET])
    return found


# -------------------------------------------------------------------- values


def value_sheet(rows: list[Row]) -> list[Result]:
    """What differs is rendered again by several seeds: a jump or cusp that lies within the rays' jitter is met from both sides then.

    Voronoi's Minkowski distance with an exponent of .19 changes by up to 14 % within the jitter; where Cycles' own rays meet the surface,
    the formula gives Cycles' values to 7e-7 (in double precision to 5e-5), so that rounding is not what tells the engines apart."""
    found = values_of(rows, SEEDS[:1])
    again = [i for i, result in enumerate(found) if result.state == "differs"]
    if again:
        for i, result in zip(again, values_of([rows[i] for i in again], SEEDS), strict=True):
            found[i] = result
    return found


def values_of(rows: list[Row], seeds) -> list[Result]:
    made = case_of(rows, patch, nothing, samples=1)
    scene = empty(made.size)
    made.build(scene)
    compare.neutral(scene, 1)
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01  # rays through the middle of pixels
    said = warnings_of(rows)
    theirs, ours = (np.stack([compare.render(scene, engine, seed) for seed in seeds]) for engine in (CYCLES, OURS))
    found = []
    for i, row in enumerate(rows):
        y, x = tile_region(made, i)
        found.append(pixels_of(row, theirs[:, y, x], ours[:, y, x], said.get(i)))
    return found


def pixels_of(row: Row, theirs: np.ndarray, ours: np.ndarray, said: list | None) -> Result:
    """Of pictures by several seeds, by how much all values of a pixel in one engine are above all of the other's."""
    if said is None:
        return Result(row.idname, row.name, "unavailable")
    theirs = np.nan_to_num(theirs, posinf=0, neginf=0)
    size = np.maximum(1.0, np.abs(theirs[0]))
    # Both jitter their rays by a hundredth of a pixel, with which a value changes by as much of what it does over a pixel: several
    # seeds show by how much.
    change = change_over_pixel(theirs[0])
    allowed = JITTER * change if len(theirs) == 1 else 0.0
    difference = np.maximum(apart(theirs, ours) - allowed, 0.0) / size
    coarse = change <= COARSE * size  # elsewhere, at jumps and poles, no two rays give the same
    if coarse.mean() >= ENOUGH:
        difference[~coarse] = 0.0
    difference[~np.isfinite(ours).all(0)] = np.inf
    wrong = (difference > TOLERANCE).any(-1)
    good = wrong.sum() <= max(OUTLIERS * wrong.size, FEW_PIXELS)
    kept = np.sort(difference.max(-1).ravel())[: -FEW_PIXELS or None]
    return Result(row.idname, row.name, verdict(good, said), float(kept[-1]), float(wrong.mean()), True, said)


def apart(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """How far the ranges over the first axis are from one another; 0 where they overlap."""
    return np.maximum(np.maximum(a.min(0) - b.max(0), b.min(0) - a.max(0)), 0.0)


def change_over_pixel(image: np.ndarray) -> np.ndarray:
    """The largest difference to a neighbour."""
    padded = np.pad(image, ((1, 1), (1, 1), (0, 0)), mode="edge")
    h, w = image.shape[:2]
    near = [padded[1 + dy : 1 + dy + h, 1 + dx : 1 + dx + w] for dy in (-1, 0, 1) for dx in (-1, 0, 1)]
    return np.abs(np.stack(near) - image).max(0)


# -------------------------------------------------------------------- closures


def block_sheet(rows: list[Row]) -> list[Result]:
    found = blocks_of(rows, 1)
    again = [i for i, result in enumerate(found) if result.state == "differs"]
    if again:  # rare bright samples can make a block's error look smaller than it is: more samples decide
        for i, result in zip(again, blocks_of([rows[i] for i in again], MORE), strict=True):
            found[i] = result
    return found


def blocks_of(rows: list[Row], factor: int) -> list[Result]:
    closures = rows[0].closure
    made = case_of(rows, small_ball if closures else patch, studio_light if closures else nothing)
    scene = empty(made.size)
    made.build(scene)
    compare.neutral(scene, factor * (CLOSURE_SAMPLES if closures else VALUE_SAMPLES))
    said = warnings_of(rows)
    pairs = compare.render_pairs(scene)
    found = []
    for i, row in enumerate(rows):
        if i not in said:
            found.append(Result(row.idname, row.name, "unavailable"))
            continue
        where = tile_region(made, i)
        cut = {engine: images[:, where[0], where[1]] for engine, images in pairs.items()}
        a = compare.agreement(row.name, cut, made.tolerance)
        good = not a.failed and not a.invalid
        found.append(Result(row.idname, row.name, verdict(good, said[i]), a.worst, a.failed / a.blocks, False, said[i]))
    return found


# -------------------------------------------------------------------- shared


def verdict(good: bool, said: list) -> str:
    replaced = [text for text in said if "as in Cycles" not in text]
    return "fallback" if replaced else "agrees" if good else "differs"


def case_of(rows: list[Row], place, light, **case) -> Case:
    def maker(row):
        def make(name):
            try:
                return material_of(row, name)
            except (AttributeError, TypeError, KeyError, StopIteration) as error:
                raise Unavailable(str(error)) from error

        return make

    # Names are long and not always different: tiles go by number.
    return sheet("nodes", {f"row {i}": maker(row) for i, row in enumerate(rows)}, place, light, **case)


def warnings_of(rows: list[Row]) -> dict[int, list]:
    """What the compiler says of each row's material; rows that could not be made are missing."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    said = {}
    for i in range(len(rows)):
        made = bpy.data.materials.get(f"row {i}")
        if made is None or not made.users:
            continue
        said[i] = []
        Compiler(Scene(), depsgraph, said[i].append).material(made.evaluated_get(depsgraph))
    return said


def nothing() -> None:
    """No light: what is seen is emitted."""


def patch(made):
    """A bent smooth patch of one metre with UV maps and attributes, its mesh shared by all tiles."""
    mesh = bpy.data.meshes.get("patch") or patch_mesh()
    item = link("patch", mesh)
    item.material_slots[0].link, item.material_slots[0].material = "OBJECT", made
    item.color, item.pass_index = (0.2, 0.4, 0.6, 0.7), 3
    return item


def patch_mesh(n: int = 12):
    """Its edges keep clear of the centres of pixels."""
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, n), np.linspace(-0.497, 0.497, n - 3))
    z = 0.1 * np.sin(4 * x) * np.cos(6 * y)
    mesh = bpy.data.meshes.new("patch")
    index = np.arange(x.size).reshape(x.shape)
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], -1).reshape(-1, 4)
    mesh.from_pydata(np.stack([x, y, z], -1).reshape(-1, 3).tolist(), [], quads.tolist())
    mesh.shade_smooth()
    mesh.materials.append(None)
    corner = quads.reshape(-1)
    uv = np.stack([x.ravel()[corner] + 0.5, 0.8 * y.ravel()[corner] + 0.1 * x.ravel()[corner]], -1).astype(np.float32)
    mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", uv.ravel())
    colors = np.random.default_rng(1).random(len(corner) * 4).astype(np.float32)
    mesh.color_attributes.new("paint", "FLOAT_COLOR", "CORNER").data.foreach_set("color", colors)
    return mesh
