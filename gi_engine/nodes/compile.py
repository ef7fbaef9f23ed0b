"""Shader node trees to programs: walks the evaluated tree from its output, through groups, reroutes and muted nodes.

Anything that cannot be rendered gets a stated fallback and one warning that names the material and the node.
"""

from __future__ import annotations

import importlib
import re
from contextlib import contextmanager
from dataclasses import dataclass, field

from ..approximations import heading
from ..scene_data import Program, Scene
from .attributes import VERTEX_NORMAL, look_up
from .node_builder import NodeBuilder, by_identifier
from .program import COLOR, FLOAT, ProgramBuilder, Value
from .rules import CLOSURE_RULES, RULES
from .trees import (
    KIND_OF_SOCKET,
    Context,
    Source,
    contexts,
    deep_recursion,
    group_output,
    has_nodes,
    inlined,
    is_inlined,
    kind_of,
)

for _family in ("values", "math", "color", "vector", "input", "textures", "voxels", "closures", "volume"):
    importlib.import_module(f"{__package__}.rules_{_family}")

DEFAULT_GREY = 0.8  # of objects without a material
MULTI_GGX = 3  # as in rules_closures
# What Cycles leaves out of the trees that it makes.
NOT_FOR_CYCLES = {
    "ShaderNodeShaderToRGB": "is for EEVEE alone",
    "ShaderNodeUVAlongStroke": "is for Freestyle alone",
    "ShaderNodeSqueeze": "is from before Blender 2.8",
    "ShaderNodeScript": "needs Open Shading Language",
}
COMBINING = {"ShaderNodeMixShader", "ShaderNodeAddShader"}
MOST_CLOSURES = 24  # Bsdf::kMaxLobes
AS_CYCLES = "as in Cycles"
NUMBERED = re.compile(r"^\d+_")


@dataclass
class Notes:
    """What compiling a program came across: whether and where the program may serve again."""

    warnings: list[str] = field(default_factory=list)
    attributes: dict = field(default_factory=dict)  # name: slot, in the order in which they were asked for
    images: dict = field(default_factory=dict)  # key: index
    lasting: bool = True  # it depends on nothing but its owner's tree, and what that is made of


def agree(asked: dict, known: dict) -> bool:
    """Whether asking in this order, with `known` numbered from 0 on, gives the same numbers."""
    following = len(known)
    for key, number in asked.items():
        if key not in known:
            if number != following:
                return False
            following += 1
        elif known[key] != number:
            return False
    return True


