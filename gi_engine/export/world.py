"""The world's own settings to scene_data.World; its nodes are compiled elsewhere."""

from __future__ import annotations

from ..scene_data import CAMERA, DIFFUSE, GLOSSY, SHADOW, TRANSMISSION, VISIBLE_TO_ALL, VOLUME, World

VISIBILITY = {
    "camera": CAMERA,
    "shadow": SHADOW,
    "diffuse": DIFFUSE,
    "glossy": GLOSSY,
    "transmission": TRANSMISSION,
    "scatter": VOLUME,
}


def export_world(world, program: int) -> World:
    """`world` is the evaluated bpy World, or None for a black one."""
    if world is None:
        return World()
    cycles = getattr(world, "cycles", None)
    return World(
        program=program,
        visibility=world_visibility(getattr(world, "cycles_visibility", None)),
        sampling=getattr(cycles, "sampling_method", "AUTOMATIC"),
        map_resolution=getattr(cycles, "sample_map_resolution", 1024),
        max_bounces=getattr(cycles, "max_bounces", 1024),
    )


def world_visibility(flags) -> int:
    if flags is None:
        return VISIBLE_TO_ALL
    return sum(bit for name, bit in VISIBILITY.items() if getattr(flags, name, True))
