"""Materials, lights and worlds to programs, each from the output node of its tree. No bpy."""

from __future__ import annotations

from ..scene_data import Program, Scene
from .attributes import VERTEX_NORMAL
from .node_builder import NodeBuilder
from .program import ProgramBuilder
from .resources import Resources
from .tree_walker import TreeWalker
from .trees import Context, contexts, deep_recursion, has_nodes

DEFAULT_GREY = 0.8  # of objects without a material
MULTI_GGX = 3  # as in rules_closures


class Compiler:
    """Compiles what it is given; what programs refer to is collected in `scene` (resources.py). `principled_default`: see
    _default_material."""

    def __init__(self, scene: Scene, depsgraph, warn, principled_default: bool = True, known_images=None):
        self.principled_default = principled_default
        self.resources = Resources(scene, depsgraph, warn, known_images)

    def material(self, material) -> Program:
        if material is None:
            return self._default_material()
        if not has_nodes(material):
            return plain(material.name, tuple(material.diffuse_color[:3]))
        walker = TreeWalker(self.resources, f"material '{material.name}'", material)
        with deep_recursion():
            has_surface = compile_surface(walker)
            compile_aovs(walker)
            volume = self.volume(walker)
            displacement = self.displacement(walker)
        program = walker.finish(material.name)
        program.volume_program, program.only_volume = volume, volume is not None and not has_surface
        program.displacement_program = displacement
        program.bumps_displacement = material.displacement_method == "BOTH"
        program.pass_index = material.pass_index
        settings = getattr(material, "cycles", None)
        program.emission_sampling = getattr(settings, "emission_sampling", "AUTO")
        program.transparent_shadows = getattr(material, "use_transparent_shadow", True)
        program.bump_correction = getattr(settings, "use_bump_map_correction", True)
        return program

    def light(self, light) -> Program:
        """The emission of a lamp's node tree, to be multiplied with the lamp's own."""
        return self._emitter(light, "light")

    def world(self, world) -> Program:
        if has_nodes(world):
            return self._emitter(world, "world")
        builder = ProgramBuilder()
        builder.op("emission", 1.0, tuple(world.color), 1.0)
        return builder.finish(world.name)

    def _emitter(self, owner, what: str) -> Program:
        walker = TreeWalker(self.resources, f"{what} '{owner.name}'", owner)
        output = walker.output_node()
        with deep_recursion():
            compile_aovs(walker)
            if output is not None:
                walker.closure_input(Context(walker.tree), output.inputs["Surface"], walker.builder.constant(1.0))
            volume = self.volume(walker)
        program = walker.finish(owner.name)
        program.volume_program = volume
        return program

    def volume(self, surface: TreeWalker) -> Program | None:
        """What fills the material's objects, or the world."""
        output = surface.output_node()
        socket = output.inputs.get("Volume") if output else None
        if socket is None or surface.resolve(Context(surface.tree), socket).node is None:
            return None
        walker = TreeWalker(self.resources, surface.remarks.who, surface.owner, is_volume=True)
        socket = walker.output_node().inputs["Volume"]
        walker.closure_input(Context(walker.tree), socket, walker.builder.constant(1.0))
        surface.needs |= walker.needs
        surface.remarks.approximated |= walker.remarks.approximated
        return walker.builder.finish(f"{surface.owner.name}, volume")

    def displacement(self, surface: TreeWalker) -> Program | None:
        """What moves the vertices of the material's objects."""
        material = surface.owner
        if surface.output_node() is None or material.displacement_method == "BUMP":
            return None
        walker = TreeWalker(self.resources, surface.remarks.who, material)
        context, socket = Context(walker.tree), walker.output_node().inputs["Displacement"]
        if walker.resolve(context, socket).node is None:
            return None
        self.resources.attribute(VERTEX_NORMAL)
        walker.builder.op("move_point", walker.value(context, socket))
        surface.remarks.approximated |= walker.remarks.approximated
        return walker.builder.finish(f"{material.name}, displacement")

    def _default_material(self) -> Program:
        """What Cycles gives to objects without a material: a fresh Principled BSDF from 5.0 on, diffuse before."""
        grey, white, none = (DEFAULT_GREY,) * 3, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
        if not self.principled_default:
            return plain("default material", grey)
        builder = ProgramBuilder()
        unbrushed, no_film = (0.0, 0.0, none), (0.0, 1.33)
        below = builder.op("specular_layer", 1.0, none, 0.5, 1.5, 0.5, white, *unbrushed, *no_film, imm=(MULTI_GGX,))
        builder.op("base_layer", below, none, grey, 0.0, 0.0, 0.0, 0.0, white, *(0.0,) * 5, imm=(0,))
        return builder.finish("default material")


def plain(name: str, color: tuple) -> Program:
    builder = ProgramBuilder()
    builder.op("diffuse", 1.0, color, 0.0, (0.0, 0.0, 0.0))
    return builder.finish(name)


def compile_surface(walker: TreeWalker) -> bool:
    """What a material's surface does to light; False where nothing is linked to that output."""
    context, output = Context(walker.tree), walker.output_node()
    if output is None:
        walker.resources.warn(f"{walker.remarks.who} has no Material Output node: it renders black")
        return True
    method = walker.owner.displacement_method
    if method != "DISPLACEMENT" and walker.resolve(context, output.inputs["Displacement"]).node is not None:
        NodeBuilder(walker, context, output).bump_displacement(moved=method == "BOTH")
    has_surface = walker.resolve(context, output.inputs["Surface"]).node is not None
    volume = output.inputs.get("Volume")
    if not has_surface and volume is not None and walker.resolve(context, volume).node is not None:
        walker.builder.op("transparent", 1.0, (1.0, 1.0, 1.0))
    walker.closure_input(context, output.inputs["Surface"], walker.builder.constant(1.0))
    return has_surface


def compile_aovs(walker: TreeWalker) -> None:
    """The passes that AOV outputs fill, in groups too; what is linked to the output or not, they count."""
    film = walker.resources.scene.film
    index_of = {name: (i, channels) for i, (name, channels) in enumerate(film.aovs if film else ())}
    for context in contexts(Context(walker.tree)):
        for node in context.tree.nodes:
            if node.bl_idname == "ShaderNodeOutputAOV" and node.aov_name in index_of and not node.mute:
                index, channels = index_of[node.aov_name]
                op, socket = ("aov_color", "Color") if channels == 4 else ("aov_value", "Value")
                walker.builder.op(op, walker.value(context, node.inputs[socket]), imm=(index,))
