"""Walks the depsgraph's instances: what is drawn, where, with which materials, seen by which rays.

Curves, text, surfaces and metaballs reach us as the meshes that Blender makes of them. Hair and point clouds go by the same ways as
meshes. Volume grids are left out, under a warning.
"""

from __future__ import annotations

from array import array
from dataclasses import dataclass, field
from itertools import chain

import bpy
import numpy as np

from ..scene_data import (
    CAMERA,
    DIFFUSE,
    GLOSSY,
    SHADOW,
    TRANSMISSION,
    VISIBLE_TO_ALL,
    VOLUME,
    Instance,
)
from .ids import MASK, random_of_name
from .strands import CurveStyle, ParticleHair, curve_style, particle_hair
from .warnings import Warnings

MATRIX_BYTES = 64
MATRICES_ARE_BUFFERS = bpy.app.version >= (5, 0, 0)
UNSUPPORTED = {"VOLUME": "volume grids"}
GEOMETRY = (bpy.types.Mesh, bpy.types.Curves, bpy.types.PointCloud)
IGNORED = (bpy.types.Curve, bpy.types.MetaBall, bpy.types.Camera, bpy.types.Armature, bpy.types.Lattice)
VISIBILITY = {
    "visible_camera": CAMERA,
    "visible_shadow": SHADOW,
    "visible_diffuse": DIFFUSE,
    "visible_glossy": GLOSSY,
    "visible_transmission": TRANSMISSION,
    "visible_volume_scatter": VOLUME,
}


def new_matrices() -> bytearray | array:
    """Holds 16 floats an instance."""
    return bytearray() if MATRICES_ARE_BUFFERS else array("f")


@dataclass
class Prototype:
    """What all instances of one object (with one mesh, under one instancer) have in common."""

    name: str
    mesh: (
        object  # bpy Mesh, Curves or PointCloud, or strands.ParticleHair; valid until the depsgraph is evaluated again
    )
    materials: list  # bpy Material or None, by slot
    visibility: int
    color: tuple
    object_index: int
    holdout: bool
    shadow_terminator_offset: float
    shadow_terminator_geometry_offset: float
    object: object  # bpy Object that object attributes are read from
    parent: object  # bpy Object that instancer attributes are read from; the same where there is none
    is_plain: bool  # a mesh object of its own, with nothing that may take its faces away on purpose
    style: CurveStyle | None  # of strands; None for meshes
    is_deformed: bool  # modifiers or shape keys may have moved its vertices
    matrices: bytearray | array = field(default_factory=new_matrices)
    randoms: list[int] = field(default_factory=list)  # Blender's number for each; empty where it is not an instance


@dataclass
class Collected:
    """The objects of a view layer, before anything big is read."""

    prototypes: list[Prototype] = field(default_factory=list)
    # Name, bpy Light, matrix, visibility, and the bpy Object unless it is a duplicate.
    lights: list[tuple] = field(default_factory=list)


def collect(depsgraph, warnings: Warnings, view=None) -> Collected:
    """Goes through all instances once. Never leaves the loop early: older versions then leak the whole list."""
    walk = Walk(depsgraph.view_layer_eval, warnings, view, depsgraph.mode == "RENDER")
    seen: dict[tuple, tuple] = {}
    # Data that gives nothing: that of empties, and of curves (which come as meshes, too).
    ignored: dict[int, object] = {id(None): None}
    # A million instances come through here: no call and no attribute more than it takes. Blender gives the same Python
    # object again for an ID as long as one is held, so that its id() will do as a key where asking for pointers is slow.
    for instance in depsgraph.object_instances:
        data = instance.object.data
        if id(data) in ignored:
            continue
        lasting, parent = instance.instance_object, instance.parent
        key = (id(lasting), id(parent), id(data))
        if key in seen:
            if adders := seen[key][0]:
                adders[0](instance.matrix_world)
                adders[1](instance.random_id)
        elif isinstance(data, IGNORED):
            ignored[id(data)] = data
        elif instance.show_self or instance.show_particles:
            adders = walk.visit(instance) if walk.is_shown(instance) else ()
            if lasting is not None and adders is not None:
                seen[key] = (adders, lasting, parent, data)
    return walk.found


