"""One tile per node and variant: an emissive square of one metre, seen from above, whose colour the node decides.

Nearly free of noise, so these tiles compare values. Sources that rules name: P position in the tile (0..1, a little z),
X and Y its components, C a colour that varies, N the normal."""

from __future__ import annotations

import bpy

from .studio import Case, ball, cube, lamp, material, mesh, node, output, put, sheet, socket_of, square, tree_of, world

MATH = ("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MULTIPLY_ADD", "POWER", "LOGARITHM", "SQRT", "INVERSE_SQRT", "ABSOLUTE",
        "EXPONENT", "MINIMUM", "MAXIMUM", "LESS_THAN", "GREATER_THAN", "SIGN", "COMPARE", "SMOOTH_MIN", "SMOOTH_MAX", "ROUND",
        "FLOOR", "CEIL", "TRUNC", "FRACT", "MODULO", "FLOORED_MODULO", "WRAP", "SNAP", "PINGPONG", "SINE", "COSINE", "TANGENT",
        "ARCSINE", "ARCCOSINE", "ARCTANGENT", "ARCTAN2", "SINH", "COSH", "TANH", "RADIANS", "DEGREES")  # fmt: skip
VECTOR_MATH = ("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MULTIPLY_ADD", "CROSS_PRODUCT", "PROJECT", "REFLECT", "REFRACT",
               "FACEFORWARD", "DOT_PRODUCT", "DISTANCE", "LENGTH", "SCALE", "NORMALIZE", "ABSOLUTE", "MINIMUM", "MAXIMUM",
               "FLOOR", "CEIL", "FRACTION", "MODULO", "WRAP", "SNAP", "SINE", "COSINE", "TANGENT", "POWER", "SIGN")  # fmt: skip
BLEND = ("MIX", "DARKEN", "MULTIPLY", "BURN", "LIGHTEN", "SCREEN", "DODGE", "ADD", "OVERLAY", "SOFT_LIGHT", "LINEAR_LIGHT",
         "DIFFERENCE", "EXCLUSION", "SUBTRACT", "DIVIDE", "HUE", "SATURATION", "COLOR", "VALUE")  # fmt: skip


def sources(tree) -> dict:
    """Sockets that vary over the tile."""
    place = node(tree, "ShaderNodeTexCoord")
    moved = node(tree, "ShaderNodeVectorMath", {"operation": "ADD"}, {0: place.outputs["Object"], 1: (0.5, 0.5, 0.13)})
    parts = node(tree, "ShaderNodeSeparateXYZ", None, {0: moved.outputs[0]})
    color = node(tree, "ShaderNodeCombineColor", None, {0: parts.outputs[0], 1: parts.outputs[1], 2: 0.35})
    return {"P": moved.outputs[0], "X": parts.outputs[0], "Y": parts.outputs[1], "C": color.outputs[0],
            "N": place.outputs["Normal"], "U": place.outputs["UV"], "G": place.outputs["Generated"]}  # fmt: skip


def emitting(name, build):
    """A material that emits half of what `build(tree, sources)` gives plus a quarter, so that signs are seen."""
    made = bpy.data.materials.new(name)
    tree = tree_of(made)
    value = build(tree, sources(tree))
    lifted = node(
        tree, "ShaderNodeVectorMath", {"operation": "MULTIPLY_ADD"}, {0: value, 1: (0.5,) * 3, 2: (0.25,) * 3}
    )
    output(tree, node(tree, "ShaderNodeEmission", None, {"Color": lifted.outputs[0], "Strength": 1.0}))
    return made


def of(kind, properties=None, out=0, after=None, **inputs):
    """Inputs by socket name (_ for a space; s0, s1 … by position); a string names a source."""

    def build(tree, given):
        made = node(tree, kind, properties)
        for key, value in inputs.items():
            spot = int(key[1:]) if key[0] == "s" and key[1:].isdigit() else key.replace("_", " ")
            put(tree, socket_of(made.inputs, spot), given[value] if isinstance(value, str) else value)
        if after:
            after(made)
        return socket_of(made.outputs, out) if isinstance(out, str) else made.outputs[out]

    return lambda name: emitting(name, build)


