"""Curves and points: what nodes know of them, seen by Cycles and here, pixel by pixel. They are thick, so that most pixels show their middle."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from gi_engine.nodes.attributes import STRAND_RANDOM

SHAPES = ("RIBBONS", "THICK", *(("THICK_LINEAR",) if bpy.app.version >= (5, 0, 0) else ()))
CURVES_INFO = ("Is Strand", "Intercept", "Length", "Thickness", "Tangent Normal", "Random")
GEOMETRY = ("Position", "Normal", "Tangent", "True Normal", "Incoming", "Parametric", "Backfacing")
COORDINATES = ("Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection")
KEYS = 5


def add_curves(stage, keys=KEYS, count=9, radius=True):
    rng = np.random.default_rng(4)
    data = bpy.data.hair_curves.new("Curves")
    data.add_curves([keys + k % 3 for k in range(count)])
    first = np.concatenate([[0], np.cumsum([keys + k % 3 for k in range(count)])])
    positions = np.empty((first[-1], 3), np.float32)
    for k in range(count):
        t = np.linspace(-1, 1, first[k + 1] - first[k])
        x = np.full_like(t, -1.0 + 2.0 * k / (count - 1)) + 0.15 * np.sin(4 * t + k)
        positions[first[k] : first[k + 1]] = np.stack([x, t, 0.3 * np.cos(3 * t + 2 * k)], 1)
    data.attributes["position"].data.foreach_set("vector", positions.ravel())
    if radius:
        thick = data.attributes.new("radius", "FLOAT", "POINT")
        thick.data.foreach_set("value", rng.uniform(0.07, 0.12, first[-1]).astype(np.float32))
    data.attributes.new("on points", "FLOAT", "POINT").data.foreach_set(
        "value", rng.random(first[-1]).astype(np.float32)
    )
    data.attributes.new("on curves", "FLOAT_VECTOR", "CURVE").data.foreach_set(
        "vector", rng.random(3 * count).astype(np.float32)
    )
    data.attributes.new("map", "FLOAT2", "CURVE").data.foreach_set("vector", rng.random(2 * count).astype(np.float32))
    return place(stage, data)


def add_points(stage, count=40):
    rng = np.random.default_rng(5)
    data = bpy.data.pointclouds.new("Points")
    if not hasattr(data, "resize"):
        pytest.skip("this Blender has no way to make point clouds by script")
    data.resize(count)
    data.attributes["position"].data.foreach_set("vector", rng.uniform(-1, 1, 3 * count).astype(np.float32))
    radius = data.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", rng.uniform(0.1, 0.3, count).astype(np.float32))
    data.attributes.new("on points", "FLOAT_COLOR", "POINT").data.foreach_set(
        "color", rng.random(4 * count).astype(np.float32)
    )
    return place(stage, data)


def place(stage, data):
    """Where the stage's surface was, unevenly scaled."""
    made = bpy.data.objects.new(data.name, data)
    for name in ("location", "rotation_euler", "scale"):
        setattr(made, name, getattr(stage.object, name))
    data.materials.append(stage.material)
    stage.scene.collection.objects.link(made)
    stage.object.hide_render = True
    return made


def check(stage):
    """Edges of thin things are where the two rays of a pixel differ most."""
    ours = stage.check(tolerance=1e-3, outliers=0.04)
    assert not stage.warnings
    return ours


@pytest.mark.parametrize("output", CURVES_INFO)
@pytest.mark.parametrize("shape", SHAPES)
def test_curves_info(stage, shape, output):
    add_curves(stage)
    stage.scene.cycles_curves.shape = shape
    stage.show(stage.new("ShaderNodeHairInfo").outputs[output])
    assert np.ptp(check(stage)) > 0.02


@pytest.mark.parametrize("output", GEOMETRY)
@pytest.mark.parametrize("shape", SHAPES)
def test_geometry_of_curves(stage, shape, output):
    add_curves(stage)
    stage.scene.cycles_curves.shape = shape
    stage.show(stage.new("ShaderNodeNewGeometry").outputs[output])
    check(stage)


@pytest.mark.parametrize("output", COORDINATES)
def test_coordinates_on_curves(stage, output):
    add_curves(stage)
    stage.show(stage.new("ShaderNodeTexCoord").outputs[output])
    check(stage)


@pytest.mark.parametrize("name", ("on points", "on curves", "map"))
def test_attributes_of_curves(stage, name):
    add_curves(stage)
    stage.show(stage.new("ShaderNodeAttribute", attribute_name=name).outputs["Vector"])
    assert np.ptp(check(stage)) > 0.5


