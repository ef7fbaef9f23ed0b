"""Every texture node against Cycles, point by point: one mesh with a quad for each case is rendered by Cycles, and our compiled
programs are evaluated at the very positions that Cycles shaded (its Position pass)."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, field

import bpy
import numpy as np
import OpenEXR
import pytest
from mathutils import Matrix

from gi_engine import native
from gi_engine.nodes.compile import Compiler
from gi_engine.scene_data import Scene

COLUMNS = 16  # of quads in the picture
PIXELS = 12  # a case's quad is so many pixels wide and high
SIDE = 1.7  # and so many metres
RIGHT, UP = np.array([0.8, -0.36, 0.48]), np.array([0.0, 0.8, 0.6])  # so that all three coordinates vary
NORMAL = np.cross(RIGHT, UP)


@dataclass
class Case:
    name: str
    node: str
    settings: dict = field(default_factory=dict)
    inputs: dict = field(default_factory=dict)
    output: str = "Color"
    image: str = ""
    unit: bool = False  # texture directions, not positions
    tolerance: float = 2e-4
    mismatches: float = 0.0  # share of points that may differ: jumps that rounding decides


# -------------------------------------------------------------------- cases


def noise_cases():
    base = {"Scale": 3.1, "Detail": 2.4, "Roughness": 0.55, "Lacunarity": 2.1, "Distortion": 0.0, "W": 0.7}
    for dimensions in ("1D", "2D", "3D", "4D"):
        settings = {"noise_dimensions": dimensions}
        position_w = {"W": 1.3}
        yield Case(f"noise {dimensions}", "Noise", settings, base | position_w)
        yield Case(f"noise {dimensions} distorted", "Noise", settings, base | {"Distortion": 0.8})
    for kind in ("MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HETERO_TERRAIN", "FBM"):
        settings = {"noise_type": kind, "normalize": False}
        inputs = base | {"Offset": 0.4, "Gain": 1.3}
        yield Case(f"noise {kind}", "Noise", settings, inputs)
        yield Case(f"noise {kind} value", "Noise", settings, inputs | {"Detail": 3.0}, "Fac")
    yield Case("noise far away", "Noise", {}, base | {"Scale": 2.0e5}, tolerance=0.05, mismatches=0.1)


def voronoi_cases():
    base = {"Scale": 2.3, "Detail": 0.0, "Randomness": 0.9, "Smoothness": 0.6, "Exponent": 1.4, "W": 0.3}
    for dimensions, feature in itertools.product(("1D", "2D", "3D", "4D"), ("F1", "F2", "SMOOTH_F1")):
        settings = {"voronoi_dimensions": dimensions, "feature": feature}
        yield Case(f"voronoi {dimensions} {feature}", "Voronoi", settings, base, "Distance")
        yield Case(f"voronoi {dimensions} {feature} colour", "Voronoi", settings, base, mismatches=0.02)
    for dimensions in ("2D", "3D", "4D"):
        yield Case(
            f"voronoi {dimensions} position",
            "Voronoi",
            {"voronoi_dimensions": dimensions},
            base,
            "Position",
            mismatches=0.02,
        )
    for dimensions, feature in itertools.product(("1D", "2D", "3D", "4D"), ("DISTANCE_TO_EDGE", "N_SPHERE_RADIUS")):
        output = "Radius" if feature == "N_SPHERE_RADIUS" else "Distance"
        settings = {"voronoi_dimensions": dimensions, "feature": feature}
        yield Case(f"voronoi {dimensions} {feature}", "Voronoi", settings, base, output, mismatches=0.02)
    for metric, feature in itertools.product(("MANHATTAN", "CHEBYCHEV", "MINKOWSKI"), ("F1", "F2", "SMOOTH_F1")):
        yield Case(f"voronoi {metric} {feature}", "Voronoi", {"distance": metric, "feature": feature}, base, "Distance")
    octaves = base | {"Detail": 2.6, "Roughness": 0.6, "Lacunarity": 2.2}
    for feature in ("F1", "F2", "SMOOTH_F1", "DISTANCE_TO_EDGE"):
        settings = {"feature": feature, "normalize": True}
        yield Case(f"voronoi octaves {feature}", "Voronoi", settings, octaves, "Distance")
    yield Case("voronoi octaves colour", "Voronoi", {"normalize": True}, octaves, mismatches=0.05)


def pattern_cases():
    yield Case("checker", "Checker", {}, {"Scale": 4.0}, mismatches=0.01)
    for kind in ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "SPHERICAL", "QUADRATIC_SPHERE", "RADIAL"):
        yield Case(f"gradient {kind}", "Gradient", {"gradient_type": kind})
    for kind, profile in itertools.product(("BANDS", "RINGS"), ("SIN", "SAW", "TRI")):
        inputs = {
            "Scale": 0.9,
            "Distortion": 1.2,
            "Detail": 1.5,
            "Detail Scale": 1.1,
            "Detail Roughness": 0.4,
            "Phase Offset": 0.7,
        }
        settings = {"wave_type": kind, "wave_profile": profile}
        yield Case(f"wave {kind} {profile}", "Wave", settings, inputs, tolerance=1e-3, mismatches=0.02)
    for direction in ("X", "Y", "Z", "DIAGONAL"):
        yield Case(f"wave bands {direction}", "Wave", {"bands_direction": direction}, {"Scale": 1.0})
    for direction in ("X", "Y", "Z", "SPHERICAL"):
        yield Case(
            f"wave rings {direction}", "Wave", {"wave_type": "RINGS", "rings_direction": direction}, {"Scale": 1.0}
        )
    for depth in range(0, 11, 2):
        yield Case(
            f"magic {depth}", "Magic", {"turbulence_depth": depth}, {"Scale": 0.8, "Distortion": 1.3}, tolerance=1e-3
        )
    brick = {
        "Scale": 2.0,
        "Mortar Size": 0.05,
        "Mortar Smooth": 0.3,
        "Bias": 0.1,
        "Brick Width": 0.6,
        "Row Height": 0.3,
    }
    settings = {"offset": 0.4, "offset_frequency": 3, "squash": 1.3, "squash_frequency": 2}
    yield Case("brick", "Brick", settings, brick, tolerance=1e-3, mismatches=0.02)
    yield Case("brick mortar", "Brick", {}, brick | {"Mortar Smooth": 0.0}, "Fac", mismatches=0.02)
    for dimensions in ("1D", "2D", "3D", "4D"):
        settings = {"noise_dimensions": dimensions}
        yield Case(f"white noise {dimensions}", "WhiteNoise", settings, {"W": 0.37})
        yield Case(f"white noise {dimensions} value", "WhiteNoise", settings, {"W": 0.37}, "Value")
    for kind, output in itertools.product(("2D", "3D"), ("Value", "Phase", "Intensity")):
        inputs = {
            "Scale": 2.0,
            "Frequency": 2.2,
            "Anisotropy": 0.6,
            "Orientation 2D": 0.5,
            "Orientation 3D": (0.6, 0.0, 0.8),
        }
        yield Case(
            f"gabor {kind} {output}", "Gabor", {"gabor_type": kind}, inputs, output, tolerance=2e-3, mismatches=0.02
        )


def image_cases():
    for interpolation, extension in itertools.product(
        ("Closest", "Linear", "Cubic"), ("REPEAT", "EXTEND", "CLIP", "MIRROR")
    ):
        settings = {"interpolation": interpolation, "extension": extension}
        mismatches = 0.03 if interpolation == "Closest" else 0.0
        yield Case(
            f"image {interpolation} {extension}",
            "Image",
            settings,
            image="bytes",
            tolerance=3e-3,
            mismatches=mismatches,
        )
    for projection in ("SPHERE", "TUBE"):
        yield Case(f"image {projection}", "Image", {"projection": projection}, image="floats", tolerance=2e-3)
    for blend in (0.0, 0.5, 1.0):
        settings = {"projection": "BOX", "projection_blend": blend}
        yield Case(f"image box {blend}", "Image", settings, image="floats", tolerance=2e-3)
    for image in ("bytes", "floats", "data", "packed channels", "no alpha", "linear bytes"):
        yield Case(f"image {image}", "Image", {}, image=image, tolerance=3e-3)
    yield Case("image alpha", "Image", {}, {}, "Alpha", "bytes", tolerance=2e-3)
    for projection in ("EQUIRECTANGULAR", "MIRROR_BALL"):
        yield Case(
            f"environment {projection}", "Environment", {"projection": projection}, image="floats", tolerance=2e-3
        )


def sky_cases():
    if bpy.app.version >= (5, 0, 0):
        for kind, elevation in itertools.product(("SINGLE_SCATTERING", "MULTIPLE_SCATTERING"), (0.02, 0.6)):
            settings = {
                "sky_type": kind,
                "sun_elevation": elevation,
                "sun_rotation": 1.1,
                "sun_disc": False,
                "altitude": 1500.0,
            }
            yield Case(f"sky {kind} {elevation}", "Sky", settings, unit=True, tolerance=3e-3)
    settings = {"sky_type": "PREETHAM", "turbidity": 3.5, "sun_direction": (0.3, -0.5, 0.81)}
    yield Case("sky PREETHAM", "Sky", settings, unit=True, tolerance=1e-3)
    suns = ((0.3, -0.5, 0.81), (0.9, 0.2, 0.05), (0.1, 0.1, 1.0), (-0.4, 0.7, -0.2))
    for i, (turbidity, albedo) in enumerate(((1.0, 0.0), (2.2, 0.3), (6.7, 1.0), (10.0, 0.6))):
        settings = {
            "sky_type": "HOSEK_WILKIE",
            "turbidity": turbidity,
            "ground_albedo": albedo,
            "sun_direction": suns[i],
        }
        yield Case(f"sky HOSEK_WILKIE {i}", "Sky", settings, unit=True, tolerance=1e-3)


def mapping_cases():
    for kind in ("TEXTURE", "POINT", "VECTOR", "NORMAL"):
        mapping = (kind, (0.1, 0.2, -0.3), (0.4, 0.5, 0.6), (1.5, 0.7, 0.9))
        yield Case(f"texture mapping {kind}", "Noise", {"mapping": mapping}, {"Scale": 2.0}, "Fac")


CASES = [*noise_cases(), *voronoi_cases(), *pattern_cases(), *image_cases(), *sky_cases(), *mapping_cases()]


# -------------------------------------------------------------------- the scene


def make_images() -> dict:
    rng = np.random.default_rng(5)
    return {
        "bytes": make_image(rng, False, "sRGB", "STRAIGHT"),
        "floats": make_image(rng, True, "Linear Rec.709", "PREMUL"),
        "data": make_image(rng, False, "Non-Color", "STRAIGHT"),
        "packed channels": make_image(rng, False, "sRGB", "CHANNEL_PACKED"),
        "no alpha": make_image(rng, False, "sRGB", "NONE"),
        "linear bytes": make_image(rng, False, "Linear Rec.709", "STRAIGHT"),
    }


def make_image(rng, is_float: bool, space: str, alpha: str):
    image = bpy.data.images.new("test", 7, 5, alpha=True, float_buffer=is_float)
    image.colorspace_settings.name = space
    image.alpha_mode = alpha
    pixels = rng.uniform(0.1, 0.9, (5, 7, 4)).astype(np.float32)
    if is_float:
        pixels[..., :3] *= 3.0
        pixels[..., 3] = 1.0
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def place(index: int, x: float = 0.5, y: float = 0.5) -> np.ndarray:
    """A point of the quad of a case."""
    row, column = divmod(index, COLUMNS)
    rows = -(-len(CASES) // COLUMNS)
    return SIDE * ((column + x - 0.5 * COLUMNS) * RIGHT + (row + y - 0.5 * rows) * UP)


def make_material(case: Case, images: dict, index: int):
    material = bpy.data.materials.new(case.name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    geometry, texture = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new("ShaderNodeTex" + case.node)
    emission, output = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
    for name, value in case.settings.items():
        if name == "mapping":
            mapping = texture.texture_mapping
            mapping.vector_type, mapping.translation, mapping.rotation, mapping.scale = value
        else:
            setattr(texture, name, value)
    for name, value in case.inputs.items():
        if name in texture.inputs:
            texture.inputs[name].default_value = value
    if case.image:
        texture.image = images[case.image]
    # Coordinates about the origin, where the textures have all signs.
    local = tree.nodes.new("ShaderNodeVectorMath")
    local.operation = "SUBTRACT"
    local.inputs[1].default_value = place(index)
    tree.links.new(geometry.outputs["Position"], local.inputs[0])
    position = local.outputs[0]
    if case.unit:
        normalize = tree.nodes.new("ShaderNodeVectorMath")
        normalize.operation = "NORMALIZE"
        tree.links.new(position, normalize.inputs[0])
        position = normalize.outputs[0]
    if "Vector" in texture.inputs and texture.inputs["Vector"].enabled:
        tree.links.new(position, texture.inputs["Vector"])
    if "W" in texture.inputs and texture.inputs["W"].enabled:
        # 1D textures vary too.
        split = tree.nodes.new("ShaderNodeSeparateXYZ")
        tree.links.new(position, split.inputs[0])
        tree.links.new(split.outputs["Y"], texture.inputs["W"])
    tree.links.new(next(o for o in texture.outputs if o.identifier == case.output), emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    return material


def render_positions_and_colors(materials, path) -> tuple[np.ndarray, np.ndarray]:
    """(case, point, 3) each."""
    rows = -(-len(materials) // COLUMNS)
    mesh = bpy.data.meshes.new("quads")
    corners = [tuple(place(i, *corner)) for i in range(len(materials)) for corner in ((0, 0), (1, 0), (1, 1), (0, 1))]
    mesh.from_pydata(corners, [], [range(4 * i, 4 * i + 4) for i in range(len(materials))])
    for index, material in enumerate(materials):
        mesh.materials.append(material)
        mesh.polygons[index].material_index = index
    scene = bpy.context.scene
    scene.collection.objects.link(bpy.data.objects.new("quads", mesh))
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", SIDE * max(COLUMNS, rows)
    frame = np.eye(4)
    frame[:3, 0], frame[:3, 1], frame[:3, 2], frame[:3, 3] = RIGHT, UP, NORMAL, 10 * NORMAL
    camera.matrix_world = Matrix(frame)
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.view_layers[0].use_pass_position = True
    planes = render_once(scene, COLUMNS * PIXELS, rows * PIXELS, path)

    def blocks(letters: str, name: str) -> np.ndarray:
        image = np.stack([planes[f"{name}.{k}"] for k in letters], -1)[::-1]
        image = image.reshape(rows, PIXELS, COLUMNS, PIXELS, 3).swapaxes(1, 2).reshape(rows * COLUMNS, -1, 3)
        return np.ascontiguousarray(image[: len(materials)], np.float32)

    return blocks("XYZ", "Position"), blocks("RGB", "Combined")


def render_once(scene, width: int, height: int, path) -> dict:
    """One sample at (almost) the centre of each pixel; as read_planes."""
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 1, False, False
    scene.cycles.pixel_filter_type = "BOX"
    scene.cycles.filter_width = 0.01
    scene.render.resolution_x, scene.render.resolution_y = width, height
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format, settings.color_depth = "OPEN_EXR_MULTILAYER", "32"
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return read_planes(path)


def read_planes(path) -> dict:
    """ "Pass.letter" -> (height, width)"""
    planes = {}
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            for name, channel in part.channels.items():
                planes[".".join(name.split(".")[-2:])] = channel.pixels
    return planes


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """name -> (positions, Cycles' colours, our colours)."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    images = make_images()
    materials = [make_material(case, images, i) for i, case in enumerate(CASES)]
    positions, theirs = render_positions_and_colors(materials, tmp_path_factory.mktemp("textures") / "cycles.exr")
    warnings = []
    scene = Scene()
    compiler = Compiler(scene, bpy.context.evaluated_depsgraph_get(), warnings.append)
    scene.programs = [compiler.material(material) for material in materials]
    assert not warnings
    ours = [native.module().emission(scene, i, positions[i], tuple(NORMAL)) for i in range(len(CASES))]
    return {case.name: (positions[i], theirs[i], ours[i]) for i, case in enumerate(CASES)}


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_matches_cycles(case, compared):
    positions, theirs, ours = compared[case.name]
    assert np.ptp(theirs, axis=0).max() > 1e-3, "the case shows nothing"
    scale = max(1.0, float(np.abs(theirs).mean()))
    off = np.abs(ours - theirs).max(1) > case.tolerance * scale
    worst = int(np.argmax(np.abs(ours - theirs).max(1)))
    assert off.mean() <= case.mismatches, (
        f"{off.sum()} of {len(off)} points differ; worst at {positions[worst]}: {ours[worst]} instead of {theirs[worst]}"
    )


SCATTERING = ("SINGLE_SCATTERING", "MULTIPLE_SCATTERING") if bpy.app.version >= (5, 0, 0) else ("NISHITA",)


@pytest.mark.parametrize("kind", SCATTERING)
def test_sun_disc_in_the_world_matches_cycles(kind, tmp_path):
    """A disc so large that all of its shading is seen, by a camera that looks at it; the sky beside it too. Blender 4.5 fades
    the sky below the horizon a little otherwise, and has another sun at the horizon: both are left out there."""
    old = kind == "NISHITA"
    disc = 0.3 if old else 1.2
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    size, fov, elevation, rotation = 24, math.radians(100), 0.5, -0.6
    world = bpy.data.worlds.new("sky")
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    scene.world = world
    background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
    sky = world.node_tree.nodes.new("ShaderNodeTexSky")
    sky.sky_type = kind
    sky.sun_elevation, sky.sun_rotation, sky.sun_size, sky.altitude = elevation, rotation, disc, 800.0
    world.node_tree.links.new(sky.outputs["Color"], background.inputs["Color"])
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.angle = fov
    # Towards the sun: rotation turns it clockwise from +y.
    camera.rotation_euler = (math.pi / 2 + elevation - 0.3, 0.0, -rotation)
    scene.collection.objects.link(camera)
    scene.camera = camera
    planes = render_once(scene, size, size, tmp_path / "sky.exr")
    theirs = np.stack([planes[f"Combined.{k}"] for k in "RGB"], -1)[::-1].reshape(-1, 3)

    centres = ((np.arange(size) + 0.5) / size * 2 - 1) * math.tan(fov / 2)
    local = np.stack([*np.meshgrid(centres, centres), np.full((size, size), -1.0)], -1).reshape(-1, 3)
    directions = local @ np.array(camera.matrix_world.to_3x3()).T
    directions = (directions / np.linalg.norm(directions, axis=1)[:, None]).astype(np.float32)
    data = Scene()
    data.programs = [Compiler(data, bpy.context.evaluated_depsgraph_get(), pytest.fail).world(world)]
    ours = native.module().emission(data, 0, directions, (0.0, 0.0, 1.0))
    lit = theirs.mean(1) > 20
    assert 0.01 < lit.mean() < 0.9
    # The edge of the disc and the horizon are jumps.
    seen = directions[:, 2] > (0.0 if old else -1.0)
    off = np.abs(ours[seen] / theirs[seen] - 1).max(1) > (0.02 if old else 0.01)
    assert off.mean() < 0.05, f"{off.sum()} of {off.size} directions differ"
    assert abs(ours[lit].mean() / theirs[lit].mean() - 1) < 0.02
