"""One tile per closure and variant: smooth balls from above under a square lamp and a constant sky."""

import math

import bpy

from .studio import (
    LAMP,
    SKY,
    Case,
    Unavailable,
    ball,
    camera,
    cube,
    lamp,
    material,
    node,
    ortho_from_above,
    output,
    put,
    sheet,
    square,
    tree_of,
    world,
)

GLOSSY, GLASS, PRINCIPLED = "ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfGlass", "ShaderNodeBsdfPrincipled"
BRASS, RED = (0.9, 0.7, 0.4), (0.7, 0.2, 0.15)


def light():
    world(SKY)
    lamp("AREA", (2.5, 1.5, 6.0), (-0.25, 0.4, 0.0), 400.0, shape="SQUARE", size=1.5, color=LAMP)


def of(kind, properties=None, **inputs):
    return lambda name: material(name, kind, properties, **inputs)


def principled(**inputs):
    return of(PRINCIPLED, None, **{"Base_Color": RED, **inputs})


def distribution(kind, name, **inputs):
    return of(kind, {"distribution": name}, **inputs)


def combined(kind, **inputs):
    """Mix Shader or Add Shader of a diffuse and a glossy closure."""

    def make(name):
        from bpy import data

        made = data.materials.new(name)
        tree = tree_of(made)
        first = node(tree, "ShaderNodeBsdfDiffuse", None, {"Color": (0.1, 0.3, 0.7)})
        second = node(tree, GLOSSY, {"distribution": "GGX"}, {"Color": (0.3, 0.3, 0.3), "Roughness": 0.2})
        both = node(tree, kind, None, inputs)
        tree.links.new(first.outputs[0], both.inputs[-2])
        tree.links.new(second.outputs[0], both.inputs[-1])
        output(tree, both)
        return made

    return make