def test_curves_without_radius_are_as_thick_as_cycles_has_them(stage):
    curves = add_curves(stage, radius=False)
    curves.scale = (1.0, 1.0, 1.0)
    stage.show(stage.new("ShaderNodeHairInfo").outputs["Thickness"])
    cycles, ours = stage.cycles(), stage.ours()
    assert cycles.max() == pytest.approx(ours.max(), rel=1e-4) and ours.max() > 0.0


def test_straight_curves(stage):
    """Curves that say so of themselves, whatever the scene's setting."""
    curves = add_curves(stage)
    curves.data.set_types(type="POLY")
    stage.show(stage.new("ShaderNodeNewGeometry").outputs["Normal"])
    check(stage)


@pytest.mark.parametrize("subdivisions", (0, 3))
def test_subdivisions_of_ribbons(stage, subdivisions):
    add_curves(stage, keys=3)
    stage.scene.cycles_curves.subdivisions = subdivisions
    stage.show(stage.new("ShaderNodeHairInfo").outputs["Intercept"])
    check(stage)


@pytest.mark.parametrize("output", ("Position", "Radius", "Random"))
def test_point_info(stage, output):
    add_points(stage)
    stage.show(stage.new("ShaderNodePointInfo").outputs[output])
    assert np.ptp(check(stage)) > 0.2


@pytest.mark.parametrize(
    "output", [name for name in GEOMETRY if name != "Tangent"]
)  # points have none: in Cycles it is undefined
def test_geometry_of_points(stage, output):
    add_points(stage)
    stage.show(stage.new("ShaderNodeNewGeometry").outputs[output])
    check(stage)


@pytest.mark.parametrize("output", COORDINATES)
def test_coordinates_on_points(stage, output):
    add_points(stage)
    stage.show(stage.new("ShaderNodeTexCoord").outputs[output])
    check(stage)


@pytest.mark.parametrize("output", ("Color", "Fac", "Alpha"))
def test_attributes_of_points(stage, output):
    add_points(stage)
    stage.show(stage.new("ShaderNodeAttribute", attribute_name="on points").outputs[output])
    assert np.ptp(check(stage)) > 0.5


def add_hair(stage, count=20, children=0, **settings):
    """Particles on the stage's own surface, which stays to be seen."""
    stage.object.modifiers.new("Hair", "PARTICLE_SYSTEM")
    system = stage.object.particle_systems[0]
    hair = system.settings
    hair.type, hair.count, hair.hair_length = "HAIR", count, 0.6
    hair.root_radius, hair.tip_radius, hair.radius_scale = 1.0, 0.3, 0.12
    hair.use_close_tip = False
    if children:
        hair.child_type, hair.rendered_child_count = "SIMPLE", children
    for name, value in settings.items():
        setattr(hair, name, value)
    return system


@pytest.mark.parametrize("output", CURVES_INFO)
@pytest.mark.parametrize("children", (0, 3))
def test_hair_of_particles(stage, output, children):
    add_hair(stage, children=children)
    stage.show(stage.new("ShaderNodeHairInfo").outputs[output])
    assert np.ptp(check(stage)) > 0.02


@pytest.mark.parametrize(
    "settings",
    (
        {"shape": 0.7},
        {"shape": -0.6},
        {"use_close_tip": True},
        {"kink": "SPIRAL"},
        {"kink": "SPIRAL", "child_type": "SIMPLE", "rendered_child_count": 2},
        {"render_step": 2},
    ),
)
def test_shape_of_particle_hair(stage, settings):
    add_hair(stage, **settings)
    stage.show(stage.new("ShaderNodeHairInfo").outputs["Thickness"])
    check(stage)


@pytest.mark.parametrize("name", ("Generated", "UV"))
def test_coordinates_on_particle_hair(stage, name):
    add_hair(stage, children=2)
    stage.show(stage.new("ShaderNodeTexCoord").outputs[name])
    check(stage)


def test_hair_has_the_colour_of_its_root(stage):
    mesh = stage.object.data
    mesh.color_attributes.remove(mesh.color_attributes["paint"])
    paint = mesh.color_attributes.new("bytes", "BYTE_COLOR", "CORNER")
    colors = np.random.default_rng(6).random((len(mesh.loops), 4)).astype(np.float32)
    paint.data.foreach_set("color", colors.ravel())
    add_hair(stage)
    stage.show(stage.new("ShaderNodeAttribute", attribute_name="bytes").outputs["Color"])
    check(stage)


def test_hair_without_its_emitter(stage):
    add_hair(stage)
    stage.object.show_instancer_for_render = False
    stage.show(stage.new("ShaderNodeHairInfo").outputs["Is Strand"])
    ours = check(stage)
    assert len(stage.exported.meshes) == 1 and 0.02 < (ours[..., 0] > 0).mean() < 0.6


