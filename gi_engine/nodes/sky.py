"""The Sky texture: Blender's scattering skies become a small image and the sun's disc, the older ones a formula. No bpy."""

from __future__ import annotations

import functools
import math

import numpy as np

from .. import native
from ..scene_data import Image
from .program import COLOR

EARTH_RADIUS = 6371e3
MULTIPLE = ("MULTIPLE_SCATTERING",)
SINGLE = ("SINGLE_SCATTERING", "NISHITA")  # the latter until Blender 4.5
SMALLEST_SUN = 0.0005


def sky_texture(b, direction):
    if b.node.sky_type in MULTIPLE + SINGLE:
        return scattering(b, direction)
    n = b.node
    sun = unit(tuple(n.sun_direction))
    if n.sky_type == "HOSEK_WILKIE":
        return b.op(
            "sky_hosek_wilkie", direction, imm=(b.table(hosek_wilkie(sun, n.turbidity, n.ground_albedo)),), kind=COLOR
        )
    return b.op("sky_preetham", direction, imm=(b.table(preetham(sun, n.turbidity)),), kind=COLOR)


def unit(direction: tuple) -> np.ndarray:
    return np.array(direction) / (np.linalg.norm(direction) or 1.0)


def direction_of(theta: float, sun: np.ndarray) -> tuple[float, float, float]:
    """The direction at `theta` from the zenith with the azimuth of `sun`."""
    phi = math.atan2(sun[0], sun[1])
    return math.sin(theta) * math.sin(phi), math.sin(theta) * math.cos(phi), math.cos(theta)


# -------------------------------------------------------------------- Hosek and Wilkie


def hosek_wilkie(sun: np.ndarray, turbidity: float, albedo: float) -> np.ndarray:
    """The floats of the native SunnyHosekWilkieSky for a sun in the direction `sun`, at the horizon if it has set."""
    theta = min(math.acos(min(max(sun[2], -1.0), 1.0)), math.pi / 2)
    numbers = native.module().sky_hosek_wilkie(turbidity, albedo, math.pi / 2 - theta)
    return np.array([*direction_of(theta, sun), *numbers], np.float32)


# -------------------------------------------------------------------- scattering


def scattering(b, direction):
    n = b.node
    elevation, rotation = sun_position(n.sun_elevation, n.sun_rotation)
    size = max(n.sun_size, SMALLEST_SUN)
    # "Dust" was renamed "aerosol" in Blender 5.0.
    aerosol = n.aerosol_density if hasattr(n, "aerosol_density") else n.dust_density
    model = (n.sky_type in MULTIPLE, elevation, size, n.altitude, n.air_density, aerosol, n.ozone_density)
    pixels, bottom, top = sky_table(*model)
    image = b.image(("sky", *model), lambda: [Image("sky", pixels, alpha="NONE")])
    horizon = -(math.pi / 2 - math.asin(EARTH_RADIUS / (EARTH_RADIUS + max(n.altitude, 0.0))))
    sun = (-math.cos(elevation) * math.sin(rotation), math.cos(elevation) * math.cos(rotation), math.sin(elevation))
    reach = math.cos(min(0.5 * size + 1e-3, math.pi)) if n.sun_disc else 2.0  # a little wide: floats are coarse there
    alone = n.sky_type == "NISHITA"  # until Blender 4.5 the disc ends at the horizon
    disc = (*bottom, *top, elevation, rotation, *sun, reach, size, n.sun_intensity, -1e-7 if alone else horizon, alone)
    return b.op("sky", direction, imm=(image, b.table(disc)), kind=COLOR)


@functools.lru_cache(maxsize=4)
def sky_table(*model):
    """Kept from export to export: a table takes some tenths of a second."""
    return native.module().sky(*model)


def sun_position(elevation: float, rotation: float) -> tuple[float, float]:
    """Elevation within a quarter turn, over the zenith turned around; rotation counted the other way, within a turn."""
    elevation = math.fmod(elevation, math.tau)
    if abs(elevation) >= math.pi:
        elevation -= math.copysign(math.tau, elevation)
    if abs(elevation) >= math.pi / 2:
        elevation = math.copysign(math.pi, elevation) - elevation
        rotation += math.pi
    return elevation, math.tau - rotation % math.tau


# -------------------------------------------------------------------- Preetham

# Coefficients of the Perez function by turbidity (slope and offset) for Y, x and y. [Preetham et al. 1999, appendix A.2]
PEREZ = (
    ((0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)),
    ((-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)),
    ((-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)),
)
# Chromaticity of the zenith: rows by power of turbidity (2, 1, 0), columns by power of the sun's angle (3 to 0).
ZENITH = (
    ((0.00166, -0.00375, 0.00209, 0.0), (-0.02903, 0.06377, -0.03202, 0.00394), (0.11693, -0.21196, 0.06052, 0.25886)),
    ((0.00275, -0.00610, 0.00317, 0.0), (-0.04214, 0.08970, -0.04153, 0.00516), (0.15346, -0.26756, 0.06670, 0.26688)),
)
LUMINANCE_SCALE = 0.06  # Blender's: kcd/m2 to scene-linear


def preetham(sun: np.ndarray, turbidity: float) -> np.ndarray:
    """The floats of the native PreethamSky for a sun in the direction `sun`."""
    theta = math.acos(min(max(sun[2], -1.0), 1.0))
    chi = (4.0 / 9.0 - turbidity / 120.0) * (math.pi - 2.0 * theta)
    luminance = ((4.0453 * turbidity - 4.9710) * math.tan(chi) - 0.2155 * turbidity + 2.4192) * LUMINANCE_SCALE
    powers = np.array([theta**3, theta**2, theta, 1.0])
    chromaticity = [float(np.array([turbidity**2, turbidity, 1.0]) @ np.array(rows) @ powers) for rows in ZENITH]
    table = [*direction_of(theta, sun)]
    for zenith, slopes in zip((luminance, *chromaticity), PEREZ, strict=True):
        a, b, c, d, e = (slope * turbidity + offset for slope, offset in slopes)
        at_zenith = (1.0 + a * math.exp(b)) * (1.0 + c * math.exp(d * theta) + e * math.cos(theta) ** 2)
        table += [zenith / at_zenith, a, b, c, d, e]
    return np.array(table, np.float32)