def math_tiles():
    return {f"math {op.lower()}": of("ShaderNodeMath", {"operation": op}, s0="X", s1="Y", s2=0.3) for op in MATH}


def vector_math_tile(op):
    out = 1 if op in ("DOT_PRODUCT", "DISTANCE", "LENGTH") else 0
    inputs = {"s0": "P", "s1": (0.4, -0.6, 0.5)}
    if op in ("MULTIPLY_ADD", "FACEFORWARD", "WRAP"):
        inputs["s2"] = (0.1, 0.2, -0.3)
    if op in ("SCALE", "REFRACT"):
        inputs["s3"] = 0.7
    return of("ShaderNodeVectorMath", {"operation": op}, out, **inputs)


def mix_tile(blend):
    return of("ShaderNodeMix", {"data_type": "RGBA", "blend_type": blend}, 2, s0=0.7, s6="C", s7=(0.6, 0.3, 0.2, 1.0))


def ramp(interpolation, mode="RGB"):
    def after(made):
        made.color_ramp.color_mode = mode
        made.color_ramp.interpolation = interpolation
        made.color_ramp.elements[0].color = (0.1, 0.2, 0.8, 1)
        made.color_ramp.elements.new(0.4).color = (0.9, 0.7, 0.1, 1)

    return of("ShaderNodeValToRGB", after=after, s0="X")


def curve(made):
    made.mapping.curves[0].points.new(0.3, 0.7)
    made.mapping.update()


