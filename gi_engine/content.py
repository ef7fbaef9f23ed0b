"""What of a scene its light depends on, as digests and bounds: to tell whether what was kept of one render holds for another, and where
not. Leaves out the camera and the film, which light does not depend on. No bpy.
"""

from __future__ import annotations

import dataclasses
import hashlib
from dataclasses import dataclass

import numpy as np

from .nodes.program import op_table
from .scene_data import Instance, Program, Scene, Settings

IGNORED = {  # settings that spoil nothing kept
    *("clamp_direct", "min_spacing", "max_spacing", "min_length", "max_length"),
    *("refinement", "radius", "caustic_count", "caustic_filter", "global_count"),
}
NEAR = 0.02  # share of what a place sees that something may cover at most, to count as far from it
MOST_BOXES = 512
EMPTY = np.zeros((0, 6), np.float32)


@dataclass
class Content:
    everywhere: dict[str, str]  # digests of what changes light everywhere, by what to call it
    objects: dict[str, tuple[str, int]]  # digest and number of places, by name
    bounds: (
        np.ndarray
    )  # (places, 6) float32: least and greatest corner of each in world space, in the order of `objects`

    def places(self) -> dict[str, np.ndarray]:
        ends = np.cumsum([count for _, count in self.objects.values()]).tolist()
        return dict(zip(self.objects, np.split(self.bounds, ends[:-1]) if ends else [], strict=True))


@dataclass
class Change:
    reason: str  # why nothing of before holds; "": see `boxes`
    names: list[str]  # of objects that have changed
    boxes: np.ndarray  # (n, 6): where they were and are


def content_of(scene: Scene, settings: Settings) -> Content:
    """Before the native side has taken the meshes over."""
    programs = [digest(program) for program in scene.programs]
    everywhere = {f"setting {name}": plain(v) for name, v in settings.parameters.items() if name not in IGNORED}
    everywhere["the integrator"] = settings.integrator
    everywhere["the world"] = digest(scene.world, programs[scene.world.program] if scene.world.program >= 0 else "")
    for lamp in scene.lights:
        name = unused(f'lamp "{lamp.name}"', everywhere)
        everywhere[name] = digest(lamp, programs[lamp.program] if lamp.program >= 0 else "")
    # Programs know images and attributes by their numbers.
    everywhere["the images"] = digest(scene.images, scene.attribute_names)
    meshes = [digest(mesh) for mesh in scene.meshes]
    corners = [corners_of(mesh.positions) for mesh in scene.meshes]
    glows = [emits(program) for program in scene.programs]
    objects, bounds = {}, [EMPTY]
    for instance in scene.instances:
        materials = [programs[index] for index in instance.materials]
        # Numbers of meshes and programs change as others come and go.
        same = dataclasses.replace(instance, mesh=0, materials=[])
        value = digest(same, meshes[instance.mesh], materials)
        if any(glows[index] for index in instance.materials):
            everywhere[unused(f'luminous object "{instance.name}"', everywhere)] = value
        objects[unused(instance.name, objects)] = (value, instance.count)
        bounds.append(bounds_of(instance, corners[instance.mesh]))
    return Content(everywhere, objects, np.concatenate(bounds))


def compare(before: Content, now: Content) -> Change:
    """What of `before` does not hold any more."""
    for name in {**before.everywhere, **now.everywhere}:
        old, new = before.everywhere.get(name), now.everywhere.get(name)
        if old != new:
            what = "is not there any more" if new is None else "is new" if old is None else "has changed"
            values = f" from {old} to {new}" if name.startswith("setting ") and old and new else ""
            return Change(f"{name} {what}{values}", [], EMPTY)
    names, boxes = [], [EMPTY]
    old_places, new_places = before.places(), now.places()
    for name in {**before.objects, **now.objects}:
        if before.objects.get(name) != now.objects.get(name):
            names.append(name)
            boxes.append(moved(old_places.get(name, EMPTY), new_places.get(name, EMPTY)))
    return Change("", names, np.concatenate(boxes))


def moved(old: np.ndarray, new: np.ndarray) -> np.ndarray:
    """Where one object has changed: those of its places that did, where that shows, else all."""
    if old.shape == new.shape and (differing := (old != new).any(1)).any():
        old, new = old[differing], new[differing]
    return np.concatenate([old, new])


def far_from(boxes: np.ndarray, positions: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Which places (n,) see next to nothing of the boxes: these are behind them, or small and far away."""
    far = np.ones(len(positions), bool)
    if len(boxes) > MOST_BOXES:
        groups = np.array_split(boxes, MOST_BOXES)
        boxes = np.array([[*g[:, :3].min(0), *g[:, 3:].max(0)] for g in groups])
    for low, high in zip(boxes[:, :3], boxes[:, 3:], strict=True):
        distance = np.linalg.norm(np.maximum(np.maximum(low - positions, positions - high), 0), axis=1)
        _, b, c = np.sort(high - low)
        # The corner that lies furthest along the normal.
        along = ((np.where(normals > 0, high, low) - positions) * normals).sum(1)
        far &= (along <= 0) | (b * c < NEAR * np.pi * distance**2)
    return far


# -------------------------------------------------------------------------------------------------- parts


def digest(*things) -> str:
    state = hashlib.blake2b(digest_size=16)
    for thing in things:
        feed(state, thing)
    return state.hexdigest()


def feed(state, thing) -> None:
    if isinstance(thing, np.ndarray):
        state.update(f"{thing.dtype.str}{thing.shape}".encode())
        if thing.size:
            state.update(np.ascontiguousarray(thing).data.cast("B"))
    elif dataclasses.is_dataclass(thing):
        for item in dataclasses.fields(thing):
            # A lamp's or world's number of a program says nothing: its program comes after it.
            feed(state, None if item.name == "program" else getattr(thing, item.name))
    elif isinstance(thing, dict):
        feed(state, sorted(thing.items()))
    elif isinstance(thing, list | tuple):
        state.update(f"[{len(thing)}".encode())
        for item in thing:
            feed(state, item)
    else:
        state.update(f"{type(thing).__name__}:{thing};".encode())


def plain(value) -> str:
    """A parameter the same way whether it is a number or, from the command line, a text."""
    try:
        return f"{float(value):g}"
    except ValueError:
        return str(value)


def unused(name: str, taken: dict) -> str:
    number, made = 1, name
    while made in taken:
        number += 1
        made = f"{name} #{number}"
    return made


def emits(program: Program) -> bool:
    widths = {code: 1 + len(outs) + len(ins) + imm for code, outs, ins, imm in op_table().values()}
    emission = op_table()["emission"][0]
    at, code = 0, program.code.tolist()
    while at < len(code):
        if code[at] == emission:
            return True
        at += widths[code[at]]
    return False


def corners_of(positions: np.ndarray) -> np.ndarray:
    """(8, 4) of the box around a mesh, homogeneous."""
    low, high = (positions.min(0), positions.max(0)) if len(positions) else (np.zeros(3), np.zeros(3))
    pick = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)], bool)
    return np.hstack([np.where(pick, high, low), np.ones((8, 1))])


def bounds_of(instance: Instance, corners: np.ndarray) -> np.ndarray:
    matrices = np.asarray(instance.matrix, float).reshape(-1, 4, 4)
    world = np.einsum("nij,kj->nki", matrices[:, :3], corners)
    return np.concatenate([world.min(1), world.max(1)], 1).astype(np.float32)
