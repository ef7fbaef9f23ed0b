"""Hair curves, the hair of particle systems, and point clouds to scene_data.Strands."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from .. import native
from ..nodes.attributes import STRAND_INTERCEPT, STRAND_LENGTH, STRAND_NORMAL, STRAND_RANDOM, UNDEFORMED
from ..scene_data import Attribute, Strands
from .arrays import read, read_attribute

SHAPES = {"RIBBONS": "RIBBON", "THICK": "THICK", "THICK_LINEAR": "THICK_LINEAR"}
POLY = 1  # Blender's number of curves that are straight between their points
CURVE_RADIUS, POINT_RADIUS = 0.005, 0.01  # metres, where there is no attribute
# By this texture space Generated coordinates are the object's own, as Cycles has them where it makes none.
OBJECT_SPACE = ((0.5, 0.5, 0.5), (0.5, 0.5, 0.5))
DOMAINS = {"POINT": "POINT", "CURVE": "FACE"}


@dataclass(frozen=True)
class CurveStyle:
    """The scene's settings of how curves are traced."""

    shape: str = "RIBBON"
    subdivisions: int = 2
    is_render: bool = True
    may_be_straight: bool = True  # whether curves that are polygons are traced as such


def curve_style(scene, is_render: bool) -> CurveStyle:
    """Cycles' settings, where it is there."""
    curves = getattr(scene, "cycles_curves", None)
    if curves is None:
        return CurveStyle(is_render=is_render)
    straight = "THICK_LINEAR" in curves.bl_rna.properties["shape"].enum_items  # not yet in Blender 4.5
    return CurveStyle(SHAPES.get(curves.shape, "RIBBON"), curves.subdivisions, is_render, straight)


@dataclass
class ParticleHair:
    """The hair of one particle system, in place of the mesh that it has none of."""

    object: object  # evaluated bpy Object
    modifier: object
    system: object
    is_render: bool
    before: int  # curves of the systems before this one

    def as_pointer(self) -> int:
        return self.system.as_pointer()

    @property
    def numbers(self) -> range:
        """Of the particles that are strands: the children, where there are some, instead of their parents."""
        settings = self.system.settings
        parents, children = len(self.system.particles), len(self.system.child_particles)
        if not self.is_render:
            children = int(children * settings.display_percentage / 100)
        return range(parents if settings.child_type != "NONE" and children else 0, parents + children)

    @property
    def keys(self) -> int:
        settings = self.system.settings
        steps = (1 << (settings.render_step if self.is_render else settings.display_step)) + 1
        return steps + (settings.kink_extra_steps if settings.kink == "SPIRAL" else 0)


def particle_hair(item, is_render: bool) -> list[ParticleHair]:
    """Of an evaluated object, as it stands in its modifiers."""
    found, before = [], 0
    if item.mode in {"PARTICLE_EDIT", "EDIT"}:
        return found
    for modifier in item.modifiers:
        if modifier.type != "PARTICLE_SYSTEM" or not (modifier.show_render if is_render else modifier.show_viewport):
            continue
        settings = modifier.particle_system.settings
        if settings.type == "HAIR" and settings.render_type == "PATH":
            found.append(ParticleHair(item, modifier, modifier.particle_system, is_render, before))
            before += len(found[-1].numbers)
    return found


def export_strands(source, name: str, wanted: set[str], style: CurveStyle) -> Strands | None:
    """`source`: bpy Curves or PointCloud, or ParticleHair. None where there is nothing."""
    if isinstance(source, ParticleHair):
        return export_particle_hair(source, name, wanted, style)
    position = source.attributes.get("position")
    if position is None or not len(position.data):
        return None
    positions = read(position.data, "vector", 3, np.float32)
    if isinstance(source, bpy.types.PointCloud):
        attributes = list(read_attributes(source, wanted))
        if STRAND_RANDOM in wanted:
            attributes.append(Attribute(STRAND_RANDOM, "POINT", random_numbers(0, len(positions))))
        radius = read_radius(source, len(positions), POINT_RADIUS)
        return Strands(name, "SPHERE", positions, radius, None, 0, attributes, "", OBJECT_SPACE)
    first = read(source.curve_offset_data, "value", 1, np.int32)
    radius = read_radius(source, len(positions), CURVE_RADIUS)
    attributes = list(read_attributes(source, wanted)) + own_attributes(positions, first, wanted, 0)
    if STRAND_NORMAL in wanted:
        attributes.append(Attribute(STRAND_NORMAL, "POINT", read_normals(source)))
    uv = first_uv_map(source)
    if "" in wanted and uv and uv not in wanted:
        attributes.append(Attribute(uv, "FACE", read_attribute(source.attributes[uv])))
    kind = source.attributes.get("curve_type")
    straight = (
        style.may_be_straight
        and kind is not None
        and kind.domain == "CURVE"
        and len(kind.data)
        and kind.data[0].value == POLY
    )
    shape = "THICK_LINEAR" if straight else style.shape
    return Strands(name, shape, positions, radius, first, style.subdivisions, attributes, uv, OBJECT_SPACE)


def read_radius(source, count: int, default: float) -> np.ndarray:
    radius = source.attributes.get("radius")
    if radius is None or radius.domain != "POINT" or radius.data_type != "FLOAT":
        return np.full(count, default, np.float32)
    return read(radius.data, "value", 1, np.float32)


def read_normals(source) -> np.ndarray:
    """One by one: Blender makes them for a loop and frees them after it, before foreach_get would read them."""
    return np.array([tuple(normal.vector) for normal in source.normals], np.float32).reshape(-1, 3)


def read_attributes(source, wanted: set[str]):
    for attribute in source.attributes:
        if attribute.name in wanted and attribute.domain in DOMAINS:
            data = read_attribute(attribute)
            if data is not None:
                yield Attribute(attribute.name, DOMAINS[attribute.domain], data)


