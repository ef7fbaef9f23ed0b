"""AOV outputs of materials and of the world: the same passes as of Cycles, pixel by pixel."""

import bpy
import numpy as np
import pytest

from .conftest import add, grid, mesh

AOVS = (("paint", "COLOR"), ("height", "VALUE"), ("twice", "VALUE"), ("grouped", "COLOR"), ("empty", "COLOR"))
SEE_THROUGH = (0.4, 0.0, 1.0, 0.2)  # parts that panes let through: from half on they do not count alone


def tree_of(owner):
    if bpy.app.version < (5, 0, 0):
        owner.use_nodes = True
    return owner.node_tree


def aov(tree, name: str, value, source=None):
    made = tree.nodes.new("ShaderNodeOutputAOV")
    made.aov_name = name
    made.inputs["Color"].default_value, made.inputs["Value"].default_value = (value, 2 * value, 3 * value, 0.5), value
    for socket in made.inputs if source else ():
        tree.links.new(source, socket)


def group():
    made = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    aov(made, "grouped", 0.25)
    return made


def paint(name: str, value: float, grouped, through: float = 0.0):
    made = bpy.data.materials.new(name)
    tree = tree_of(made)
    tree.nodes.clear()
    aov(tree, "paint", value, tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"])
    aov(tree, "height", value, tree.nodes.new("ShaderNodeTexNoise").outputs[0])
    aov(tree, "twice", value)
    aov(tree, "twice", 10 * value)
    tree.nodes.new("ShaderNodeGroup").node_tree = grouped
    mix, out = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeOutputMaterial")
    mix.inputs[0].default_value = through
    for kind, at in (("ShaderNodeBsdfDiffuse", 1), ("ShaderNodeBsdfTransparent", 2)):
        tree.links.new(tree.nodes.new(kind).outputs[0], mix.inputs[at])
    tree.links.new(mix.outputs[0], out.inputs[0])
    bump = tree.nodes.new("ShaderNodeDisplacement")  # AOVs see the normal that it bends
    bump.inputs["Scale"].default_value = 0.1
    hills = tree.nodes.new("ShaderNodeTexNoise")
    hills.inputs["Scale"].default_value, hills.inputs["Detail"].default_value = 2, 0
    tree.links.new(hills.outputs[0], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], out.inputs["Displacement"])
    return made


@pytest.fixture
def panes(scene):
    """A bent ground, panes of several transparencies over it, and the world beside it."""
    for name, kind in AOVS:
        made = scene.view_layers[0].aovs.add()
        made.name, made.type = name, kind
    grouped = group()
    ground = add(scene, "Ground", grid(12), scale=(4, 3, 1), location=(-2, -1.5, 0))
    ground.data.materials.append(paint("Ground", 1.0, grouped))
    for i, through in enumerate(SEE_THROUGH):
        pane = add(scene, f"Pane {i}", mesh(f"Pane {i}"), location=(-2 + i, -0.5, 1), scale=(0.8, 1, 1))
        pane.data.materials.append(paint(f"Pane {i}", 5.0 + i, grouped, through))
    scene.world = bpy.data.worlds.new("World")
    aov(tree_of(scene.world), "paint", 7.0)
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 6
    scene.render.resolution_x, scene.render.resolution_y = 48, 32
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "GAUSSIAN", 0.01
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    return scene


@pytest.mark.parametrize("transparent", [False, True])
@pytest.mark.parametrize("integrator", ["path", "bdpt", "photon_map"])
def test_aovs_are_those_of_cycles(panes, rendered, transparent, integrator):
    panes.render.film_transparent, panes.gi_engine.integrator = transparent, integrator
    ours = rendered(panes)
    panes.render.engine = "CYCLES"
    theirs = rendered(panes)
    names = [f"ViewLayer.{name}" for name, _ in AOVS]
    for name, (_, kind) in zip(names, AOVS, strict=True):
        assert ours[name].shape == theirs[name].shape == (32, 48, 4 if kind == "COLOR" else 1)
        off = (np.abs(ours[name] - theirs[name]) > 2e-2 * (1 + np.abs(theirs[name]))).any(-1)
        assert off.mean() < 0.01, name  # pixels that an edge crosses
    assert np.isclose(ours["ViewLayer.paint"][0, 0], 0 if transparent else (7, 14, 21, 1)).all()
    assert ours["ViewLayer.paint"][..., 3].max() == 2 and not ours["ViewLayer.empty"].any()


@pytest.mark.parametrize("engine", ["GI_ENGINE", "CYCLES"])
def test_what_shows_through_adds_to_the_pane_before_it(panes, rendered, engine):
    pane = bpy.data.materials["Pane 0"].node_tree
    next(node for node in pane.nodes if node.bl_idname == "ShaderNodeMixShader").inputs[0].default_value = 0.8
    panes.render.engine, panes.cycles.samples = engine, 64
    found = rendered(panes)["ViewLayer.twice"][14:18, 9:13, 0]
    error = 0.4 * 11 / np.sqrt(64 * found.size)  # of the mean of paths that go through or do not
    assert abs(found.mean() - (55 + 0.8 * 11)) < 4 * error


def test_an_aov_named_as_a_pass_is_left_to_blender(panes, rendered):
    panes.view_layers[0].aovs[0].name = "Combined"
    assert not panes.view_layers[0].aovs[0].is_valid
    assert rendered(panes)["ViewLayer.Combined"].shape == (32, 48, 4)