SIMPLE = {
    "diffuse": of("ShaderNodeBsdfDiffuse", Color=RED, Roughness=0.0),
    "diffuse rough": of("ShaderNodeBsdfDiffuse", Color=RED, Roughness=0.8),
    "translucent": of("ShaderNodeBsdfTranslucent", Color=RED),
    "transparent": of("ShaderNodeBsdfTransparent", Color=(0.8, 0.5, 0.3)),
    "emission": of("ShaderNodeEmission", Color=BRASS, Strength=2.0),
    "mirror": distribution(GLOSSY, "GGX", Color=BRASS, Roughness=0.0),
    "ggx 0.1": distribution(GLOSSY, "GGX", Color=BRASS, Roughness=0.1),
    "ggx 0.5": distribution(GLOSSY, "GGX", Color=BRASS, Roughness=0.5),
    "ggx 1.0": distribution(GLOSSY, "GGX", Color=BRASS, Roughness=1.0),
    "multi ggx": distribution(GLOSSY, "MULTI_GGX", Color=BRASS, Roughness=0.6),
    "beckmann": distribution(GLOSSY, "BECKMANN", Color=BRASS, Roughness=0.4),
    "ashikhmin shirley": distribution(GLOSSY, "ASHIKHMIN_SHIRLEY", Color=BRASS, Roughness=0.4),
    "anisotropic": distribution(GLOSSY, "GGX", Color=BRASS, Roughness=0.4, Anisotropy=0.7, Rotation=0.1),
    "sheen microfiber": of("ShaderNodeBsdfSheen", {"distribution": "MICROFIBER"}, Color=BRASS, Roughness=0.4),
    "sheen ashikhmin": of("ShaderNodeBsdfSheen", {"distribution": "ASHIKHMIN"}, Color=BRASS, Roughness=0.4),
    "toon diffuse": of("ShaderNodeBsdfToon", {"component": "DIFFUSE"}, Color=RED, Size=0.5, Smooth=0.2),
    "toon glossy": of("ShaderNodeBsdfToon", {"component": "GLOSSY"}, Color=RED, Size=0.5, Smooth=0.2),
    "metallic f82": of("ShaderNodeBsdfMetallic", {"fresnel_type": "F82"}, Base_Color=BRASS, Roughness=0.3),
    "metallic conductor": of("ShaderNodeBsdfMetallic", {"fresnel_type": "PHYSICAL_CONDUCTOR"}, Roughness=0.3),
    "mix shader": combined("ShaderNodeMixShader", Fac=0.3),
    "add shader": combined("ShaderNodeAddShader"),
    "holdout": of("ShaderNodeHoldout"),
}
CLEAR = {
    "glass 0": distribution(GLASS, "GGX", Roughness=0.0, IOR=1.5, Color=(0.9, 0.95, 1.0)),
    "glass 0.1": distribution(GLASS, "GGX", Roughness=0.1, IOR=1.5, Color=(0.9, 0.95, 1.0)),
    "glass 0.4": distribution(GLASS, "GGX", Roughness=0.4, IOR=1.5, Color=(0.9, 0.95, 1.0)),
    "glass multi ggx": distribution(GLASS, "MULTI_GGX", Roughness=0.5, IOR=1.4),
    "glass beckmann": distribution(GLASS, "BECKMANN", Roughness=0.3, IOR=1.5),
    "glass ior 0.8": distribution(GLASS, "GGX", Roughness=0.2, IOR=0.8),
    "refraction 0": of("ShaderNodeBsdfRefraction", {"distribution": "GGX"}, Roughness=0.0, IOR=1.4),
    "refraction 0.3": of("ShaderNodeBsdfRefraction", {"distribution": "GGX"}, Roughness=0.3, IOR=1.4),
    "refraction beckmann": of("ShaderNodeBsdfRefraction", {"distribution": "BECKMANN"}, Roughness=0.3, IOR=1.4),
}
LAYERED = {
    "principled": principled(),
    "principled 0.1": principled(Roughness=0.1),
    "principled metal": principled(Base_Color=BRASS, Metallic=1.0, Roughness=0.3),
    "principled half metal": principled(Metallic=0.5, Roughness=0.3),
    "principled diffuse roughness": principled(Diffuse_Roughness=0.8),
    "principled ior": principled(IOR=2.2, Roughness=0.2),
    "principled specular level": principled(Specular_IOR_Level=0.9, Roughness=0.2),
    "principled specular tint": principled(Specular_Tint=(1.0, 0.5, 0.2), Roughness=0.2),
    "principled anisotropic": principled(Metallic=1.0, Anisotropic=0.8, Anisotropic_Rotation=0.2, Roughness=0.4),
    "principled coat": principled(Coat_Weight=1.0, Coat_Roughness=0.1),
    "principled tinted coat": principled(Coat_Weight=0.7, Coat_Roughness=0.3, Coat_Tint=(0.9, 0.6, 0.3), Coat_IOR=1.7),
    "principled sheen": principled(Sheen_Weight=0.8, Sheen_Roughness=0.4, Sheen_Tint=BRASS),
    "principled glass": principled(Base_Color=(0.9, 0.95, 1.0), Transmission_Weight=1.0, Roughness=0.0),
    "principled rough glass": principled(Base_Color=(0.9, 0.95, 1.0), Transmission_Weight=1.0, Roughness=0.3),
    "principled half glass": principled(Transmission_Weight=0.5, Roughness=0.2),
    "principled emission": principled(Emission_Color=BRASS, Emission_Strength=0.6),
    "principled alpha": principled(Alpha=0.4),
    "principled thin film": principled(Roughness=0.2, Thin_Film_Thickness=400.0, Thin_Film_IOR=1.33),
    "principled thin film metal": principled(Metallic=1.0, Roughness=0.2, Thin_Film_Thickness=300.0),
    "principled thin film half metal": principled(Metallic=0.5, Roughness=0.2, Thin_Film_Thickness=300.0),
    "principled thin wall": principled(
        Base_Color=(0.9, 0.95, 1.0), Transmission_Weight=1.0, Roughness=0.1, Thin_Wall=True
    ),
}


def small_ball(made):
    return ball(made, 0.42, rings=32)


def glossy_room(scene):
    """Everything that Filter Glossy blurs, where diffuse surfaces see it."""
    square(material("floor", "ShaderNodeBsdfDiffuse", Color=(0.6, 0.6, 0.6)), 3.0)
    looks = {
        "mirror": SIMPLE["mirror"],
        "rough": SIMPLE["ggx 0.1"],
        "beckmann": distribution(GLOSSY, "BECKMANN", Color=BRASS, Roughness=0.1),
        "ashikhmin": distribution(GLOSSY, "ASHIKHMIN_SHIRLEY", Color=BRASS, Roughness=0.2),
        "glass": CLEAR["glass 0.1"],
        "refraction": CLEAR["refraction 0"],
        "layers": principled(Coat_Weight=1.0, Coat_Roughness=0.0, Roughness=0.1),
        "sheet": LAYERED["principled thin wall"],
    }
    for i, (name, look) in enumerate(looks.items()):
        angle = i * 2.0 * math.pi / len(looks)
        ball(look(name), 0.32, rings=24, location=(math.cos(angle), math.sin(angle), 0.3))
    world(SKY)
    lamp("AREA", (2.5, 1.5, 4.0), (-0.25, 0.4, 0.0), 200.0, shape="SQUARE", size=2.0, color=LAMP)
    ortho_from_above(3.0)


