"""Lobes against Cycles: what a plane of one BSDF sends to an orthographic camera from a world of three known lights.

Cycles samples by its BSDFs only. With light sampling its rough glass is too bright (by 2 % at roughness 0.5 and near normal view, 10 %
at grazing view): its evaluation also counts facets that face away from the viewer, which its own sampling rightly never picks.
"""

import chi2
import numpy as np
import pytest
from gi_engine_native import _core

bpy = pytest.importorskip("bpy")

GLOSSY, REFRACTION, GLASS, METAL = (
    "ShaderNodeBsdfAnisotropic",
    "ShaderNodeBsdfRefraction",
    "ShaderNodeBsdfGlass",
    "ShaderNodeBsdfMetallic",
)
WHITE, TINT = [1.0, 1.0, 1.0], [0.9, 0.6, 0.3]
FILM = {"Thin Film Thickness": 400.0, "Thin Film IOR": 1.33}
OUR_FILM = {"film_thickness": [400], "film_ior": [1.33]}
INSIDE = [1 / 1.5]
SCHLICK = {"fresnel": [2], "ior": [1.5]}
TINTED = {"reflection_tint": TINT, "transmission_tint": TINT}
GOLD = {"n": [0.2, 0.4, 1.4], "k": [3.4, 2.4, 1.8]}
F82 = {"fresnel": [3], "f0": TINT, "edge_tint": [0.5, 0.8, 1.0]}
METAL_F82 = {"fresnel_type": "F82", "Base Color": [*TINT, 1], "Edge Tint": [0.5, 0.8, 1, 1]}
METAL_NK = {"fresnel_type": "PHYSICAL_CONDUCTOR", "IOR": GOLD["n"], "Extinction": GOLD["k"]}

# node, its settings, our lobe, its parameters; roughness 0.5 throughout
CASES = {
    "glossy": (GLOSSY, {"distribution": "GGX"}, "ggx_reflection", {}),
    "glossy, anisotropic": (
        GLOSSY,
        {"distribution": "GGX", "Anisotropy": 0.6},
        "ggx_reflection",
        {"alpha_x": [0.25 * 0.4], "alpha_y": [0.25 / 0.4]},
    ),
    "glossy, preserved": (
        GLOSSY,
        {"distribution": "MULTI_GGX", "Color": [*TINT, 1]},
        "ggx_reflection",
        {"mean": TINT},
    ),
    "glossy, Beckmann": (GLOSSY, {"distribution": "BECKMANN"}, "beckmann_reflection", {}),
    "glossy, Ashikhmin": (
        GLOSSY,
        {"distribution": "ASHIKHMIN_SHIRLEY"},
        "ashikhmin_shirley",
        {"alpha_x": [0.25], "alpha_y": [0.25]},
    ),
    "refraction": (REFRACTION, {"distribution": "GGX", "IOR": 1.5}, "ggx_refraction", {"ior": [1.5]}),
    "refraction, inside": (REFRACTION, {"distribution": "GGX", "IOR": 1.5}, "ggx_refraction", {"ior": INSIDE}),
    "refraction, Beckmann": (
        REFRACTION,
        {"distribution": "BECKMANN", "IOR": 1.5},
        "beckmann_refraction",
        {"ior": [1.5]},
    ),
    "glass": (GLASS, {"distribution": "GGX"}, "ggx_glass", SCHLICK),
    "glass, inside": (GLASS, {"distribution": "GGX"}, "ggx_glass", {**SCHLICK, "ior": INSIDE}),
    "glass, Beckmann": (GLASS, {"distribution": "BECKMANN"}, "beckmann_glass", SCHLICK),
    "glass, preserved": (
        GLASS,
        {"distribution": "MULTI_GGX", "Color": [*TINT, 1]},
        "ggx_glass",
        {**SCHLICK, **TINTED},
    ),
    "glass, preserved, inside": (
        GLASS,
        {"distribution": "MULTI_GGX", "Color": [*TINT, 1]},
        "ggx_glass",
        {**SCHLICK, **TINTED, "ior": INSIDE},
    ),
    "glass, film": (GLASS, {"distribution": "GGX", **FILM}, "ggx_glass", {**SCHLICK, **OUR_FILM}),
    "glass, film, inside": (
        GLASS,
        {"distribution": "GGX", **FILM},
        "ggx_glass",
        {**SCHLICK, **OUR_FILM, "ior": INSIDE, "film_ior": [1.33 / 1.5]},
    ),
    "metal, F82": (METAL, {"distribution": "MULTI_GGX", **METAL_F82}, "ggx_reflection", F82),
    "metal, n and k": (METAL, {"distribution": "MULTI_GGX", **METAL_NK}, "ggx_reflection", {"fresnel": [4], **GOLD}),
    "metal, film": (METAL, {"distribution": "GGX", **METAL_F82, **FILM}, "ggx_reflection", {**F82, **OUR_FILM}),
}


