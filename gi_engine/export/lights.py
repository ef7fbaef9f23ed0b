"""Lamps to scene_data.Light, in the units that Cycles reads them in.

Portals are left out: they only guide Cycles' sampling and give no light.
"""

from __future__ import annotations

import math

import numpy as np

from ..scene_data import Light


def export_light(name: str, light, matrix: np.ndarray, visibility: int, program: int) -> Light | None:
    """`light` is the evaluated bpy Light; None for a portal."""
    cycles = getattr(light, "cycles", None)
    if light.type == "AREA" and getattr(cycles, "is_portal", False):
        return None
    lamp = Light(
        name=name,
        kind=light.type,
        matrix=matrix,
        color=emitted_color(light),
        normalize=light.normalize,
        program=program,
        visibility=visibility,
        cast_shadow=light.use_shadow,
        use_mis=getattr(cycles, "use_multiple_importance_sampling", True),
        max_bounces=getattr(cycles, "max_bounces", 1024),
    )
    SHAPES[light.type](light, lamp)
    return lamp


def emitted_color(light) -> tuple[float, float, float]:
    """colour x temperature x energy x 2^exposure."""
    strength = light.energy * 2.0**light.exposure
    tint = light.temperature_color if light.use_temperature else (1.0, 1.0, 1.0)
    return tuple(c * t * strength for c, t in zip(light.color, tint, strict=True))


def shape_point(light, lamp: Light) -> None:
    lamp.radius = light.shadow_soft_size
    lamp.soft_falloff = light.use_soft_falloff


def shape_spot(light, lamp: Light) -> None:
    shape_point(light, lamp)
    lamp.spot_size, lamp.spot_blend = light.spot_size, light.spot_blend


def shape_area(light, lamp: Light) -> None:
    lamp.shape = "ELLIPSE" if light.shape in {"DISK", "ELLIPSE"} else "RECTANGLE"
    both = light.shape in {"RECTANGLE", "ELLIPSE"}
    lamp.size = (light.size, light.size_y if both else light.size)
    lamp.spread = light.spread


def shape_sun(light, lamp: Light) -> None:
    lamp.angle = min(light.angle, math.pi)


SHAPES = {"POINT": shape_point, "SPOT": shape_spot, "AREA": shape_area, "SUN": shape_sun}
