"""One tile per closure and variant on hair, ribbons and tubes, and on points: tufts seen from above."""

import bpy
import numpy as np

from .cases_materials import BRASS, GLOSSY, RED, light, of
from .studio import Unavailable, link, sheet, world

PRINCIPLED_HAIR, BLOND = "ShaderNodeBsdfHairPrincipled", (0.6, 0.35, 0.2)


def tuft(made, strands=12, keys=5):
    """Bent strands across the tile, over and under one another; their random numbers are the same in every tile."""
    rng = np.random.default_rng(7)
    data = bpy.data.hair_curves.new("tuft")
    data.add_curves([keys] * strands)
    t, turn = np.linspace(-0.42, 0.42, keys)[None, :], rng.uniform(-0.5, 0.5, (strands, 1))
    beside = np.linspace(-0.34, 0.34, strands)[:, None] + 0.05 * np.sin(7 * t + 6 * turn)
    place = np.stack([beside + turn * t, t - 0.3 * turn, 0.15 * np.cos(4 * t + 9 * turn) + 0.2 * turn], -1)
    data.attributes["position"].data.foreach_set("vector", place.astype(np.float32).ravel())
    thick = np.broadcast_to(np.linspace(0.035, 0.02, keys, dtype=np.float32), (strands, keys))
    data.attributes.new("radius", "FLOAT", "POINT").data.foreach_set("value", thick.ravel())
    data.materials.append(made)
    return link("tuft", data)


def drops(made, count=16):
    rng = np.random.default_rng(8)
    data = bpy.data.pointclouds.new("drops")
    if not hasattr(data, "resize"):
        raise Unavailable("point clouds by script")
    data.resize(count)
    place = rng.uniform((-0.33, -0.33, -0.2), (0.33, 0.33, 0.2), (count, 3)).astype(np.float32)
    data.attributes["position"].data.foreach_set("vector", place.ravel())
    radius = rng.uniform(0.05, 0.12, count).astype(np.float32)
    data.attributes.new("radius", "FLOAT", "POINT").data.foreach_set("value", radius)
    data.materials.append(made)
    return link("drops", data)


def hair(model, **inputs):
    return of(PRINCIPLED_HAIR, {"model": model}, **{"Color": BLOND, **inputs})


def strand(component, **inputs):
    return of("ShaderNodeBsdfHair", {"component": component}, Color=BRASS, **inputs)


ANY = {
    "diffuse": of("ShaderNodeBsdfDiffuse", Color=RED),
    "glossy": of(GLOSSY, {"distribution": "GGX"}, Color=BRASS, Roughness=0.4),
    "anisotropic": of(GLOSSY, {"distribution": "GGX"}, Color=BRASS, Roughness=0.4, Anisotropy=0.6),
    "glass": of("ShaderNodeBsdfGlass", None, Color=BRASS, Roughness=0.3),
    "translucent": of("ShaderNodeBsdfTranslucent", Color=RED),
    "transparent": of("ShaderNodeBsdfTransparent", Color=BRASS),
    "principled": of("ShaderNodeBsdfPrincipled", None, Base_Color=RED, Roughness=0.4),
}
# Cycles evaluates these closures on one side of a fibre's surface and samples them on both: a lamp on the other side it finds by samples
# alone, of which it loses those that it takes for found by both. Under a lamp and a sky that are sampled, tiles here are .5 to .9 % brighter
# than Cycles'; under a sky that is met by chance alone, they are as bright to 1e-4.
STRANDS = {
    "reflection": strand("Reflection", RoughnessU=0.3, RoughnessV=0.5),
    "reflection, narrow": strand("Reflection", RoughnessU=0.1, RoughnessV=0.3, Offset=0.2),
    "reflection, wide": strand("Reflection", RoughnessU=0.1, RoughnessV=1.0),
    "transmission": strand("Transmission", RoughnessU=0.3, RoughnessV=0.5),
}
FIBRES = {
    "chiang": hair("CHIANG"),
    "chiang, coat": hair("CHIANG", Coat=0.6, Roughness=0.5),
    "chiang, dark": hair("CHIANG", Color=(0.05, 0.02, 0.01)),
}
# Lit by the sky alone, too: where Cycles evaluates the model, for a lamp, light that is reflected more than once within the fibre is a
# fifth of what its samples bring.
MICROFACETS = {
    "huang": hair("HUANG", Aspect_Ratio=1.0),
    "huang, elliptic": hair("HUANG", Aspect_Ratio=0.6),
    "huang, rough": hair("HUANG", Aspect_Ratio=1.0, Roughness=0.7),
    "huang, dark": hair("HUANG", Aspect_Ratio=0.85, Color=(0.05, 0.02, 0.01)),
}


def sky():
    """Found by rays alone."""
    world((0.8, 0.9, 1.0))
    bpy.context.scene.world.cycles.sampling_method = "NONE"


def tubes(build):
    def built(scene):
        scene.cycles_curves.shape = "THICK"
        build(scene)

    return built


def of_tubes(case):
    case.build = tubes(case.build)
    return case


CASES = [
    sheet("hair", ANY | FIBRES, tuft, light),
    of_tubes(sheet("tubes", ANY | FIBRES, tuft, light)),
    sheet("hair, strands", STRANDS, tuft, sky),
    sheet("hair, microfacets", MICROFACETS, tuft, sky),
    sheet(
        "points", {name: make for name, make in ANY.items() if name != "anisotropic"}, drops, light
    ),  # they have no tangent
]