def lights(wi):
    """The world's radiance in red, green and blue: even, from one side, from above and below."""
    return np.stack([np.ones(len(wi)), 0.5 * wi[:, 0] + 0.5, wi[:, 2] ** 2], -1)


def make_world(scene):
    world = scene.world = bpy.data.worlds.new("lights")
    world.use_nodes = True
    world.cycles.sampling_method = "NONE"
    nodes, links = world.node_tree.nodes, world.node_tree.links
    split, join = nodes.new("ShaderNodeSeparateXYZ"), nodes.new("ShaderNodeCombineColor")
    links.new(nodes.new("ShaderNodeTexCoord").outputs["Generated"], split.inputs[0])
    side, above = nodes.new("ShaderNodeMath"), nodes.new("ShaderNodeMath")
    side.operation, above.operation = "MULTIPLY_ADD", "MULTIPLY"
    side.inputs[1].default_value = side.inputs[2].default_value = 0.5
    links.new(split.outputs[0], side.inputs[0])
    links.new(split.outputs[2], above.inputs[0])
    links.new(split.outputs[2], above.inputs[1])
    join.inputs[0].default_value = 1
    links.new(side.outputs[0], join.inputs[1])
    links.new(above.outputs[0], join.inputs[2])
    links.new(join.outputs[0], nodes["Background"].inputs[0])