class Compiler:
    """Compiles what it is given and collects the images and attribute names that programs refer to in `scene`.

    warn(message) is called once for each thing that had to be replaced; `principled_default`: see _default_material;
    `known_images`: of an earlier export (known.py)."""

    def __init__(self, scene: Scene, depsgraph, warn, principled_default: bool = True, known_images=None):
        self.principled_default = principled_default
        self.scene = scene
        self.depsgraph = depsgraph
        self._warn = warn
        self._warned: set[str] = set()
        self._images: dict = {}
        self._known_images = known_images
        self.notes = Notes()

    def begin_notes(self) -> Notes:
        self.notes = Notes()
        return self.notes

    def warn(self, message: str) -> None:
        self.notes.warnings.append(message)
        if message not in self._warned:
            self._warned.add(message)
            self._warn(message)

    def attribute(self, name: str) -> int:
        """The slot of a named attribute; "" is the active UV map."""
        if name not in self.scene.attribute_names:
            self.scene.attribute_names.append(name)
        slot = self.scene.attribute_names.index(name)
        self.notes.attributes[name] = slot
        return slot

    def image(self, key, load) -> int:
        """The index of an image texture; load() gives its tiles the first time that `key` is asked for."""
        if key not in self._images:
            self._images[key] = len(self.scene.images)
            self.scene.images.append(self._tiles(key, load))
        self.notes.images[key] = self._images[key]
        return self._images[key]

    def _tiles(self, key, load) -> list:
        if self._known_images is None:
            return load()
        warned = len(self.notes.warnings)
        tiles = self._known_images.load(key, load)
        if len(self.notes.warnings) > warned:  # what could not be read is tried again the next time
            self._known_images.forget(key)
            self.notes.lasting = False
        return tiles

    def serve_again(self, notes: Notes) -> bool:
        """Takes over what a program asked for when it was compiled; False, and nothing, where that would have other numbers now."""
        attributes = {name: slot for slot, name in enumerate(self.scene.attribute_names)}
        if not agree(notes.attributes, attributes) or not agree(notes.images, self._images):
            return False
        if not all(key in self._images or self._known_images.has(key) for key in notes.images):
            return False
        self.begin_notes()  # what follows is not for those of the program that was compiled last
        for name in notes.attributes:
            self.attribute(name)
        for key in notes.images:
            self.image(key, None)
        for message in notes.warnings:
            self.warn(message)
        return True

    def matrix_of(self, owner):
        """The object to world matrix of an object that a node refers to."""
        self.notes.lasting = False
        return owner.evaluated_get(self.depsgraph).matrix_world

    def view_layer_attribute(self, name: str) -> tuple:
        """A property of the view layer, the scene or the world as four numbers; zeros where there is none."""
        self.notes.lasting = False
        scene = self.depsgraph.scene_eval
        return look_up((self.depsgraph.view_layer_eval, scene, scene.world), name) or (0.0, 0.0, 0.0, 0.0)

    def scene_time(self) -> tuple[float, float]:
        """Seconds and frames."""
        self.notes.lasting = False
        scene = self.depsgraph.scene_eval
        frame = scene.frame_current + scene.frame_subframe
        return frame * scene.render.fps_base / scene.render.fps, frame

    # ---------------------------------------------------------------- entry points

    def material(self, material) -> Program:
        if material is None:
            return self._default_material()
        if not has_nodes(material):
            return self._plain(material.name, tuple(material.diffuse_color[:3]))
        walker = TreeWalker(self, f"material '{material.name}'", material)
        with deep_recursion():
            walker.surface(material, walker.tree)
            walker.aovs()
            volume = self.volume(walker, material)
            displacement = self.displacement(walker, material)
        program = walker.builder.finish(material.name)
        program.volume_program, program.only_volume = volume, volume is not None and not walker.has_surface
        program.displacement_program = displacement
        program.bumps_displacement = material.displacement_method == "BOTH"
        program.pass_index = material.pass_index
        settings = getattr(material, "cycles", None)
        program.emission_sampling = getattr(settings, "emission_sampling", "AUTO")
        program.transparent_shadows = getattr(material, "use_transparent_shadow", True)
        program.bump_correction = getattr(getattr(material, "cycles", None), "use_bump_map_correction", True)
        return walker.noted(program)

    def volume(self, surface: TreeWalker, owner) -> Program | None:
        """What fills the material's objects, or the world."""
        output = surface.tree.get_output_node("CYCLES")
        socket = output.inputs.get("Volume") if output else None
        if socket is None or surface.resolve(Context(surface.tree), socket).node is None:
            return None
        walker = TreeWalker(self, surface.who, owner, is_volume=True)
        output = walker.tree.get_output_node("CYCLES")
        walker.closure_input(Context(walker.tree), output.inputs["Volume"], walker.builder.constant(1.0))
        surface.needs |= walker.needs
        surface.approximated |= walker.approximated
        return walker.builder.finish(f"{owner.name}, volume")

    def displacement(self, surface: TreeWalker, material) -> Program | None:
        """What moves the vertices of the material's objects."""
        output = surface.tree.get_output_node("CYCLES")
        if output is None or material.displacement_method == "BUMP":
            return None
        walker = TreeWalker(self, surface.who, material)
        context, socket = Context(walker.tree), walker.tree.get_output_node("CYCLES").inputs["Displacement"]
        if walker.resolve(context, socket).node is None:
            return None
        self.attribute(VERTEX_NORMAL)
        walker.builder.op("move_point", walker.value(context, socket))
        surface.approximated |= walker.approximated
        return walker.builder.finish(f"{material.name}, displacement")

    def light(self, light) -> Program:
        """The emission of a lamp's node tree, to be multiplied with the lamp's own."""
        return self._emitter(light, "light")

    def world(self, world) -> Program:
        if has_nodes(world):
            return self._emitter(world, "world")
        walker = TreeWalker(self, f"world '{world.name}'", world)
        walker.builder.op("emission", 1.0, tuple(world.color), 1.0)
        return walker.builder.finish(world.name)

    def _emitter(self, owner, what: str) -> Program:
        walker = TreeWalker(self, f"{what} '{owner.name}'", owner)
        output = walker.tree.get_output_node("CYCLES")
        with deep_recursion():
            walker.aovs()
            if output is not None:
                walker.closure_input(Context(walker.tree), output.inputs["Surface"], walker.builder.constant(1.0))
            volume = self.volume(walker, owner)
        program = walker.builder.finish(owner.name)
        program.volume_program = volume
        return walker.noted(program)

    def _default_material(self) -> Program:
        """What Cycles gives to objects without a material: a fresh Principled BSDF from 5.0 on, diffuse before."""
        grey, white, none = (DEFAULT_GREY,) * 3, (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
        if not self.principled_default:
            return self._plain("default material", grey)
        builder = ProgramBuilder()
        unbrushed, no_film = (0.0, 0.0, none), (0.0, 1.33)
        below = builder.op("specular_layer", 1.0, none, 0.5, 1.5, 0.5, white, *unbrushed, *no_film, imm=(MULTI_GGX,))
        builder.op("base_layer", below, none, grey, 0.0, 0.0, 0.0, 0.0, white, *(0.0,) * 5, imm=(0,))
        return builder.finish("default material")

    def _plain(self, name: str, color: tuple) -> Program:
        builder = ProgramBuilder()
        builder.op("diffuse", 1.0, color, 0.0, (0.0, 0.0, 0.0))
        return builder.finish(name)


class TreeWalker:
    """One program: follows links from the output node and lets rules emit instructions."""

    def __init__(self, compiler: Compiler, who: str, owner, is_volume: bool = False):
        self.is_volume = is_volume
        self.has_surface = True
        self.compiler = compiler
        self.who = who
        self.owner = owner
        self.inlined = inlined(owner)  # held, or its tree would go
        self.tree = self.inlined.node_tree if self.inlined else owner.node_tree
        self.builder = ProgramBuilder()
        self.outputs: list[dict] = [{}]  # outputs of nodes by (context, node), innermost scope last
        self.closures = 0
        self.active: list[tuple] = []  # nodes being compiled, to find cycles
        self.needs: set[str] = set()  # what an integrator has to carry
        self.approximated: dict[str, str] = {}  # what is rendered as something else, by node

    def surface(self, material, tree) -> None:
        context = Context(tree)
        output = tree.get_output_node("CYCLES")
        if output is None:
            self.compiler.warn(f"{self.who} has no Material Output node: it renders black")
            return
        method = material.displacement_method
        if method != "DISPLACEMENT" and self.resolve(context, output.inputs["Displacement"]).node is not None:
            NodeBuilder(self, context, output).bump_displacement(moved=method == "BOTH")
        self.has_surface = self.resolve(context, output.inputs["Surface"]).node is not None
        volume = output.inputs.get("Volume")
        if not self.has_surface and volume is not None and self.resolve(context, volume).node is not None:
            self.builder.op("transparent", 1.0, (1.0, 1.0, 1.0))
        self.closure_input(context, output.inputs["Surface"], self.builder.constant(1.0))

    def aovs(self) -> None:
        """The passes that AOV outputs fill, in groups too; what is linked to the output or not, they count."""
        film = self.compiler.scene.film
        index_of = {name: (i, channels) for i, (name, channels) in enumerate(film.aovs if film else ())}
        for context in contexts(Context(self.tree)):
            for node in context.tree.nodes:
                if node.bl_idname == "ShaderNodeOutputAOV" and node.aov_name in index_of and not node.mute:
                    index, channels = index_of[node.aov_name]
                    op, socket = ("aov_color", "Color") if channels == 4 else ("aov_value", "Value")
                    self.builder.op(op, self.value(context, node.inputs[socket]), imm=(index,))

    def noted(self, program: Program) -> Program:
        """One warning for the user that names the owner and all the nodes."""
        texts = list(self.approximated.values())
        program.needs, program.approximated = sorted(self.needs), texts
        if texts:
            several = f"{heading(texts)}: " if len(texts) > 1 else ""
            self.compiler.warn(f"{self.who}: {several}{'; '.join(texts)}")
        return program

    def approximate(self, node, text: str) -> None:
        named = f"node '{self.name_of(node)}' ({node.bl_label}): {text}"
        if text.endswith(AS_CYCLES):
            self.compiler.warn(f"{self.who}: {named}")
        else:
            self.approximated.setdefault(self.name_of(node), named)

    def name_of(self, node) -> str:
        """As the user knows the node: inlining puts a number before the names of all but outputs."""
        return NUMBERED.sub("", node.name) if self.inlined else node.name

    # ---------------------------------------------------------------- following links

    def resolve(self, context: Context, socket) -> Source:
        """Goes back through reroutes, muted nodes and group borders to what feeds an input socket."""
        through: list[str] = []
        unlinked = Source(context, None, socket)  # whose own value counts if the way ends here
        while True:
            link = self.live_link(context, socket)
            if link is None:
                return unlinked
            node, output = link.from_node, link.from_socket
            stays = is_inlined(
                self.owner
            )  # reroutes and muted nodes that nothing is linked to are then as if not there
            if node.type == "REROUTE":
                socket = node.inputs[0]
            elif node.mute:
                inner = next((i for i in node.internal_links if i.to_socket == output), None)
                if inner is None:
                    return unlinked
                through.append(kind_of(output))
                socket = inner.from_socket
            elif node.type in {"GROUP", "CUSTOM GROUP"}:
                inside = group_output(node)
                if inside is None:
                    self.compiler.warn(
                        f"{self.who}: node group '{self.name_of(node)}' has no output; it gives its default"
                    )
                    return unlinked
                through.append(kind_of(output))
                context = Context(node.node_tree, node, context)
                socket, stays = by_identifier(inside.inputs, output.identifier), False
            elif node.type == "GROUP_INPUT":
                if context.parent is None:
                    return unlinked
                through.append(kind_of(output))
                socket, stays = by_identifier(context.group.inputs, output.identifier), False
                context = context.parent
            elif node.bl_idname in NOT_FOR_CYCLES:
                why = NOT_FOR_CYCLES[node.bl_idname]
                self.approximate(node, f"{why}; it is as if not linked, {AS_CYCLES}")
                return unlinked
            else:
                return Source(context, node, output, tuple(through))
            if not stays:
                unlinked = Source(context, None, socket, tuple(through))

    def live_link(self, context: Context, socket):
        if socket is None or not socket.is_linked:
            return None
        for link in socket.links:
            if link.is_muted or link.is_hidden:
                continue
            if not link.is_valid:
                self.compiler.warn(
                    f"{self.who}: the link into '{socket.name}' of node '{self.name_of(socket.node)}' is part of a cycle or invalid and is left out"
                )
                continue
            return link
        return None

    # ---------------------------------------------------------------- values and closures

    def value(self, context: Context, socket, kind: str | None = None) -> Value:
        """The value that arrives at an input socket, converted to `kind`, by default the socket's own."""
        source = self.resolve(context, socket)
        value = self.default(source.socket) if source.node is None else self.output_of(source)
        if source.node is None or not is_inlined(self.owner):
            for passed in reversed(source.through):
                value = self.builder.as_kind(value, passed)
        return self.builder.as_kind(value, kind or kind_of(socket))

    def output_of(self, source: Source) -> Value:
        """What the output socket of a source gives, as the kind of that socket."""
        value = self.node_outputs(source.context, source.node).get(source.socket.identifier)
        if value is None:  # an output that the rule does not make
            value = self.builder.constant(0.0)
        return self.builder.as_kind(value, kind_of(source.socket))

    def default(self, socket) -> Value:
        kind = KIND_OF_SOCKET.get(socket.type) if socket else None
        if kind is None or not hasattr(socket, "default_value"):
            return self.builder.constant(0.0)
        if kind == FLOAT:
            return self.builder.constant(float(socket.default_value))
        return self.builder.constant(*list(socket.default_value)[:3], kind=kind)

    def node_outputs(self, context: Context, node) -> dict[str, Value]:
        key = (context.key, node.as_pointer())
        for scope in reversed(self.outputs):
            if key in scope:
                return scope[key]
        if key in self.active:
            self.compiler.warn(f"{self.who}: node '{self.name_of(node)}' is part of a cycle; it gives 0 there")
            return {}
        made = NodeBuilder(self, context, node)
        rule = RULES.get(node.bl_idname)
        if rule is None:
            self.approximate(node, "not supported; it gives its default")
            made.pass_defaults()
        else:
            self.active.append(key)
            rule(made)
            self.active.pop()
        self.outputs[-1][key] = made.made
        return made.made

    def closure_input(self, context: Context, socket, weight: Value) -> None:
        """Compiles the shader that feeds a socket, scaled by `weight`."""
        source = self.resolve(context, socket)
        node = source.node
        if node is None:
            return
        if source.socket.type != "SHADER":  # a colour plugged into a shader socket emits, as in Cycles
            color = self.builder.as_kind(self.output_of(source), COLOR)
            self.builder.op("emission", weight, color, 1.0)
            return
        rule = CLOSURE_RULES.get(node.bl_idname)
        key = (source.context.key, node.as_pointer())
        if rule is None:
            self.approximate(node, "not supported; it renders black")
        elif key in self.active:
            self.compiler.warn(f"{self.who}: node '{self.name_of(node)}' is part of a cycle and is left out there")
        else:
            self.active.append(key)
            self.closures += node.bl_idname not in COMBINING
            if self.closures == MOST_CLOSURES + 1:
                self.compiler.warn(
                    f"{self.who} has more than {MOST_CLOSURES} closures; of those that show in one place the first count"
                )
            rule(NodeBuilder(self, source.context, node), weight)
            self.active.pop()

    @contextmanager
    def branch(self, condition: Value):
        """Instructions that are skipped where `condition` is 0."""
        self.outputs.append({})
        with self.builder.unless_zero(condition):
            yield
        self.outputs.pop()

    @contextmanager
    def isolated(self):
        """Nothing computed outside is used inside, nor the other way round: for what depends on a point or normal that changes."""
        outer, self.outputs = self.outputs, [{}]
        with self.builder.isolated():
            yield
        self.outputs = outer

    @contextmanager
    def undisplaced(self):
        """Inside, the point is where it was before true displacement."""
        from ..export.version import undisplaced_steps_differ  # needs bpy

        with self.isolated():
            before = self.builder.op("undisplace", imm=(undisplaced_steps_differ(),))
            yield
            self.builder.op("redisplace", *before)

    @contextmanager
    def shifted(self, axis: int, width: Value):
        """Inside, the point is moved over the surface by `width` pixels along `axis`."""
        with self.isolated():
            before = self.builder.op("bump_shift", width, imm=(axis,))
            yield
            self.builder.op("bump_restore", *before)