NUMBERS = {
    **math_tiles(),
    "math clamped": of("ShaderNodeMath", {"operation": "ADD", "use_clamp": True}, s0="X", s1="Y"),
    "clamp": of("ShaderNodeClamp", None, Value="X", Min=0.3, Max=0.6),
    "clamp range": of("ShaderNodeClamp", {"clamp_type": "RANGE"}, Value="X", Min=0.6, Max=0.3),
    "map range": of("ShaderNodeMapRange", None, s0="X", s1=0.2, s2=0.7, s3=1.0, s4=-0.5),
    "map range stepped": of("ShaderNodeMapRange", {"interpolation_type": "STEPPED"}, s0="X"),
    "map range smooth": of("ShaderNodeMapRange", {"interpolation_type": "SMOOTHSTEP"}, s0="X", s1=0.2, s2=0.7),
    "map range smoother": of("ShaderNodeMapRange", {"interpolation_type": "SMOOTHERSTEP"}, s0="X", s1=0.2, s2=0.7),
    "float curve": of("ShaderNodeFloatCurve", after=curve, s1="X"),
    "value": of("ShaderNodeValue", after=lambda made: setattr(made.outputs[0], "default_value", 0.37)),
}
VECTORS = {
    **{f"vector {op.lower()}": vector_math_tile(op) for op in VECTOR_MATH},
    "vector curves": of("ShaderNodeVectorCurve", after=curve, s1="P"),
    "mapping point": of("ShaderNodeMapping", None, s0="P", s1=(0.1, 0.2, 0.3), s2=(0.3, 0.4, 0.5), s3=(1.5, 0.5, 2.0)),
    "mapping texture": of(
        "ShaderNodeMapping",
        {"vector_type": "TEXTURE"},
        s0="P",
        s1=(0.1, 0.2, 0.3),
        s2=(0.3, 0.4, 0.5),
        s3=(1.5, 0.5, 2.0),
    ),
    "mapping vector": of(
        "ShaderNodeMapping", {"vector_type": "VECTOR"}, s0="P", s2=(0.3, 0.4, 0.5), s3=(1.5, 0.5, 2.0)
    ),
    "mapping normal": of(
        "ShaderNodeMapping", {"vector_type": "NORMAL"}, s0="P", s2=(0.3, 0.4, 0.5), s3=(1.5, 0.5, 2.0)
    ),
    "rotate axis": of(
        "ShaderNodeVectorRotate", None, Vector="P", Center=(0.3, 0.2, 0.1), Axis=(0.3, 0.5, 1.0), Angle=0.8
    ),
    "rotate euler": of("ShaderNodeVectorRotate", {"rotation_type": "EULER_XYZ"}, Vector="P", Rotation=(0.3, 0.5, 1.0)),
    "transform": of(
        "ShaderNodeVectorTransform", {"vector_type": "POINT", "convert_from": "OBJECT", "convert_to": "WORLD"}, s0="P"
    ),
    "transform to camera": of(
        "ShaderNodeVectorTransform", {"vector_type": "VECTOR", "convert_from": "WORLD", "convert_to": "CAMERA"}, s0="P"
    ),
    "combine xyz": of("ShaderNodeCombineXYZ", None, s0="Y", s1="X", s2=0.4),
    "normal": of("ShaderNodeNormal", None, 1, s0="P"),
    "mix vector": of("ShaderNodeMix", {"data_type": "VECTOR"}, 1, s0=0.3, s4="P", s5=(0.5, -0.4, 0.2)),
    "mix float": of("ShaderNodeMix", {"data_type": "FLOAT"}, 0, s0=0.3, s2="X", s3=0.9),
}
COLORS = {
    **{f"mix {blend.lower()}": mix_tile(blend) for blend in BLEND},
    "color ramp": ramp("LINEAR"),
    "color ramp ease": ramp("EASE"),
    "color ramp constant": ramp("CONSTANT"),
    "color ramp spline": ramp("B_SPLINE"),
    "color ramp hsv": ramp("LINEAR", "HSV"),
    "rgb curves": of("ShaderNodeRGBCurve", after=curve, s0=0.8, s1="C"),
    "hue saturation": of("ShaderNodeHueSaturation", None, Hue=0.3, Saturation=1.4, Value=0.9, Fac=0.8, Color="C"),
    "bright contrast": of("ShaderNodeBrightContrast", None, s0="C", s1=0.1, s2=0.3),
    "gamma": of("ShaderNodeGamma", None, s0="C", s1=1.8),
    "invert": of("ShaderNodeInvert", None, s0=0.8, s1="C"),
    "separate hsv": of("ShaderNodeSeparateColor", {"mode": "HSV"}, 0, s0="C"),
    "separate hsl": of("ShaderNodeSeparateColor", {"mode": "HSL"}, 1, s0="C"),
    "combine hsv": of("ShaderNodeCombineColor", {"mode": "HSV"}, s0="X", s1="Y", s2=0.8),
    "combine hsl": of("ShaderNodeCombineColor", {"mode": "HSL"}, s0="X", s1="Y", s2=0.4),
    "rgb to bw": of("ShaderNodeRGBToBW", None, s0="C"),
    "blackbody": of("ShaderNodeBlackbody", None, s0=3200.0),
    "wavelength": of("ShaderNodeWavelength", None, s0=570.0),
    "rgb": of("ShaderNodeRGB", after=lambda made: setattr(made.outputs[0], "default_value", (0.2, 0.5, 0.7, 1))),
}


def noise(kind="FBM", dimensions="3D", out=0, **inputs):
    inputs = {"Scale": 4.0, "Detail": 2.0, "Roughness": 0.6, **inputs}
    return of("ShaderNodeTexNoise", {"noise_type": kind, "noise_dimensions": dimensions}, out, Vector="P", **inputs)


def voronoi(feature="F1", dimensions="3D", distance="EUCLIDEAN", out=0, **inputs):
    properties = {"feature": feature, "voronoi_dimensions": dimensions}
    if feature not in ("DISTANCE_TO_EDGE", "N_SPHERE_RADIUS"):
        properties["distance"] = distance
    return of("ShaderNodeTexVoronoi", properties, out, Vector="P", Scale=4.0, **inputs)


