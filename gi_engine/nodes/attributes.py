"""How shader nodes name what they want to know of objects, in scene_data.Scene.attribute_names. No bpy.

A plain name is an attribute of the mesh and "" its active UV map; the names below cannot be names of attributes.
"""

from __future__ import annotations

UNDEFORMED = ".undeformed"  # positions before deformation, for Generated coordinates
ACTIVE_COLOR = ".active_color"  # the colour attribute that renders
POINTINESS = ".pointiness"  # how far the surface bulges, by its edges
VERTEX_NORMAL = (
    ".vertex_normal"  # what true displacement wants of meshes that are flat, all or in part (Mesh.normals, sharp_face)
)
ISLAND = ".island"  # a random number for each part of the mesh that hangs together
# How far along its curve a point is (0 to 1), the curve's length (metres, object space), a random number of a curve or point.
STRAND_INTERCEPT, STRAND_LENGTH, STRAND_RANDOM = ".strand_intercept", ".strand_length", ".strand_random"
STRAND_NORMAL = ".strand_normal"  # of a curve's points, object space
# What each place of an instance knows: coordinates where its instancer made it, and its particle.
INSTANCER_GENERATED, INSTANCER_UV = "\x02generated", "\x02uv"
PARTICLE_STATE = "\x02particle state"  # index, random, age; lifetime
PARTICLE_PLACE = "\x02particle place"  # location; size
PARTICLE_VELOCITY, PARTICLE_SPIN = "\x02particle velocity", "\x02particle spin"
OF_PLACES = frozenset(
    {INSTANCER_GENERATED, INSTANCER_UV, PARTICLE_STATE, PARTICLE_PLACE, PARTICLE_VELOCITY, PARTICLE_SPIN}
)
PREFIXES = {"OBJECT": "\x01object:", "INSTANCER": "\x01instancer:"}  # properties, by their data path


def attribute_name(kind: str, name: str) -> str:
    """The name of an attribute of the Attribute node's type `kind` (GEOMETRY, OBJECT or INSTANCER)."""
    return PREFIXES.get(kind, "") + name


def property_paths(names, kind: str) -> dict[str, str]:
    """Those of `names` that are properties of `kind`: name -> data path."""
    prefix = PREFIXES[kind]
    return {name: name[len(prefix) :] for name in names if name.startswith(prefix)}


def four_numbers(value) -> tuple | None:
    """A property's value as a colour or vector; None where it is neither that nor a number."""
    if isinstance(value, (bool, int, float)):
        return (float(value),) * 3 + (1.0,)
    try:
        numbers = [float(x) for x in value]
    except (TypeError, ValueError):
        return None
    if not numbers or len(numbers) > 4:
        return None
    return tuple(numbers + [0.0] * (3 - len(numbers)) + [1.0] * (4 - max(len(numbers), 3)))


def look_up(owners, path: str) -> tuple | None:
    """The property at `path` of the first of `owners` that has it: a custom property's name or a path such as "color"."""
    for owner in owners:
        if owner is None:
            continue
        if path in owner.keys():
            return four_numbers(owner[path])
        try:
            return four_numbers(owner.path_resolve(path))
        except (ValueError, TypeError):
            continue
    return None