@pytest.fixture(scope="module")
def plane():
    """A scene of one plane; its material is the caller's to fill."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.cycles.samples, scene.cycles.max_bounces = 256, 1
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.sample_clamp_indirect = scene.cycles.blur_glossy = 0
    make_world(scene)
    mesh = bpy.data.meshes.new("plane")
    mesh.from_pydata([(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [], [(0, 1, 2, 3)])
    scene.collection.objects.link(bpy.data.objects.new("plane", mesh))
    material = bpy.data.materials.new("bsdf")
    material.use_nodes = True
    mesh.materials.append(material)
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.ortho_scale = "ORTHO", 0.1
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.collection.objects.link(scene.camera)
    return scene, material


def fill(material, kind, settings):
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    node = nodes.new(kind)
    node.inputs["Roughness"].default_value = 0.5
    for name, value in {"Color": [1, 1, 1, 1], **settings}.items():
        if name in ("distribution", "fresnel_type"):
            setattr(node, name, value)
        elif name in node.inputs:
            node.inputs[name].default_value = value
        elif name != "Color":
            pytest.skip(f"this Blender's {kind} has no {name}")
    if "Tangent" in node.inputs:
        tangent = nodes.new("ShaderNodeCombineXYZ")
        tangent.inputs[0].default_value = 1
        links.new(tangent.outputs[0], node.inputs["Tangent"])
    links.new(node.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])


def cycles(scene, wo, path):
    from mathutils import Vector

    scene.camera.location = Vector(wo) * 5
    scene.camera.rotation_euler = Vector(wo).to_track_quat("Z", "Y").to_euler()
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(path))
    pixels = np.array(image.pixels[:]).reshape(-1, 4)[:, :3]
    bpy.data.images.remove(image)
    return pixels.mean(0), pixels.std(0) / np.sqrt(len(pixels))


def ours(name, parameters, wo, below, n=300_000):
    s = _core.lobe_sample(name, parameters, wo, np.random.default_rng(5).random((n, 3), np.float32))
    s = s[s[:, 6] > 0]
    wi = s[:, :3] * [1, 1, -1 if below else 1]
    value = s[:, 3:6].astype(float) / s[:, 6:7] * lights(wi)
    mean = value.sum(0) / n
    return mean, np.sqrt((value**2).sum(0) / n - mean**2) / np.sqrt(n)


@pytest.mark.parametrize("cos_o", [0.9, 0.3])
@pytest.mark.parametrize("case", CASES)
def test_lobe_against_cycles(plane, tmp_path, case, cos_o):
    kind, settings, name, parameters = CASES[case]
    scene, material = plane
    fill(material, kind, settings)
    below = "inside" in case
    parameters = {"alpha": [0.25], **parameters}
    if settings["distribution"] == "MULTI_GGX":
        parameters["preserve_energy_at"] = [cos_o]
    wo = chi2.directions(np.array([cos_o]), np.array([0.0]))
    theirs, their_error = cycles(scene, wo[0] * [1, 1, -1 if below else 1], tmp_path / "plane.exr")
    mean, error = ours(name, parameters, wo, below)
    if kind == GLOSSY:  # the node's weight, which no lobe knows
        mean, error = mean * settings.get("Color", WHITE)[:3], error * settings.get("Color", WHITE)[:3]
    # One per mille is for Cycles' approximate error function in Beckmann's model.
    assert (np.abs(mean - theirs) < 4.5 * np.hypot(error, their_error) + 1e-3 * theirs).all(), (mean, theirs)


def fill_bumped(material, normal):
    """Half diffuse, half glossy, both about `normal`."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    mix, xyz = nodes.new("ShaderNodeMixShader"), nodes.new("ShaderNodeCombineXYZ")
    for socket, value in zip(xyz.inputs, normal, strict=True):
        socket.default_value = value
    for i, kind in enumerate(("ShaderNodeBsdfDiffuse", GLOSSY)):
        node = nodes.new(kind)
        node.inputs["Color"].default_value = [1, 1, 1, 1]
        node.inputs["Roughness"].default_value = 0.5 * i
        links.new(xyz.outputs[0], node.inputs["Normal"])
        links.new(node.outputs[0], mix.inputs[1 + i])
        if i:
            node.distribution = "GGX"
    links.new(mix.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])


@pytest.mark.parametrize("sampling", ["NONE", "AUTOMATIC"])
@pytest.mark.parametrize(("tilt", "cos_o"), [(0.7, 0.9), (0.7, 0.3), (-0.5, 0.9)])
def test_bumped_mix_against_cycles(plane, tmp_path, tilt, cos_o, sampling):
    """Bumps shadow diffuse light at the terminator, and cut off what would come through the surface."""
    if sampling == "NONE" and bpy.app.version < (5, 0, 0):
        pytest.skip("Cycles 4.5 is up to 1.4 % brighter than itself with lights sampled, which is what we agree with")
    scene, material = plane
    normal = [float(np.sin(tilt)), 0.0, float(np.cos(tilt))]
    fill_bumped(material, normal)
    wo = chi2.directions(np.array([cos_o]), np.array([0.0]))[0]
    scene.world.cycles.sampling_method = sampling
    theirs, their_error = cycles(scene, wo, tmp_path / "plane.exr")
    scene.world.cycles.sampling_method = "NONE"

    bsdf, n = _core.TestBsdf(), 300_000
    bsdf.begin([0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0])
    bsdf.add("lambert", {}, [0.5] * 3, normal)
    bsdf.add("ggx_reflection", {"alpha": [0.25]}, [0.5] * 3, normal)
    s = bsdf.sample(wo.tolist(), np.random.default_rng(5).random((n, 3), np.float32))
    s = s[s[:, 6] > 0]
    value = s[:, 3:6].astype(float) / s[:, 6:7] * lights(s[:, :3])
    mean = value.sum(0) / n
    error = np.sqrt((value**2).sum(0) / n - mean**2) / np.sqrt(n)
    assert (np.abs(mean - theirs) < 4.5 * np.hypot(error, their_error) + 1e-3 * theirs).all(), (mean, theirs)