def volume_of(kind, **inputs):
    """A material that is nothing but its volume."""
    from bpy import data

    made = data.materials.new(kind)
    tree = tree_of(made)
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    filled = node(tree, kind, None, {name.replace("_", " "): value for name, value in inputs.items()})
    tree.links.new(filled.outputs[0], out.inputs["Volume"])
    return made


def fog(scene):
    """The camera stands in a mist that holds a glass ball, a denser ball and lamps."""
    mist = cube(volume_of("ShaderNodeVolumeScatter", Color=(0.7, 0.8, 0.9), Density=0.12, Anisotropy=0.3), 6.0)
    mist.name = "mist"
    square(material("floor", "ShaderNodeBsdfDiffuse", Color=(0.6, 0.5, 0.4)), 3.0)
    ball(CLEAR["glass 0"]("glass"), 0.5, location=(-0.6, 0.0, 0.5))
    ball(volume_of("ShaderNodeVolumePrincipled", Color=RED, Density=3.0), 0.4, location=(0.7, 0.0, 0.5))
    lamp("AREA", (1.0, 1.5, 3.0), (-0.4, 0.3, 0.0), 150.0, shape="SQUARE", size=1.0, color=LAMP)
    lamp("POINT", (-1.5, -1.0, 1.0), energy=40.0, shadow_soft_size=0.2, visible=True)
    camera((0, -4, 2.5), (0, 0, 0.4), 34.0)


def need_tracking():
    """Up to Blender 4.5 Cycles marches in steps through volumes that vary: it differs there (that the steps are why is not shown)."""
    if bpy.app.version < (5, 0):
        raise Unavailable("volumes tracked without bias")


def cloud_tree(tree):
    """Coloured and thicker where noise says so, glowing low down: by object and generated coordinates."""
    need_tracking()
    places = node(tree, "ShaderNodeTexCoord")
    noise = node(tree, "ShaderNodeTexNoise", None, {"Vector": places.outputs["Object"], "Scale": 4.0})
    ends = {"From Min": 0.45, "From Max": 0.7, "To Max": 6.0}
    thick = node(tree, "ShaderNodeMapRange", None, {"Value": noise.outputs[0], **ends})
    height = node(tree, "ShaderNodeSeparateXYZ", None, {0: places.outputs["Generated"]})
    glow = node(tree, "ShaderNodeMath", {"operation": "SUBTRACT", "use_clamp": True}, {0: 0.3, 1: height.outputs["Z"]})
    looks = {"Density": thick.outputs[0], "Color": noise.outputs[1], "Emission Strength": glow.outputs[0]}
    return node(tree, "ShaderNodeVolumePrincipled", None, {**looks, "Anisotropy": 0.3, "Emission Color": BRASS})


def volume_material(make, surface=None):
    """`make(tree)` and `surface(tree)` give the nodes whose outputs fill it and cover it."""
    from bpy import data

    made = data.materials.new("volume")
    tree = tree_of(made)
    out = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(make(tree).outputs[0], out.inputs["Volume"])
    if surface:
        tree.links.new(surface(tree).outputs[0], out.inputs["Surface"])
    return made


def cloud(scene):
    """A cloud over a floor, partly within a thin even mist."""
    square(material("floor", "ShaderNodeBsdfDiffuse", Color=(0.6, 0.5, 0.4)), 3.0)
    cube(volume_material(cloud_tree), 0.8, location=(0.0, 0.0, 0.9), rotation=(0.2, 0.1, 0.5))
    cube(volume_of("ShaderNodeVolumeScatter", Density=0.4, Color=(0.5, 0.7, 0.9)), 0.5, location=(0.9, 0.0, 0.6))
    lamp("AREA", (1.0, 1.5, 3.0), (-0.4, 0.3, 0.0), 150.0, shape="SQUARE", size=1.0, color=LAMP)
    lamp("SUN", rotation=(0.5, -0.6, 0.0), energy=1.5, angle=0.1)
    camera((0, -4, 2.5), (0, 0, 0.6), 34.0)


