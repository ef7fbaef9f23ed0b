"""One scene per kind of lamp, of world and of camera: a plane, a turned cube and a glossy ball, 48 pixels square."""

import math

import bpy

from .studio import SKY, Case, ball, camera, cube, lamp, material, node, output, socket_of, square, tree_of, world


def subjects():
    grey = material("grey", Color=(0.8, 0.5, 0.2))
    square(grey, 4.0)
    cube(grey, 0.3, location=(-0.7, 0.1, 0.301), rotation=(0, 0, 0.35))
    ball(
        material("glossy", "ShaderNodeBsdfAnisotropic", {"distribution": "GGX"}, Color=(0.8, 0.8, 0.8), Roughness=0.3),
        0.4,
        location=(0.6, 0.1, 0.401),
    )


def lit(name, kind, look=None, **properties):
    def build(scene):
        subjects()
        camera(angle=28)
        properties.setdefault("location", (0.3, 0.2, 2.0))
        properties.setdefault("rotation", (0.2, -0.15, 0.4))
        made = lamp(kind, **properties)
        if look:
            look(made)

    return Case(name, build)


def under(name, make_world):
    def build(scene):
        subjects()
        camera(angle=28)
        make_world(tree_of(scene.world))

    return Case(name, build)


def background(tree, color, strength=1.0):
    output(
        tree, node(tree, "ShaderNodeBackground", None, {"Color": color, "Strength": strength}), "ShaderNodeOutputWorld"
    )


def gradient_world(tree):
    place = node(tree, "ShaderNodeTexCoord")
    background(tree, place.outputs["Generated"])


def sky(tree, kinds, **properties):
    texture = tree.nodes.new("ShaderNodeTexSky")
    known = {item.identifier for item in texture.bl_rna.properties["sky_type"].enum_items}
    texture.sky_type = next(kind for kind in kinds if kind in known)
    for key, value in properties.items():
        setattr(texture, key, value)
    background(tree, texture.outputs[0], 0.3)


def picture(width=64, height=32):
    """A float image: a dim sky with a small, bright window."""
    import numpy as np

    image = bpy.data.images.new("light probe", width, height, float_buffer=True)
    pixels = np.full((height, width, 4), 0.2, np.float32)
    pixels[..., 0] *= np.linspace(0.5, 1.5, width)[None]
    pixels[20:26, 40:46, :3] = (30.0, 25.0, 15.0)
    pixels[..., 3] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    return image


def probe(tree, **properties):
    texture = node(tree, "ShaderNodeTexEnvironment", properties)
    texture.image = picture()
    background(tree, texture.outputs[0])


def lamp_program(made):
    """A lamp whose emission depends on where it shines to."""
    tree = tree_of(made.data)
    place = node(tree, "ShaderNodeTexCoord")
    shader = node(tree, "ShaderNodeEmission", None, {"Color": place.outputs["Normal"], "Strength": 2.0})
    output(tree, shader, "ShaderNodeOutputLight")
    made.data.use_nodes = True


def stretched(made):
    made.scale = (2.0, 0.5, 1.0)


def unseen_by(*kinds):
    def after(made):
        for kind in kinds:
            setattr(made, f"visible_{kind}", False)

    return after


def shining_mesh(name, one_sided=False, factor=1.0):
    def build(scene):
        subjects()
        camera(angle=28)
        made = bpy.data.materials.new("shining")
        tree = tree_of(made)
        shader = node(tree, "ShaderNodeEmission", None, {"Color": (1.0, 0.8, 0.5), "Strength": 6.0 * factor})
        if one_sided:
            side = node(tree, "ShaderNodeNewGeometry")
            front = node(tree, "ShaderNodeMath", {"operation": "SUBTRACT"}, {0: 1.0, 1: side.outputs["Backfacing"]})
            strength = node(tree, "ShaderNodeMath", {"operation": "MULTIPLY"}, {0: front.outputs[0], 1: 8.0})
            tree.links.new(strength.outputs[0], socket_of(shader.inputs, "Strength"))
        output(tree, shader)
        square(made, 0.4, location=(0.2, -0.3, 1.5), rotation=(math.pi - 0.3, 0.2, 0))
        if not one_sided:
            ball(made, 0.12, rings=8, location=(-0.2, -0.6, 0.3))

    return Case(name, build)


def many_lamps(scene):
    subjects()
    camera(angle=28)
    for i in range(40):
        a = i * 2.4
        lamp("POINT", (1.5 * math.cos(a), 1.5 * math.sin(a), 0.4 + 0.05 * i), (0, 0, 0), 4.0 + i % 5, shadow_soft_size=0.05,
             color=(1.0, 0.4 + 0.015 * i, 0.3))  # fmt: skip
    lamp("SUN", (0, 0, 4), (0.5, 0.3, 0), 0.5, angle=0.05)
    world(SKY, 0.2)


def through_lens(name, size=(48, 48), pixel=(1.0, 1.0), after=None, **properties):
    def build(scene):
        subjects()
        world(SKY, 2.0)
        lamp("SUN", (0, 0, 4), (0.5, 0.3, 0), 2.0, angle=0.1)
        place = properties.pop("place", {})
        made = camera(**place, **properties)
        scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = pixel
        if after:
            after(made)

    return Case(name, build, size)


