"""Small scenes on which all unbiased integrators must agree, each with something that one way of walking might get wrong."""

import math

import numpy as np
from light_scenes import lamp, matrix, with_world
from test_closed_forms import cube, looking, quad, scene_of, shiny, sphere, surface
from test_closures import stack_layers

from gi_engine import scene_data as sd
from gi_engine.nodes.program import ProgramBuilder


def program(fill, name="material"):
    b = ProgramBuilder()
    fill(b)
    return b.finish(name)


def rough_glass(b):
    b.op("glass", 1.0, (0.9, 1, 0.95), 0.3, 1.5, (0, 0, 0), 0.0, 1.33, imm=(2,))


def clear_glass(b):
    b.op("glass", 1.0, (0.9, 1, 0.95), 0.0, 1.5, (0, 0, 0), 0.0, 1.33, imm=(0,))


def gloss_of_all_bounces(b):
    b.op("glossy", 1.0, (0.9, 0.6, 0.3), 0.4, 0.0, 0.0, (0, 0, 0), (0, 0, 0), imm=(2,))


def principled(**changes):
    return lambda b: stack_layers(b, **{"base_color": (0.7, 0.3, 0.2), "roughness": 0.4, **changes})


def bumpy_normal(b):
    waves = b.op("vector_sine", b.op("vector_multiply", b.op("position"), (9, 9, 9)))
    return b.op("vector_normalize", b.op("vector_add", b.op("normal"), b.op("vector_multiply", waves, (0.25,) * 3)))


def bumpy_diffuse(b):
    b.op("diffuse", 1.0, (0.7, 0.6, 0.5), 0.0, bumpy_normal(b))


def bumpy_gloss(b):
    b.op("glossy", 1.0, (0.8, 0.8, 0.8), 0.4, 0.0, 0.0, bumpy_normal(b), (0, 0, 0), imm=(0,))


def mirror_and_diffuse(b):
    b.op("diffuse", 0.6, (0.7, 0.6, 0.5), 0.0, (0, 0, 0))
    b.op("glossy", 0.4, (0.9, 0.9, 0.9), 0.0, 0.0, 0.0, (0, 0, 0), (0, 0, 0), imm=(0,))


def light_along_x(b):
    b.op("emission", 1.0, b.op("position"), 4.0)


def half_transparent(b):
    b.op("diffuse", 0.5, (0.8, 0.6, 0.4), 0.0, (0, 0, 0))
    b.op("transparent", 0.5, (0.9, 0.95, 1.0))


def translucent(b):
    b.op("translucent", 1.0, (0.8, 0.7, 0.3), (0, 0, 0))


def smooth(item):
    """A ball about the origin with its smooth normals."""
    normals = item.positions / np.linalg.norm(item.positions, axis=1, keepdims=True)
    item.normals_domain, item.normals = "POINT", np.ascontiguousarray(normals, np.float32)
    return item


def room(*things, lights=(), world=None, floor=None):
    """A floor and two walls."""
    parts = (
        (quad((-3, -3, -1), (3, -3, -1), (3, 3, -1), (-3, 3, -1)), floor or surface(0.6)),
        (quad((-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1)), surface(0.7)),
        (quad((-1, -1, -1), (-1, 1, -1), (-1, 1, 1), (-1, -1, 1)), surface(0.4)),
    )
    return scene_of(*parts, *things, lights=lights, world=world)


def ball(material, *lights, flat=False, **more):
    """With a ball of `material`: how it is shaded, or a function that writes its program."""
    item = sphere(0.5, 16)
    material = program(material) if callable(material) else material
    return room((item if flat else smooth(item), material), lights=lights or (area(),), **more)


def point(**fields):
    return lamp("POINT", (30.0,) * 3, matrix=matrix((0.3, -0.4, 1.2)), **fields)


def spot(**fields):
    return lamp("SPOT", (60.0,) * 3, matrix=matrix((0.3, -0.4, 1.4)), spot_size=1.2, spot_blend=0.5, **fields)


def area(**fields):
    return lamp("AREA", (30.0, 20.0, 10.0), matrix=matrix((0.3, -0.2, 1.3)), size=(0.6, 0.4), **fields)