def tinted_glass(scene):
    """Glass that is filled with what absorbs, evenly and not, and with a milky part."""
    square(material("floor", "ShaderNodeBsdfDiffuse", Color=(0.6, 0.6, 0.6)), 3.0)

    def glass(tree):
        return node(tree, GLASS, {"distribution": "GGX"}, {"Roughness": 0.0, "IOR": 1.3})

    def even(tree):
        return node(tree, "ShaderNodeVolumeAbsorption", None, {"Color": (0.9, 0.3, 0.2), "Density": 3.0})

    def banded(tree):
        places = node(tree, "ShaderNodeTexCoord")
        wave = node(tree, "ShaderNodeTexWave", None, {"Vector": places.outputs["Object"], "Scale": 2.0})
        return node(tree, "ShaderNodeVolumeAbsorption", None, {"Color": wave.outputs[0], "Density": 4.0})

    for i, fill in enumerate((even, banded, cloud_tree)):
        ball(volume_material(fill, glass), 0.4, location=(i - 1.0, 0.0, 0.5))
    world(SKY)
    lamp("AREA", (1.0, 1.5, 3.0), (-0.4, 0.3, 0.0), 150.0, shape="SQUARE", size=2.0, color=LAMP)
    camera((0, -4, 2.5), (0, 0, 0.4), 34.0)


def fill_world(scene, make):
    world((0.0, 0.0, 0.0))
    tree = scene.world.node_tree
    out = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeOutputWorld")
    tree.links.new(make(tree).outputs[0], out.inputs["Volume"])


def misty_world(make):
    def build(scene):
        square(material("floor", "ShaderNodeBsdfDiffuse", Color=(0.6, 0.5, 0.4)), 3.0)
        ball(CLEAR["glass 0"]("glass"), 0.5, location=(-0.6, 0.0, 0.5))
        ball(volume_of("ShaderNodeVolumePrincipled", Color=RED, Density=3.0), 0.4, location=(0.7, 0.0, 0.5))
        lamp("AREA", (1.0, 1.5, 3.0), (-0.4, 0.3, 0.0), 150.0, shape="SQUARE", size=1.0, color=LAMP)
        lamp("POINT", (-1.5, -1.0, 1.0), energy=40.0, shadow_soft_size=0.2, visible=True)
        fill_world(scene, make)
        camera((0, -4, 2.5), (0, 0, 0.4), 34.0)

    return build


def even_mist(tree):
    return node(tree, "ShaderNodeVolumeScatter", None, {"Color": (0.7, 0.8, 0.9), "Density": 0.1, "Anisotropy": 0.3})


def low_mist(tree):
    """Thinner with height."""
    need_tracking()
    place = node(tree, "ShaderNodeNewGeometry").outputs["Position"]
    height = node(tree, "ShaderNodeSeparateXYZ", None, {0: place}).outputs["Z"]
    power = node(tree, "ShaderNodeMath", {"operation": "POWER"}, {0: 0.3, 1: height})
    thick = node(tree, "ShaderNodeMath", {"operation": "MULTIPLY", "use_clamp": True}, {0: power.outputs[0], 1: 0.3})
    return node(tree, "ShaderNodeVolumeScatter", None, {"Color": (0.7, 0.8, 0.9), "Density": thick.outputs[0]})


def skin_and_marble(scene):
    """Light below surfaces: several kinds, bent normals, thin parts, an area lamp behind."""
    square(material("floor", "ShaderNodeBsdfDiffuse", Color=(0.5, 0.5, 0.5)), 3.0)
    looks = {
        "marble": principled(Base_Color=(0.9, 0.85, 0.8), Subsurface_Weight=1.0, Subsurface_Scale=0.3),
        "jelly": of("ShaderNodeSubsurfaceScattering", {"falloff": "RANDOM_WALK"}, Color=RED, Scale=0.5, Anisotropy=0.6),
        "skin": of("ShaderNodeSubsurfaceScattering", {"falloff": "RANDOM_WALK_SKIN"}, Color=(0.8, 0.5, 0.4), Scale=0.1),
        "wax": of(
            "ShaderNodeBsdfPrincipled",
            {"subsurface_method": "BURLEY"},
            **{"Base Color": BRASS, "Subsurface Weight": 0.8, "Subsurface Scale": 1.0},
        ),
    }
    for i, (name, look) in enumerate(looks.items()):
        ball(look(name), 0.4, rings=16, location=(i - 1.5, 0.0, 0.4), scale=(1.0, 0.3, 1.0))
    lamp("AREA", (0.0, 2.5, 1.0), (-1.4, 0.0, 0.0), 120.0, shape="SQUARE", size=1.0, color=LAMP)
    world(SKY, 0.3)
    camera((0, -4, 1.5), (0, 0, 0.4), 50.0)