def focus(blades=0, ratio=1.0, rotation=0.0, fstop=0.1):
    def after(made):
        lens = made.data.dof
        lens.use_dof, lens.focus_distance, lens.aperture_fstop = True, 4.5, fstop
        lens.aperture_blades, lens.aperture_ratio, lens.aperture_rotation = blades, ratio, rotation

    return after


def panorama(made):
    made.data.panorama_type = "EQUIRECTANGULAR"
    made.location = (0.0, -0.5, 0.6)
    made.rotation_euler = (1.4, 0.1, 0.4)


WIDE = (64, 40)
CASES = [
    lit("point", "POINT", shadow_soft_size=0.0),
    lit("point, radius, soft", "POINT", shadow_soft_size=0.3),
    lit("point, radius, hard", "POINT", shadow_soft_size=0.3, use_soft_falloff=False),
    lit("point, not normalized", "POINT", shadow_soft_size=0.2, normalize=False, energy=20.0),
    lit("point, temperature, exposure", "POINT", use_temperature=True, temperature=3200.0, exposure=0.5),
    lit("point, node program", "POINT", lamp_program, shadow_soft_size=0.1),
    lit("spot", "SPOT", shadow_soft_size=0.0, spot_size=1.2, spot_blend=0.3),
    lit("spot, radius", "SPOT", shadow_soft_size=0.2, spot_size=1.0, spot_blend=0.6),
    lit("spot, stretched", "SPOT", stretched, shadow_soft_size=0.1, spot_size=1.0, spot_blend=0.5),
    lit("area, rectangle", "AREA", shape="RECTANGLE", size=0.8, size_y=0.3),
    lit("area, square", "AREA", shape="SQUARE", size=0.6),
    lit("area, disk", "AREA", shape="DISK", size=0.6),
    lit("area, ellipse", "AREA", shape="ELLIPSE", size=0.8, size_y=0.3),
    lit("area, spread", "AREA", shape="RECTANGLE", size=0.8, size_y=0.5, spread=1.0),
    lit("area, stretched", "AREA", stretched, shape="SQUARE", size=0.5),
    lit(
        "area, seen",
        "AREA",
        shape="SQUARE",
        size=0.5,
        location=(-0.2, 0.4, 0.9),
        rotation=(0.9, 0, 0),
        energy=8.0,
        visible=True,
    ),
    lit("lamp not for diffuse", "AREA", unseen_by("diffuse"), shape="SQUARE", size=0.6),
    lit("lamp not for glossy", "AREA", unseen_by("glossy"), shape="SQUARE", size=0.6),
    lit("sun", "SUN", energy=3.0, angle=0.0, rotation=(0.5, 0.3, 0)),
    lit("sun, angle", "SUN", energy=3.0, angle=0.2, rotation=(0.5, 0.3, 0)),
    lit("lamp of weak diffuse", "POINT", shadow_soft_size=0.1, diffuse_factor=0.3, specular_factor=0.6),
    Case("forty lamps, a sun, a sky", many_lamps),
    shining_mesh("emissive mesh"),
    shining_mesh("emissive mesh, one side", one_sided=True),
    under("world, constant", lambda tree: background(tree, (0.3, 0.5, 0.9), 2.0)),
    under("world, gradient", gradient_world),
    under("world, image", probe),
    under("world, mirror ball image", lambda tree: probe(tree, projection="MIRROR_BALL")),
    under("sky, single scattering", lambda tree: sky(tree, ("SINGLE_SCATTERING", "NISHITA"), sun_elevation=0.4)),
    under("sky, multiple scattering", lambda tree: sky(tree, ("MULTIPLE_SCATTERING", "NISHITA"), sun_elevation=0.4)),
    under("sky without sun", lambda tree: sky(tree, ("MULTIPLE_SCATTERING", "NISHITA"), sun_disc=False)),
    under("sky, Preetham", lambda tree: sky(tree, ("PREETHAM",), turbidity=3.0)),
    under("sky, Hosek-Wilkie", lambda tree: sky(tree, ("HOSEK_WILKIE",), turbidity=3.0)),
    through_lens("perspective, wide", WIDE),
    through_lens("perspective, tall", (40, 64)),
    through_lens("perspective, shift", WIDE, shift_x=0.12, shift_y=-0.07),
    through_lens("perspective, vertical fit", WIDE, sensor_fit="VERTICAL", sensor_height=20.0),
    through_lens("perspective, pixel aspect", WIDE, pixel=(1.5, 1.0)),
    through_lens("perspective, clip", clip_start=6.0, clip_end=6.8),
    through_lens("orthographic", WIDE, type="ORTHO", ortho_scale=3.0, shift_y=0.1),
    through_lens("panorama", WIDE, after=panorama, type="PANO"),
    through_lens("depth of field", after=focus()),
    through_lens("depth of field, blades", after=focus(5, 1.0, 0.4)),
    through_lens("depth of field, anamorphic", after=focus(0, 2.0)),
]