TEXTURES = {
    "noise": noise(),
    "noise color": noise(out=1),
    "noise distorted": noise(Distortion=0.7),
    "noise 1d": of("ShaderNodeTexNoise", {"noise_dimensions": "1D"}, W="X", Scale=4.0),
    "noise 2d": noise(dimensions="2D"),
    "noise 4d": noise(dimensions="4D", W=0.4),
    "noise multifractal": noise("MULTIFRACTAL"),
    "noise hybrid": noise("HYBRID_MULTIFRACTAL", Offset=0.3, Gain=1.2),
    "noise ridged": noise("RIDGED_MULTIFRACTAL", Offset=0.8, Gain=1.2),
    "noise hetero": noise("HETERO_TERRAIN", Offset=0.3),
    "voronoi": voronoi(),
    "voronoi color": voronoi(out=1),
    "voronoi position": voronoi(out=2),
    "voronoi f2": voronoi("F2"),
    "voronoi smooth": voronoi("SMOOTH_F1", Smoothness=0.7),
    "voronoi edge": voronoi("DISTANCE_TO_EDGE"),
    "voronoi radius": voronoi("N_SPHERE_RADIUS", out="Radius"),
    "voronoi manhattan": voronoi(distance="MANHATTAN"),
    "voronoi chebychev": voronoi(distance="CHEBYCHEV"),
    "voronoi minkowski": voronoi(distance="MINKOWSKI", Exponent=1.4),
    "voronoi 2d": voronoi(dimensions="2D"),
    "voronoi 4d": voronoi(dimensions="4D", W=0.3),
    "voronoi fractal": voronoi(Detail=2.0, Roughness=0.6),
    "checker": of("ShaderNodeTexChecker", None, Vector="P", Scale=4.0, Color1=(0.8, 0.2, 0.1), Color2=(0.1, 0.3, 0.8)),
    "brick": of(
        "ShaderNodeTexBrick",
        None,
        Vector="P",
        Scale=4.0,
        Color1=(0.8, 0.2, 0.1),
        Color2=(0.6, 0.4, 0.2),
        Mortar_Smooth=0.3,
    ),
    "gradient linear": of("ShaderNodeTexGradient", None, Vector="P"),
    "gradient quadratic": of("ShaderNodeTexGradient", {"gradient_type": "QUADRATIC"}, Vector="P"),
    "gradient easing": of("ShaderNodeTexGradient", {"gradient_type": "EASING"}, Vector="P"),
    "gradient diagonal": of("ShaderNodeTexGradient", {"gradient_type": "DIAGONAL"}, Vector="P"),
    "gradient radial": of("ShaderNodeTexGradient", {"gradient_type": "RADIAL"}, Vector="P"),
    "gradient spherical": of("ShaderNodeTexGradient", {"gradient_type": "SPHERICAL"}, Vector="P"),
    "wave": of("ShaderNodeTexWave", None, Vector="P", Scale=1.0, Distortion=2.0, Detail=2.0),
    "wave rings": of("ShaderNodeTexWave", {"wave_type": "RINGS", "wave_profile": "SAW"}, Vector="P", Scale=1.0),
    "wave triangle": of(
        "ShaderNodeTexWave", {"wave_profile": "TRI", "bands_direction": "DIAGONAL"}, Vector="P", Scale=1.0
    ),
    "magic": of("ShaderNodeTexMagic", {"turbulence_depth": 3}, Vector="P", Scale=2.0, Distortion=1.5),
    "white noise": of("ShaderNodeTexWhiteNoise", None, 1, Vector=(0.3, 0.2, 0.9)),
    "gabor": of("ShaderNodeTexGabor", {"gabor_type": "2D"}, Vector="P", Scale=4.0),
}