def wide(**fields):
    return lamp("AREA", (60.0, 40.0, 20.0), matrix=matrix((0.3, -0.2, 1.6)), size=(2.0, 2.0), **fields)


def sun(angle):
    c, s = math.cos(0.4), math.sin(0.4)
    return lamp("SUN", (3.0,) * 3, matrix=matrix((0, 0, 0), (1, 0, 0), (0, c, s), (0, -s, c)), angle=angle)


def panel(fill):
    corners = ((-0.4, -0.4, 1.2), (-0.4, 0.4, 1.2), (0.4, 0.4, 1.2), (0.4, -0.4, 1.2))
    return quad(*corners), program(fill) if callable(fill) else fill


def sky(b):
    """Bright towards one side, black in half of all directions."""
    b.op("emission", 1.0, b.op("vector_maximum", b.op("position"), (0, 0, 0)), 1.5)


def sheet(fill):
    return quad((-0.5, -0.6, 0.0), (0.9, -0.6, 0.1), (0.9, 0.8, 0.2), (-0.5, 0.8, 0.1)), program(fill)


def tinted(fill, *lights):
    """A block that is nothing but what absorbs, within which a ball floats."""
    block = program(lambda b: b.op("transparent", 1.0, (1, 1, 1)))
    block.only_volume = True
    scene = ball(GREY, *lights)
    scene.meshes.append(cube(0.6))
    scene.instances.append(sd.Instance("block", len(scene.meshes) - 1, matrix(), [len(scene.programs)]))
    block.volume = len(scene.programs) + 1
    scene.programs += [block, program(fill)]
    return scene


def absorbs_along_x(b):
    amount = b.op("vector_add", b.op("position"), (0.7, 0.9, 1.5))
    b.op("volume_coefficients", 1.0, amount, (0, 0, 0), (0, 0, 0), 0.0, 0.0, imm=(0,))


def tuft(shape, fill, *lights):
    """Thick hair that comes out of the floor, or points about it."""
    rng = np.random.default_rng(3)
    count, keys = 24, 1 if shape == "SPHERE" else 5
    root, bend = rng.uniform(-0.6, 0.6, (count, 1, 3)), rng.normal(0, 0.25, (count, 1, 3))
    t = np.linspace(0, 1, keys)[None, :, None]
    positions = (
        root * (1, 1, 0) - (0, 0, 1.1 if keys > 1 else 0.9) + t * (0, 0, 1.2) + bend * (t * t + (keys == 1))
    ).reshape(-1, 3)
    first = None if keys == 1 else np.arange(0, count * keys + 1, keys, dtype=np.int32)
    radius = rng.uniform(0.05, 0.12, count * keys).astype(np.float32)
    hair = sd.Strands("tuft", shape, np.ascontiguousarray(positions, np.float32), radius, first, 2)
    return room((hair, program(fill) if callable(fill) else fill), lights=lights or (area(),))


def fibre(b):
    along, _, _, met = b.op("strand")
    b.op("hair_chiang", 1.0, (0.3, 0.6, 1.0), 0.3, 0.4, 0.0, 0.03, 1.55, along, met, imm=(1,))


