"""The page of features is that of the integrators; renders warn of what theirs does not carry."""

import bpy
import pytest

from gi_engine import approximations, native
from gi_engine.export import export
from gi_engine.info import approximated
from tests.parity import features_report


def test_page_is_up_to_date():
    assert features_report.PAGE.read_text() == features_report.page(native.integrators())


@pytest.fixture
def skin():
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    mesh = bpy.data.meshes.new("Triangle")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [], [(0, 1, 2)])
    scene.collection.objects.link(bpy.data.objects.new("Triangle", mesh))
    material = bpy.data.materials.new("Skin")
    material.use_nodes = True
    mesh.materials.append(material)
    return material


def exported(integrator: str):
    return export(bpy.context.evaluated_depsgraph_get(), native.integrators(), None, (8, 8), integrator)


def test_integrators_say_what_they_do_not_carry(skin):
    skin.node_tree.nodes["Principled BSDF"].inputs["Subsurface Weight"].default_value = 0.5
    assert not [text for text in exported("path").warnings if "subsurface" in text]
    (warning,) = [text for text in exported("whitted").warnings if "subsurface" in text]
    assert '"Skin"' in warning


def test_integrators_say_that_they_send_no_light_through_portals(skin):
    tree = skin.node_tree
    portal = tree.nodes.new("ShaderNodeBsdfRayPortal")
    tree.links.new(portal.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    for integrator, told in (
        ("path", 0),
        ("whitted", 0),
        ("bdpt", 0),
        ("light", 1),
        ("photon_map", 1),
        ("particle", 1),
    ):
        assert len([text for text in exported(integrator).warnings if "portals" in text]) == told


def test_integrators_say_which_caustics_they_cannot_switch_off(skin):
    def told(integrator):
        return [text for text in exported(integrator).warnings if "caustics" in text]

    assert not told("bdpt")
    bpy.context.scene.cycles.caustics_refractive = False
    bpy.context.scene.update_tag()
    (text,) = told("bdpt")
    assert "of glass" in text
    assert not told("path")  # switches them off
    assert not told("whitted")  # has none


def test_approximated_nodes_are_counted(skin):
    tree = skin.node_tree
    glow, empty = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeTexImage")
    tree.links.new(empty.outputs["Color"], glow.inputs["Color"])
    tree.links.new(glow.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    found = exported("path")
    assert approximated(found.scene) == ['"Skin": 1 node approximated']
    assert len(approximations.of("Skin")) == 1 and "magenta" in approximations.of("Skin")[0]
    volume, around = tree.nodes.new("ShaderNodeVolumeScatter"), tree.nodes.new("ShaderNodeTexEnvironment")
    tree.links.new(around.outputs["Color"], volume.inputs["Color"])
    tree.links.new(volume.outputs[0], tree.nodes["Material Output"].inputs["Volume"])
    warnings = [text for text in exported("path").warnings if "Skin" in text]
    assert len(warnings) == 1 and "2 nodes approximated" in warnings[0] and "Environment" in warnings[0]
    tree.links.remove(tree.nodes["Material Output"].inputs["Volume"].links[0])
    tree.links.new(tree.nodes["Principled BSDF"].outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    exported("path")
    assert not approximations.of("Skin")