def portal(name, beside=(0.0, 0.0, 0.0), direction=None, color=(0.9, 0.8, 0.7), rest=0.0):
    """Leads `beside` the place where it is met, and on in a direction of its own. `rest`: the share that is diffuse. Not transparent:
    what is both passes shadow rays in Cycles, which then counts lamps behind it twice."""
    from bpy import data

    made = data.materials.new(name)
    tree = tree_of(made)
    shader = node(tree, "ShaderNodeBsdfRayPortal", None, {"Color": color})
    if any(beside):
        place = node(tree, "ShaderNodeNewGeometry").outputs["Position"]
        put(tree, shader.inputs["Position"], node(tree, "ShaderNodeVectorMath", None, {0: place, 1: beside}).outputs[0])
    if direction:
        put(
            tree,
            shader.inputs["Direction"],
            node(tree, "ShaderNodeCombineXYZ", None, dict(enumerate(direction))).outputs[0],
        )
    if rest:
        diffuse = node(tree, "ShaderNodeBsdfDiffuse", None, {"Color": (0.5, 0.9, 0.6)})
        both = node(tree, "ShaderNodeMixShader", None, {0: rest})
        tree.links.new(shader.outputs[0], both.inputs[1])
        tree.links.new(diffuse.outputs[0], both.inputs[2])
        shader = both
    output(tree, shader)
    return made


def portals(scene):
    """Ray portals that show another place, turn the way, mix with what is diffuse, and bring light from a far lamp."""
    square(material("floor", "ShaderNodeBsdfDiffuse", Color=(0.7, 0.7, 0.7)), 3.0)
    ball(principled()("red"), 0.4, location=(1.2, 0.3, 0.4))
    upright = (math.pi / 2, 0.0, 0.0)
    square(portal("door", (2.4, 0.0, 0.0)), 0.4, location=(-1.2, -0.4, 0.4), rotation=upright)
    square(portal("turned", direction=(0.5, 0.6, -0.4)), 0.3, location=(-0.1, -0.7, 0.4), rotation=upright)
    square(portal("mixed", (0.0, 0.0, 2.0), rest=0.4), 0.3, location=(0.3, -0.7, 1.1), rotation=upright)
    square(portal("shaft", (0.0, 0.0, 40.0)), 0.4, location=(0.0, 1.0, 0.5), rotation=(0.6, 0.0, 0.0))
    square(material("far", "ShaderNodeEmission", Color=BRASS, Strength=8.0), 4.0, location=(0.0, 1.0, 42.0))
    world(SKY, 0.3)
    lamp("AREA", (1.0, -1.5, 3.0), (0.3, 0.3, 0.0), 60.0, shape="SQUARE", size=1.0, color=LAMP)
    camera((0, -5, 2.0), (0, 0, 0.5), 34.0)


def no_material(scene):
    ball(None, 0.42, rings=32)
    light()
    ortho_from_above(1.0)


CASES = [
    Case("no material", no_material),
    sheet("closures", SIMPLE, small_ball, light),
    sheet("clear closures", CLEAR, small_ball, light, samples=128),
    sheet("principled", LAYERED, small_ball, light),
    Case("fog", fog, samples=128, cycles={"volume_bounces": 0}),
    Case("fog, scattered often", fog, samples=128, cycles={"volume_bounces": 4}),
    Case("cloud", cloud, samples=128, cycles={"volume_bounces": 2}),
    Case("tinted glass", tinted_glass, samples=256, cycles={"volume_bounces": 1}),
    Case("world, even mist", misty_world(even_mist), samples=128, cycles={"volume_bounces": 1}),
    Case("world, low mist", misty_world(low_mist), samples=128, cycles={"volume_bounces": 1}),
    Case("light below surfaces", skin_and_marble, samples=128),
    Case("ray portals", portals, samples=128),
    Case("filter glossy, little", glossy_room, samples=128, cycles={"blur_glossy": 0.1}),
    Case("filter glossy, as new files", glossy_room, samples=128, cycles={"blur_glossy": 1.0}),
]