GREY = surface(0.5)
STRANDS = {
    "ribbons": lambda: tuft("RIBBON", GREY),
    "tubes": lambda: tuft("THICK", GREY),
    "straight tubes of fibre": lambda: tuft("THICK_LINEAR", fibre),
    "ribbons of fibre": lambda: tuft("RIBBON", fibre, area(), point()),
    "points": lambda: tuft("SPHERE", principled()),
    "see-through ribbons": lambda: tuft("RIBBON", half_transparent),
}
SCENES = {
    "point lamp": lambda: ball(GREY, point(), flat=True),
    "smooth normals": lambda: ball(GREY, point()),
    "sphere lamp": lambda: ball(GREY, point(radius=0.3, soft_falloff=False)),
    "soft lamp": lambda: ball(GREY, point(radius=0.3)),
    "spot": lambda: ball(GREY, spot(radius=0.1)),
    "area lamp": lambda: ball(GREY),
    "spread": lambda: ball(GREY, area(spread=0.9)),
    "lamp without mis": lambda: ball(GREY, area(use_mis=False)),
    "lamp of few bounces": lambda: ball(GREY, area(max_bounces=1)),
    "lamp that gloss sees": lambda: ball(shiny(0.4), wide(visibility=sd.VISIBLE_TO_ALL & ~sd.CAMERA & ~sd.DIFFUSE)),
    "sun": lambda: ball(GREY, sun(0.0)),
    "wide sun": lambda: ball(GREY, sun(0.5)),
    "even world": lambda: ball(GREY, world=0.7),
    "sky": lambda: with_world(room((smooth(sphere(0.5, 12)), GREY)), program(sky)),
    "emissive mesh": lambda: room(panel(surface(0.0, 8.0)), (smooth(sphere(0.5, 12)), GREY)),
    "textured emitter": lambda: room(panel(light_along_x), (smooth(sphere(0.5, 12)), GREY)),
    "gloss": lambda: ball(shiny(0.4)),
    "gloss of all bounces": lambda: ball(gloss_of_all_bounces),
    "rough glass": lambda: ball(rough_glass),
    "principled": lambda: ball(principled()),
    "coat": lambda: ball(principled(coat=1.0, coat_roughness=0.3, sheen=0.5)),
    "metal": lambda: ball(principled(metallic=0.7, roughness=0.5)),
    "principled glass": lambda: ball(principled(transmission=0.8, roughness=0.5)),
    "bumpy": lambda: ball(bumpy_diffuse),
    "bumpy gloss": lambda: ball(bumpy_gloss),
    "translucent": lambda: room(sheet(translucent), lights=(area(),)),
    "transparent shadows": lambda: room(sheet(half_transparent), lights=(area(),)),
    "tinted block": lambda: tinted(absorbs_along_x, point(), area()),
    "two lamps": lambda: ball(GREY, point(), area()),
}  # fmt: skip
# Images in mirrors and through glass, which light tracing does not see, under a lamp so large that path tracing finds caustics.
CAUSTICS = {
    "mirror": lambda: ball(shiny(0.0), wide()),
    "clear glass": lambda: ball(clear_glass, wide()),
    "clear glass in the sun": lambda: ball(clear_glass, sun(1.0)),
    "principled glass, smooth": lambda: ball(principled(transmission=0.8, roughness=0.0), wide()),
    "mirror and diffuse": lambda: ball(mirror_and_diffuse, wide()),
}

# Where even a path that meets the lamp by chance has it often enough.
WIDE = {
    "wide lamp": lambda: ball(principled(), wide()),
    "wide lamp and rough glass": lambda: ball(rough_glass, wide()),
    "sky": SCENES["sky"],
}

AT, TOWARDS = (1.3, -3.0, 1.2), (-1.2, 3.0, -1.4)
INSIDE, ALONG = (0.6, -0.9, 0.2), (-0.3, 1.0, -0.2)
FRAME = (-0.6, 0.6, -0.6, 0.6)


def camera(kind="PERSP", frame=FRAME, position=AT, direction=TOWARDS, clip_start=0.1, **fields):
    return sd.Camera("camera", kind, looking(position, direction), frame, clip_start, 100.0, **fields)


def panorama(**fields):
    return camera("PANO", position=INSIDE, direction=ALONG, clip_start=0.05, **fields)


LENS = {"aperture_radius": 0.15, "focus_distance": 2.6}
CAMERAS = {
    "perspective": camera,
    "shifted and clipped": lambda: camera(frame=(-0.3, 0.9, -0.7, 0.5), clip_start=2.8),
    "depth of field": lambda: camera(**LENS, aperture_blades=5, aperture_rotation=0.3, aperture_ratio=1.5),
    "orthographic": lambda: camera("ORTHO", (-1.6, 1.6, -1.6, 1.6)),
    "orthographic, depth of field": lambda: camera("ORTHO", (-1.6, 1.6, -1.6, 1.6), **LENS),
    "panorama": panorama,
    "part of a panorama": lambda: panorama(latitude=(-0.9, 0.4), longitude=(-1.2, 0.9)),
    "panorama, depth of field": lambda: panorama(aperture_radius=0.1, focus_distance=1.2),
}