def picture(name, as_float=False, **properties):
    """A small image: a ramp in red, steps in green, a hole in alpha."""
    import numpy as np

    def after(made):
        image = bpy.data.images.new(name, 16, 12, alpha=True, float_buffer=as_float)
        pixels = np.zeros((12, 16, 4), np.float32)
        pixels[..., 0] = np.linspace(0, 1, 16)
        pixels[..., 1] = (np.arange(12) // 3 / 4)[:, None]
        pixels[..., 2] = 0.3
        pixels[..., 3] = 1.0
        pixels[4:8, 6:10, 3] = 0.5
        image.pixels.foreach_set(pixels.ravel())
        image.update()
        image.pack()
        made.image = image
        for key, value in properties.items():
            setattr(made if hasattr(made, key) else image, key, value)

    return after


def image(as_float=False, out=0, scale=1.6, **properties):
    def build(tree, given):
        place = node(
            tree,
            "ShaderNodeVectorMath",
            {"operation": "MULTIPLY_ADD"},
            {0: given["P"], 1: (scale,) * 3, 2: (-0.3,) * 3},
        )
        made = node(tree, "ShaderNodeTexImage", None, {"Vector": place.outputs[0]})
        picture("picture", as_float, **properties)(made)
        return made.outputs[out]

    return lambda name: emitting(name, build)


INPUTS = {
    "generated": of("ShaderNodeTexCoord", None, "Generated"),
    "object": of("ShaderNodeTexCoord", None, "Object"),
    "uv": of("ShaderNodeTexCoord", None, "UV"),
    "camera": of("ShaderNodeTexCoord", None, "Camera"),
    "window": of("ShaderNodeTexCoord", None, "Window"),
    "reflection": of("ShaderNodeTexCoord", None, "Reflection"),
    "uv map": of("ShaderNodeUVMap", {"uv_map": "UVMap"}),
    "geometry position": of("ShaderNodeNewGeometry", None, "Position"),
    "geometry incoming": of("ShaderNodeNewGeometry", None, "Incoming"),
    "geometry tangent": of("ShaderNodeNewGeometry", None, "Tangent"),
    "geometry parametric": of("ShaderNodeNewGeometry", None, "Parametric"),
    "attribute": of("ShaderNodeAttribute", {"attribute_name": "UVMap"}, "Vector"),
    "object location": of("ShaderNodeObjectInfo", None, "Location"),
    "object color": of("ShaderNodeObjectInfo", None, "Color"),
    "object random": of("ShaderNodeObjectInfo", None, "Random"),
    "light path": of("ShaderNodeLightPath", None, "Is Camera Ray"),
    "ray length": of("ShaderNodeLightPath", None, "Ray Length"),
    "fresnel": of("ShaderNodeFresnel", None, IOR=1.6),
    "layer weight": of("ShaderNodeLayerWeight", None, 1, Blend=0.3),
    "camera data": of("ShaderNodeCameraData", None, 0),
    "tangent": of("ShaderNodeTangent", {"direction_type": "UV_MAP", "uv_map": "UVMap"}),
    "tangent radial": of("ShaderNodeTangent", {"direction_type": "RADIAL", "axis": "Z"}),
    "wireframe": of("ShaderNodeWireframe", None, Size=0.05),
    "image": image(),
    "image closest": image(interpolation="Closest"),
    "image cubic": image(interpolation="Cubic"),
    "image clip": image(extension="CLIP"),
    "image extend": image(extension="EXTEND"),
    "image mirror": image(extension="MIRROR"),
    "image alpha": image(out=1),
    "image float": image(as_float=True),
    "image channel packed": image(alpha_mode="CHANNEL_PACKED"),
    "image premultiplied": image(alpha_mode="PREMUL"),
    "image box": image(projection="BOX", projection_blend=0.3),
    "image sphere": image(projection="SPHERE"),
    "image tube": image(projection="TUBE"),
}


def tile_square(made):
    return square(made, 0.5)


def tile_turned(made):
    """Bent squares show what depends on normals: half a ball's worth of directions."""
    made_object = ball(made, 0.45, rings=32)
    made_object.color = (0.3, 0.6, 0.2, 1.0)
    return made_object


def no_light():
    pass


def light():
    world((0.3, 0.35, 0.4))
    lamp("AREA", (2.5, 1.5, 6.0), (-0.25, 0.4, 0.0), 300.0, shape="SQUARE", size=1.5)


def bumped(kind, after=None, shader="ShaderNodeBsdfDiffuse", correction=True, **inputs):
    """A material whose normal a node bends."""

    def make(name):
        made = bpy.data.materials.new(name)
        tree = tree_of(made)
        given = sources(tree)
        bend = node(tree, kind)
        for key, value in inputs.items():
            value = value(tree, given) if callable(value) else value
            put(tree, socket_of(bend.inputs, key), given[value] if isinstance(value, str) else value)
        if after:
            after(bend)
        output(tree, node(tree, shader, None, {"Color": (0.7, 0.6, 0.5), "Normal": bend.outputs[0]}))
        made.cycles.use_bump_map_correction = correction
        return made

    return make


def waves(tree, given):
    return node(tree, "ShaderNodeTexWave", None, {"Vector": given["P"], "Scale": 1.5}).outputs[1]


def slope(tree, given):
    return node(tree, "ShaderNodeCombineColor", None, {0: given["X"], 1: given["Y"], 2: 1.0}).outputs[0]


STEEP = {"Color": (0.95, 0.2, 0.6), "Strength": 1.0}  # bent so far that much of what it mirrors is below the surface


NORMALS = {
    "bump": bumped("ShaderNodeBump", Height=waves, Strength=0.8, Distance=0.1),
    "bump inverted": bumped(
        "ShaderNodeBump", lambda n: setattr(n, "invert", True), Height=waves, Strength=0.5, Distance=0.1
    ),
    "normal map": bumped("ShaderNodeNormalMap", Color=slope, Strength=1.0),
    "normal map weak": bumped("ShaderNodeNormalMap", Color=slope, Strength=0.4),
    "normal map object": bumped("ShaderNodeNormalMap", lambda n: setattr(n, "space", "OBJECT"), Color=slope),
    "normal map world": bumped("ShaderNodeNormalMap", lambda n: setattr(n, "space", "WORLD"), Color=slope),
    "steep diffuse": bumped("ShaderNodeNormalMap", **STEEP),
    "steep diffuse uncorrected": bumped("ShaderNodeNormalMap", correction=False, **STEEP),
    "steep glossy": bumped("ShaderNodeNormalMap", shader="ShaderNodeBsdfAnisotropic", **STEEP),
    "steep glossy uncorrected": bumped(
        "ShaderNodeNormalMap", shader="ShaderNodeBsdfAnisotropic", correction=False, **STEEP
    ),
}


def scene_of_meshes(scene):
    """Flat, smooth, mirrored, sheared and nested places, several materials on one mesh, colours of vertices."""
    grey = material("grey", Color=(0.6, 0.6, 0.6))
    square(grey, 3.0)
    paint = bpy.data.materials.new("paint")
    tree = tree_of(paint)
    colors = node(tree, "ShaderNodeVertexColor", {"layer_name": "paint"})
    output(tree, node(tree, "ShaderNodeBsdfDiffuse", None, {"Color": colors.outputs[0]}))
    painted = mesh(
        "painted", [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0, 0.5, 0.4)], [(0, 1, 2)], paint, location=(-0.8, 0.6, 0.2)
    )
    layer = painted.data.color_attributes.new("paint", "FLOAT_COLOR", "POINT")
    for item, value in zip(layer.data, ((1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1)), strict=True):
        item.color = value
    shiny = material(
        "shiny", "ShaderNodeBsdfAnisotropic", {"distribution": "GGX"}, Color=(0.8, 0.7, 0.5), Roughness=0.25
    )
    ball(shiny, 0.35, smooth=False, rings=6, location=(0.7, 0.6, 0.36))
    ball(shiny, 0.35, location=(0.7, -0.4, 0.3), scale=(-1, 1.4, 0.8), rotation=(0.3, 0.2, 0.5))
    two = cube(material("red", Color=(0.7, 0.1, 0.1)), 0.25, location=(-0.5, -0.4, 0.26), rotation=(0, 0, 0.4))
    two.data.materials.append(material("blue", Color=(0.1, 0.2, 0.7)))
    two.data.polygons.foreach_set("material_index", [0, 1, 0, 1, 0, 1])
    light()
    scene_camera()