class Walk:
    def __init__(self, view_layer, warnings: Warnings, view=None, is_render: bool = True):
        self.view_layer = view_layer
        self.style = curve_style(view_layer.id_data, is_render)
        self.view = view
        self.warnings = warnings
        self.found = Collected()
        # What takes the matrix and the number of further instances, by mesh, object and instancer.
        self.known: dict[tuple, tuple] = {}

    def is_shown(self, instance) -> bool:
        """Local view and collections that one viewport hides: by the object, or by what makes duplicates of it."""
        return self.view is None or (instance.parent or instance.object).visible_in_viewport_get(self.view)

    def visit(self, instance) -> tuple | None:
        """What takes the matrix and the number of further instances; () if nothing does, None if visit() wants them."""
        item = instance.object
        # Duplicated objects are temporaries that Blender reuses; the object they were made from lasts.
        lasting, data = instance.instance_object, item.data
        if isinstance(data, GEOMETRY):
            pieces = list(self.pieces(instance, lasting or item))
            if lasting:
                return together([self.visit_duplicate(instance, item, lasting, piece) for piece in pieces])
            for piece in pieces:
                prototype = self.add_prototype(item, item, item, piece)
                if prototype:
                    adder(prototype.matrices)(instance.matrix_world)
            return None
        if isinstance(data, bpy.types.Light):
            visibility = self.visibility(item, instance.parent if lasting else item)
            self.note_linking(item)
            matrix = np.array(instance.matrix_world, np.float32)
            self.found.lights.append((item.name, data, matrix, visibility, None if lasting else item))
            return None
        if item.type in UNSUPPORTED:
            self.warnings.add(f"{UNSUPPORTED[item.type]} are not supported yet; left out", item.name)
        return ()

    def pieces(self, instance, owner):
        """What an instance shows: its data, and the hair of its particles."""
        data = instance.object.data
        if instance.show_self and (self.view_layer.use_strand or not isinstance(data, bpy.types.Curves)):
            yield data
        if instance.show_particles and self.view_layer.use_strand and owner.particle_systems:
            yield from particle_hair(owner, self.style.is_render)

    def visit_duplicate(self, instance, item, lasting, mesh) -> tuple:
        parent = instance.parent
        key = (mesh.as_pointer(), lasting.as_pointer(), parent.as_pointer())
        if key not in self.known:
            prototype = self.add_prototype(item, lasting, parent, mesh)
            self.known[key] = (adder(prototype.matrices), prototype.randoms.append) if prototype else ()
        if self.known[key]:
            add_matrix, add_random = self.known[key]
            add_matrix(instance.matrix_world)
            add_random(instance.random_id)
        return self.known[key]

    def add_prototype(self, item, lasting, parent, mesh) -> Prototype | None:
        """None for what no ray sees."""
        visibility = self.visibility(item, parent)
        if not visibility:
            return None
        self.note_unsupported(item, parent)
        override = self.view_layer.material_override
        slots = [override if override else slot.material for slot in item.material_slots] or [override]
        is_mesh = isinstance(mesh, bpy.types.Mesh)
        if isinstance(mesh, ParticleHair):
            slots = [slots[min(max(mesh.system.settings.material - 1, 0), len(slots) - 1)]]
        prototype = Prototype(
            name=item.name,
            mesh=mesh,
            materials=slots,
            visibility=visibility,
            color=tuple(item.color),
            object_index=item.pass_index,
            holdout=parent.holdout_get(view_layer=self.view_layer),
            shadow_terminator_offset=item.shadow_terminator_shading_offset,
            shadow_terminator_geometry_offset=item.shadow_terminator_geometry_offset,
            object=lasting,
            parent=parent,
            is_plain=is_mesh and lasting == parent and item.type == lasting.type and not lasting.modifiers,
            style=None if is_mesh else self.style,
            is_deformed=bool(lasting.modifiers) or has_shape_keys(lasting),
        )
        self.found.prototypes.append(prototype)
        return prototype

    def note_unsupported(self, item, parent) -> None:
        if is_diced(parent, self.view_layer.id_data):
            self.warnings.add("adaptive subdivision is not supported yet; its fixed levels are rendered", parent.name)
        if item.is_shadow_catcher or parent.is_shadow_catcher:
            self.warnings.add("shadow catchers are not supported yet; rendered as an ordinary object", item.name)
        self.note_linking(item)

    def note_linking(self, item) -> None:
        if item.light_linking.receiver_collection or item.light_linking.blocker_collection:
            self.warnings.add("light linking is not supported yet; it lights and shadows everything", item.name)

    def visibility(self, item, parent) -> int:
        seen = ray_visibility(item)
        if parent != item:
            seen &= ray_visibility(parent)
        holdout = parent.holdout_get(view_layer=self.view_layer)
        if not holdout and parent.indirect_only_get(view_layer=self.view_layer):
            seen &= ~CAMERA
        return seen


