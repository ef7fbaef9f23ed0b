"""What a place of an instance knows: coordinates on its instancer, and its particle. Values as in Cycles."""

import bpy
import pytest


def grid(size: float, uv: bool = True):
    mesh = bpy.data.meshes.new("Grid")
    xs = (-size, 0.0, size)
    mesh.from_pydata(
        [(x, y, 0.0) for y in xs for x in xs], [], [(0, 1, 4, 3), (1, 2, 5, 4), (3, 4, 7, 6), (4, 5, 8, 7)]
    )
    if uv:
        mesh.uv_layers.new(name="UVMap").data.foreach_set("uv", [0.07 * (i % 11) for i in range(2 * 16)])
    item = bpy.data.objects.new("Grid", mesh)
    bpy.context.scene.collection.objects.link(item)
    return item


@pytest.mark.parametrize(
    ("idname", "output"), [("ShaderNodeTexCoord", "Generated"), ("ShaderNodeTexCoord", "UV"), ("ShaderNodeUVMap", "UV")]
)
def test_coordinates_of_the_instancer(stage, idname, output):
    parent = grid(1.0)
    parent.instance_type, parent.show_instancer_for_render = "FACES", False
    stage.object.parent = parent
    stage.object.scale = (0.3, 0.3, 0.3)
    stage.show(stage.new(idname, from_instancer=True).outputs[output])
    image = stage.check()
    assert len(stage.exported.instances[0].matrix) == 4
    assert image.std() > 0.02 and not stage.warnings


@pytest.mark.parametrize("output", ["Index", "Random", "Age", "Lifetime", "Location", "Size", "Velocity"])
def test_particles(stage, output):
    emitter = grid(1.0)
    emitter.show_instancer_for_render = False
    emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = emitter.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 12, 1, 1, 50
    settings.render_type, settings.instance_object, settings.particle_size = "OBJECT", stage.object, 0.2
    settings.size_random, settings.lifetime_random, settings.effector_weights.gravity = 0.5, 0.5, 0.0
    stage.object.location = (100, 0, 0)
    stage.scene.frame_set(3)
    value = stage.new("ShaderNodeVectorMath", operation="SCALE")
    value.inputs["Scale"].default_value = 0.05
    stage.link(stage.new("ShaderNodeParticleInfo").outputs[output], value.inputs[0])
    stage.show(value.outputs[0])
    image = stage.check()
    assert image.max() > 0 and not stage.warnings