def stretched(scene):
    """Coarse smooth balls, squashed: Cycles interpolates normals in another space where a mesh is shared."""
    grey = material("grey", Color=(0.6, 0.6, 0.6))
    mapped = bumped("ShaderNodeNormalMap", **STEEP)("mapped")
    places = ((-0.7, -0.5, 0.2), (0.7, -0.5, 0.2), (-0.7, 0.7, 0.2), (0.7, 0.7, 0.2))
    shared = None
    for place, look in zip(places, (grey, grey, grey, mapped), strict=True):
        made = ball(look, 0.4, rings=6, location=place, scale=(1.6, 0.7, 0.3), rotation=(0.2, 0.1, 0.4))
        if look is grey and place[0] < 0:
            shared = made.data = shared or made.data
    light()
    scene_camera()


def scene_camera():
    from .studio import camera

    return camera((0, -4, 4), (0, 0, 0.2), 34.0)


def leaves(scene):
    """See-through surfaces: shadows through alpha, coloured filters, several behind one another."""
    square(material("grey", Color=(0.6, 0.6, 0.6)), 3.0)
    filters = material("filter", "ShaderNodeBsdfTransparent", Color=(0.9, 0.5, 0.2))
    half = material("half", "ShaderNodeBsdfPrincipled", Base_Color=(0.2, 0.6, 0.2), Alpha=0.5)
    for i in range(3):
        square(filters, 0.5, location=(-0.6, 0.1 * i, 0.5 + 0.25 * i))
        square(half, 0.4, location=(0.6, -0.1 * i, 0.4 + 0.25 * i), rotation=(0.2, 0.1 * i, 0))
    lamp("SUN", (0, 0, 4), (0.4, 0.2, 0), 2.0, angle=0.1)
    world((0.2, 0.25, 0.3))
    scene_camera()