def ray_visibility(item) -> int:
    return sum(bit for name, bit in VISIBILITY.items() if getattr(item, name)) & VISIBLE_TO_ALL


def is_diced(item, scene) -> bool:
    """Whether Cycles would subdivide the object by how large it is seen: its last modifier says so, or, up to 4.5, it says so itself and
    the scene takes what is experimental."""
    last = item.modifiers[-1] if item.modifiers else None
    if last is None or last.type != "SUBSURF" or not last.show_render:
        return False
    if hasattr(last, "use_adaptive_subdivision"):
        return last.use_adaptive_subdivision
    experimental = getattr(getattr(scene, "cycles", None), "feature_set", "") == "EXPERIMENTAL"
    return experimental and getattr(getattr(item, "cycles", None), "use_adaptive_subdivision", False)


def together(adders: list[tuple]) -> tuple:
    """What takes the matrix and the number for all of them."""
    taking = [pair for pair in adders if pair]
    if len(taking) < 2:
        return taking[0] if taking else ()
    return tuple(lambda value, k=k: [pair[k](value) for pair in taking] for k in (0, 1))


def has_shape_keys(item) -> bool:
    return getattr(item.original.data, "shape_keys", None) is not None


def adder(matrices):
    """Appends a matrix in the cheapest way: as a buffer from 5.0 on, before that by flattening in C."""
    if MATRICES_ARE_BUFFERS:
        return matrices.extend
    return lambda matrix: matrices.extend(chain.from_iterable(matrix))


def stack_matrices(prototypes: list[Prototype]) -> np.ndarray:
    """(n, 4, 4) float32 of all prototypes, one after the other."""
    numbers = np.frombuffer(b"".join(prototype.matrices for prototype in prototypes), np.float32).reshape(-1, 4, 4)
    # Buffers go by columns.
    return np.ascontiguousarray(numbers.transpose(0, 2, 1)) if MATRICES_ARE_BUFFERS else numbers


def usable(matrices: np.ndarray) -> np.ndarray:
    """Which matrices leave a surface: all finite, and at most one axis flattened."""
    finite = np.isfinite(matrices).all(axis=(1, 2))
    axes = np.where(finite[:, None, None], matrices[:, :3, :3], 0)
    # The largest cross product of two axes is the largest area that a unit square can keep.
    pairs = [np.cross(axes[:, :, i], axes[:, :, j]) for i, j in ((0, 1), (1, 2), (2, 0))]
    return finite & (np.abs(np.stack(pairs)).max(axis=(0, 2)) > 0)


def place(
    found: Collected, meshes: list[int | None], slots: list[list[int]], attributes: list[dict], warnings: Warnings
) -> list[Instance | None]:
    """One for each prototype, None where it has no mesh or no place; so go the three lists."""
    instances = []
    stacked = stack_matrices(found.prototypes)
    every_good = usable(stacked)
    end = 0
    for prototype, mesh, programs, values in zip(found.prototypes, meshes, slots, attributes, strict=True):
        start, end = end, end + len(memoryview(prototype.matrices).cast("B")) // MATRIX_BYTES
        if mesh is None:
            instances.append(None)
            continue
        matrices, good, randoms = stacked[start:end], every_good[start:end], randoms_of(prototype)
        if not good.all():
            warnings.add("its matrix is singular or not finite; left out", prototype.name)
            matrices, randoms = matrices[good], randoms[good]
            values = {n: v[good] if np.ndim(v) == 2 and len(v) == len(good) else v for n, v in values.items()}
        if not len(matrices):
            instances.append(None)
            continue
        single = len(matrices) == 1
        instances.append(
            Instance(
                name=prototype.name,
                mesh=mesh,
                matrix=matrices[0] if single else matrices,
                materials=programs,
                visibility=prototype.visibility,
                color=prototype.color,
                object_index=prototype.object_index,
                random=float(randoms[0]) if single else randoms,
                holdout=prototype.holdout,
                shadow_terminator_offset=prototype.shadow_terminator_offset,
                shadow_terminator_geometry_offset=prototype.shadow_terminator_geometry_offset,
                attributes={n: v[0] if np.ndim(v) == 2 and (single or len(v) == 1) else v for n, v in values.items()},
            )
        )
    return instances


def randoms_of(prototype: Prototype) -> np.ndarray:
    """(n,) float32, 0 to 1: Object Info's Random."""
    if not prototype.randoms:
        return np.array([random_of_name(prototype.name)], np.float32)
    return ((np.array(prototype.randoms, np.int64) & MASK) / MASK).astype(np.float32)