def first_uv_map(source) -> str:
    """Curves have no map that is said to be active: Cycles takes the first that there is for each curve as a whole."""
    maps = (a.name for a in source.attributes if a.domain == "CURVE" and a.data_type == "FLOAT2")
    return next(maps, "")


def own_attributes(positions: np.ndarray, first: np.ndarray, wanted: set[str], before: int) -> list[Attribute]:
    """What Curves Info says: how far along its curve a point is, the curve's length, and a random number of it."""
    attributes = []
    if STRAND_INTERCEPT in wanted or STRAND_LENGTH in wanted:
        step = np.linalg.norm(np.diff(positions, axis=0, prepend=positions[:1]), axis=1)
        step[first[:-1][first[:-1] < len(step)]] = 0.0
        way = np.cumsum(step, dtype=np.float64)
        counts = np.diff(first)
        start = np.repeat(way[np.minimum(first[:-1], len(way) - 1)], counts)
        length = np.zeros(len(counts))
        length[counts > 0] = (way[first[1:] - 1] - way[np.minimum(first[:-1], len(way) - 1)])[counts > 0]
        along = (way - start) / np.maximum(np.repeat(length, counts), 1e-30)
        attributes.append(Attribute(STRAND_INTERCEPT, "POINT", along.astype(np.float32)[:, None]))
        attributes.append(Attribute(STRAND_LENGTH, "FACE", length.astype(np.float32)[:, None]))
    if STRAND_RANDOM in wanted:
        attributes.append(Attribute(STRAND_RANDOM, "FACE", random_numbers(before, len(first) - 1)))
    return attributes


def random_numbers(begin: int, count: int) -> np.ndarray:
    """(count, 1) float32, 0 to 1."""
    return np.asarray(native.module().random_of_numbers(np.arange(begin, begin + count, dtype=np.uint32)))[:, None]


# -------------------------------------------------------------------- particle systems


def export_particle_hair(hair: ParticleHair, name: str, wanted: set[str], style: CurveStyle) -> Strands | None:
    numbers, keys, settings = hair.numbers, hair.keys, hair.system.settings
    if not numbers:
        return None
    world = read_keys(hair, numbers, keys)
    to_object = np.array(hair.object.matrix_world.inverted_safe(), np.float64)
    positions = np.ascontiguousarray(world @ to_object[:3, :3].T + to_object[:3, 3], np.float32)
    first = np.arange(0, len(positions) + 1, keys, dtype=np.int32)
    along = own_attributes(positions, first, {STRAND_INTERCEPT}, 0)[0].data[:, 0]
    mesh = hair.object.data
    maps = {layer.name: k for k, layer in enumerate(mesh.uv_layers)}
    active_uv = next((layer.name for layer in mesh.uv_layers if layer.active_render), "")
    attributes = own_attributes(positions, first, wanted, hair.before)
    if UNDEFORMED in wanted:
        attributes.append(Attribute(UNDEFORMED, "FACE", positions[::keys].copy()))
    for uv, k in maps.items():
        if uv in wanted or ("" in wanted and uv == active_uv):
            attributes.append(Attribute(uv, "FACE", on_emitter(hair, hair.system.uv_on_emitter, uv_no=k)))
    colors = [a.name for a in mesh.attributes if a.data_type == "BYTE_COLOR" and a.domain == "CORNER"]
    for k, color in enumerate(colors):
        if color in wanted:
            encoded = on_emitter(hair, hair.system.mcol_on_emitter, vcol_no=k)
            attributes.append(Attribute(color, "FACE", linear_of_srgb(encoded)))
    return Strands(
        name,
        style.shape,
        positions,
        radius_along(settings, along, keys),
        first,
        style.subdivisions,
        attributes,
        active_uv,
        (tuple(mesh.texspace_location), tuple(mesh.texspace_size)),
    )


def read_keys(hair: ParticleHair, numbers, keys: int) -> np.ndarray:
    """(strands * keys, 3) in world space."""
    co_hair, item = hair.system.co_hair, hair.object
    world = np.array([co_hair(item, particle_no=n, step=k) for n in numbers for k in range(keys)], np.float64)
    if hair.system.settings.kink == "SPIRAL":
        # Strands that do not have the extra points stay where they end; Blender gives zeros.
        of_strands = world.reshape(-1, keys, 3)
        for k in range(1, keys):
            missing = (of_strands[:, k] == 0.0).all(1)
            of_strands[missing, k] = of_strands[missing, k - 1]
    return world


def radius_along(settings, along: np.ndarray, keys: int) -> np.ndarray:
    """From the root's radius to the tip's; `along` is 0 to 1."""
    root, tip = (0.5 * settings.radius_scale * r for r in (settings.root_radius, settings.tip_radius))
    shape, left = settings.shape, 1.0 - along
    if shape < 0.0:
        left = left ** (1.0 + shape)
    elif shape > 0.0:
        left = left ** (1.0 / max(1.0 - shape, 1e-6))
    radius = (left * (root - tip) + tip).astype(np.float32)
    if settings.use_close_tip:
        radius[keys - 1 :: keys] = 0.0
    return radius


def on_emitter(hair: ParticleHair, look_up, **which) -> np.ndarray:
    """Of the surface below each strand."""
    particles, last = hair.system.particles, len(hair.system.particles) - 1
    rows = [
        look_up(hair.modifier, particle=particles[min(n, last)], particle_no=n, **which)
        for n in hair.numbers
        if last >= 0
    ]
    return np.ascontiguousarray(rows, np.float32)


def linear_of_srgb(encoded: np.ndarray) -> np.ndarray:
    return np.where(encoded < 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4).astype(np.float32)