def by_ray(scene):
    """Light Path decides: a plane that emits for camera rays only and is blue to glossy ones."""
    made = bpy.data.materials.new("by ray")
    tree = tree_of(made)
    path = node(tree, "ShaderNodeLightPath")
    color = node(
        tree,
        "ShaderNodeMix",
        {"data_type": "RGBA"},
        {0: path.outputs["Is Glossy Ray"], 6: (0.7, 0.3, 0.1, 1), 7: (0.1, 0.1, 0.9, 1)},
    )
    diffuse = node(tree, "ShaderNodeBsdfDiffuse", None, {"Color": color.outputs[2]})
    glow = node(tree, "ShaderNodeEmission", None, {"Color": (0.2, 0.4, 0.1), "Strength": path.outputs["Is Camera Ray"]})
    both = node(tree, "ShaderNodeAddShader", None, {0: diffuse.outputs[0], 1: glow.outputs[0]})
    output(tree, both)
    square(made, 3.0)
    ball(
        material("mirror", "ShaderNodeBsdfAnisotropic", {"distribution": "GGX"}, Color=(0.9, 0.9, 0.9), Roughness=0.0),
        0.5,
        location=(0, 0, 0.5),
    )
    hidden = cube(material("hidden", Color=(0.8, 0.8, 0.1)), 0.2, location=(-0.9, 0, 0.3))
    hidden.visible_camera = False
    shadowless = cube(material("shadowless", Color=(0.1, 0.8, 0.8)), 0.2, location=(0.9, -0.3, 0.3))
    shadowless.visible_shadow = False
    light()
    scene_camera()


FLAT = {"samples": 16, "tolerance": 0.004}
CASES = [
    sheet("numbers", NUMBERS, tile_square, no_light, **FLAT),
    sheet("vectors", VECTORS, tile_square, no_light, **FLAT),
    sheet("colors", COLORS, tile_square, no_light, **FLAT),
    sheet("textures", TEXTURES, tile_square, no_light, **FLAT),
    sheet("inputs", INPUTS, tile_square, no_light, **FLAT),
    sheet("inputs on balls", INPUTS, tile_turned, no_light, **FLAT),
    sheet("normals", NORMALS, tile_square, light),
    sheet("normals on balls", NORMALS, tile_turned, light),
    Case("meshes", scene_of_meshes),
    Case("stretched meshes", stretched),
    Case("see-through", leaves),
    Case("by ray", by_ray),
]