def test_hair_that_the_view_layer_hides(stage):
    add_hair(stage)
    stage.scene.view_layers[0].use_strand = False
    stage.show(stage.new("ShaderNodeHairInfo").outputs["Is Strand"])
    assert check(stage).max() == 0.0


def test_instances_of_hair(stage):
    """A collection's hair goes where the collection goes."""
    collection = bpy.data.collections.new("Tuft")
    curves = add_curves(stage)
    stage.scene.collection.objects.unlink(curves)
    collection.objects.link(curves)
    for x in (-0.6, 0.6):
        empty = bpy.data.objects.new("Place", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", collection
        empty.location, empty.scale = (x, 0.0, 0.0), (0.5, 0.5, 0.5)
        stage.scene.collection.objects.link(empty)
    stage.show(stage.new("ShaderNodeHairInfo").outputs["Thickness"])
    check(stage)
    assert [i.count for i in stage.exported.instances] == [1, 1] or [i.count for i in stage.exported.instances] == [2]


def test_bumps_on_curves(stage):
    add_curves(stage)
    bump = stage.new("ShaderNodeBump")
    bump.inputs["Distance"].default_value = 0.02
    stage.link(stage.waves(30.0), bump.inputs["Height"])
    stage.show(bump.outputs["Normal"])
    cycles, ours = stage.cycles(), stage.ours()
    assert np.median(np.abs(cycles - ours)) < 2e-3


@pytest.mark.parametrize("linked", (False, True))
def test_principled_hair_varies_by_strand_unless_told_otherwise(stage, linked):
    add_curves(stage)
    hair = stage.new("ShaderNodeBsdfHairPrincipled", parametrization="MELANIN")
    hair.inputs["Random Color"].default_value = 1.0
    if linked:
        stage.link(stage.new("ShaderNodeValue").outputs[0], hair.inputs["Random"])
    stage.link(hair.outputs[0], stage.tree.get_output_node("CYCLES").inputs["Surface"])
    stage.ours()
    names = {attribute.name for attribute in stage.exported.meshes[0].attributes}
    assert (STRAND_RANDOM in names) is not linked


def add_broken_curves(stage, to_points=True):
    """Sound curves, and some whose points lie on one another: two of them, the ends, or (`to_points`) all."""
    data = add_curves(stage, keys=KEYS, count=8).data
    places = np.empty(3 * len(data.points), np.float32)
    data.attributes["position"].data.foreach_get("vector", places)
    places = places.reshape(-1, 3)
    for number, curve in enumerate(data.curves):
        first, count = curve.first_point_index, curve.points_length
        if number % 4 == 1:
            places[first + 2] = places[first + 1]
        elif number % 4 == 2:
            places[first + 1], places[first + count - 2] = places[first], places[first + count - 1]
        elif number % 4 == 3 and to_points:
            places[first : first + count] = places[first]
    data.attributes["position"].data.foreach_set("vector", places.ravel())


@pytest.mark.parametrize("output", ("Tangent", "Normal", "True Normal", "Parametric"))
@pytest.mark.parametrize("shape", SHAPES)
def test_curves_whose_points_lie_on_one_another(stage, shape, output):
    add_broken_curves(stage, to_points=output != "Tangent")  # which has no direction there, in Cycles any
    stage.scene.cycles_curves.shape = shape
    stage.show(stage.new("ShaderNodeNewGeometry").outputs[output])
    check(stage)


@pytest.mark.parametrize("model", ("CHIANG", "HUANG", "STRAND"))
@pytest.mark.parametrize("shape", SHAPES)
def test_fibres_whose_points_lie_on_one_another_are_rendered(stage, shape, model):
    add_broken_curves(stage)
    stage.scene.cycles_curves.shape = shape
    kind = "ShaderNodeBsdfHair" if model == "STRAND" else "ShaderNodeBsdfHairPrincipled"
    fibre = stage.new(kind, **({} if model == "STRAND" else {"model": model}))
    stage.link(fibre.outputs[0], stage.tree.get_output_node("CYCLES").inputs["Surface"])
    world = bpy.data.worlds.new("World")
    stage.scene.world = world
    if world.node_tree is None:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (1.0, 1.0, 1.0, 1.0)
    stage.scene.cycles.samples, stage.scene.cycles.max_bounces = 16, 4
    theirs = stage.cycles()
    stage.scene.render.engine = "GI_ENGINE"
    bpy.ops.render.render(write_still=True)
    ours = stage.rendered()
    assert np.isfinite(ours).all() and ours.mean() == pytest.approx(theirs.mean(), rel=0.03)
