"""Shader node trees to programs: walks the evaluated tree from its output, through groups, reroutes and muted nodes.

Anything that cannot be rendered gets a stated fallback and one warning that names the material and the node.
"""

from __future__ import annotations

import importlib
from contextlib import contextmanager
from dataclasses import dataclass

from ..scene_data import Program, Scene
from .program import COLOR, FLOAT, VECTOR, ProgramBuilder, Value
from .rules import CLOSURE_RULES, RULES

for _family in ("closures", "textures"):
    importlib.import_module(f"{__package__}.rules_{_family}")

KIND_OF_SOCKET = {"VALUE": FLOAT, "INT": FLOAT, "BOOLEAN": FLOAT, "VECTOR": VECTOR, "ROTATION": VECTOR, "RGBA": COLOR}
DEFAULT_GREY = 0.8  # of objects without a material


@dataclass(frozen=True)
class Context:
    """A node tree and the group node that it stands for."""

    tree: object
    group: object = None
    parent: Context | None = None

    @property
    def key(self) -> tuple:
        return (self.parent.key if self.parent else ()) + ((self.group.as_pointer(),) if self.group else ())


@dataclass(frozen=True)
class Source:
    """Where an input socket gets its value from: an output socket of a node, or, where `node` is None, `socket` itself."""

    context: Context
    node: object
    socket: object


class Compiler:
    """Compiles what it is given and collects the images and attribute names that programs refer to in `scene`.

    warn(message) is called once for each thing that had to be replaced."""

    def __init__(self, scene: Scene, depsgraph, warn):
        self.scene = scene
        self.depsgraph = depsgraph
        self._warn = warn
        self._warned: set[str] = set()
        self._images: dict = {}

    def warn(self, message: str) -> None:
        if message not in self._warned:
            self._warned.add(message)
            self._warn(message)

    def attribute(self, name: str) -> int:
        """The slot of a named attribute; "" is the active UV map."""
        if name not in self.scene.attribute_names:
            self.scene.attribute_names.append(name)
        return self.scene.attribute_names.index(name)

    def image(self, key, load) -> int:
        """The index of an image texture; load() gives its tiles the first time that `key` is asked for."""
        if key not in self._images:
            self._images[key] = len(self.scene.images)
            self.scene.images.append(load())
        return self._images[key]

    # ---------------------------------------------------------------- entry points

    def material(self, material) -> Program:
        if material is None:
            return self._plain("default material", (DEFAULT_GREY,) * 3)
        tree = material.node_tree if material.use_nodes else None
        if tree is None:
            return self._plain(material.name, tuple(material.diffuse_color[:3]))
        walker = TreeWalker(self, f"material '{material.name}'")
        output = tree.get_output_node("CYCLES")
        if output is None:
            self.warn(f"material '{material.name}' has no active Material Output node: it renders black")
        else:
            walker.surface(Context(tree), output, displaced=material.displacement_method != "DISPLACEMENT")
        program = walker.finish(material.name)
        program.pass_index = material.pass_index
        settings = getattr(material, "cycles", None)
        if settings is not None:
            program.emission_sampling = getattr(settings, "emission_sampling", "AUTO")
        program.transparent_shadows = getattr(material, "use_transparent_shadow", True)
        return program

    def light(self, light) -> Program:
        """The emission of a lamp's node tree, to be multiplied with the lamp's own."""
        return self._emitter(light.node_tree, f"light '{light.name}'", light.name)

    def world(self, world) -> Program:
        if world.node_tree is None or not world.use_nodes:
            walker = TreeWalker(self, f"world '{world.name}'")
            walker.builder.op("emission", 1.0, tuple(world.color), 1.0)
            return walker.finish(world.name)
        return self._emitter(world.node_tree, f"world '{world.name}'", world.name)

    def _emitter(self, tree, who: str, name: str) -> Program:
        walker = TreeWalker(self, who)
        output = tree.get_output_node("CYCLES")
        if output is not None:
            walker.closure_input(Context(tree), output.inputs["Surface"], walker.builder.constant(1.0))
        return walker.finish(name)

    def _plain(self, name: str, color: tuple) -> Program:
        walker = TreeWalker(self, name)
        walker.builder.op("diffuse", 1.0, color, 0.0, (0.0, 0.0, 0.0))
        return walker.finish(name)


class TreeWalker:
    """One program: follows links from the output node and lets rules emit instructions."""

    def __init__(self, compiler: Compiler, who: str):
        self.compiler = compiler
        self.who = who
        self.builder = ProgramBuilder()
        self.outputs: list[dict] = [{}]  # outputs of nodes by (context, node), innermost scope last
        self.active: list[tuple] = []  # nodes being compiled, to find cycles

    def finish(self, name: str) -> Program:
        return self.builder.finish(name)

    def surface(self, context: Context, output, displaced: bool) -> None:
        if displaced and self.resolve(context, output.inputs["Displacement"]).node is not None:
            NodeBuilder(self, context, output).bump_displacement()
        if self.resolve(context, output.inputs["Volume"]).node is not None:
            self.compiler.warn(f"{self.who}: volumes are not rendered yet; node '{output.name}' renders without its volume")
        self.closure_input(context, output.inputs["Surface"], self.builder.constant(1.0))

    # ---------------------------------------------------------------- following links

    def resolve(self, context: Context, socket) -> Source:
        """Goes back through reroutes, muted nodes and group borders to what feeds an input socket."""
        while True:
            link = self.live_link(context, socket)
            if link is None:
                return Source(context, None, socket)
            node, output = link.from_node, link.from_socket
            if node.type == "REROUTE":
                socket = node.inputs[0]
            elif node.mute:
                through = next((i for i in node.internal_links if i.to_socket == output), None)
                if through is None:
                    return Source(context, None, socket)
                socket = through.from_socket
            elif node.type == "GROUP":
                inside = group_output(node)
                if inside is None:
                    self.compiler.warn(f"{self.who}: node group '{node.name}' has no output; it gives its default")
                    return Source(context, None, socket)
                context = Context(node.node_tree, node, context)
                socket = by_identifier(inside.inputs, output.identifier)
            elif node.type == "GROUP_INPUT":
                if context.parent is None:
                    return Source(context, None, socket)
                socket = by_identifier(context.group.inputs, output.identifier)
                context = context.parent
            else:
                return Source(context, node, output)

    def live_link(self, context: Context, socket):
        if socket is None or not socket.is_linked:
            return None
        for link in socket.links:
            if link.is_muted or link.is_hidden:
                continue
            if not link.is_valid:
                self.compiler.warn(f"{self.who}: the link into '{socket.name}' of node '{socket.node.name}' is part of a cycle or invalid and is left out")
                continue
            return link
        return None

    # ---------------------------------------------------------------- values and closures

    def value(self, context: Context, socket, kind: str | None = None) -> Value:
        """The value that arrives at an input socket, converted to `kind`, by default the socket's own."""
        kind = kind or KIND_OF_SOCKET.get(socket.type, FLOAT)
        source = self.resolve(context, socket)
        if source.node is None:
            value = self.default(source.socket)
        else:
            value = self.node_outputs(source.context, source.node).get(source.socket.identifier)
            if value is None:  # an output that the rule does not make: said by the rule's owner
                value = self.builder.constant(0.0)
        # What arrives is first what the sending socket is, then what the receiving one is.
        return self.builder.as_kind(value, kind)

    def default(self, socket) -> Value:
        kind = KIND_OF_SOCKET.get(socket.type)
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
            self.compiler.warn(f"{self.who}: node '{node.name}' is part of a cycle; it gives 0 there")
            return {}
        made = NodeBuilder(self, context, node)
        rule = RULES.get(node.bl_idname)
        if rule is None:
            self.compiler.warn(f"{self.who}: node '{node.name}' ({node.bl_label}) is not supported; it gives its default")
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
            color = self.builder.as_kind(self.node_outputs(source.context, node).get(source.socket.identifier, self.builder.constant(0.0)), COLOR)
            self.builder.op("emission", weight, color, 1.0)
            return
        rule = CLOSURE_RULES.get(node.bl_idname)
        key = (source.context.key, node.as_pointer())
        if rule is None:
            self.compiler.warn(f"{self.who}: shader '{node.name}' ({node.bl_label}) is not supported; it renders black")
        elif key in self.active:
            self.compiler.warn(f"{self.who}: node '{node.name}' is part of a cycle and is left out there")
        else:
            self.active.append(key)
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
    def shifted(self, axis: int):
        """Everything inside is computed again at the point moved by one step of the pixel's footprint along `axis`."""
        outer, self.outputs = self.outputs, [{}]
        with self.builder.isolated():
            self.builder.op("bump_shift", imm=(axis,))
            yield
            self.builder.op("bump_shift", imm=(-1,))
        self.outputs = outer


class NodeBuilder:
    """What a rule sees of its node."""

    def __init__(self, walker: TreeWalker, context: Context, node):
        self.walker, self.context, self.node = walker, context, node
        self.builder = walker.builder
        self.compiler = walker.compiler
        self.op = walker.builder.op
        self.constant = walker.builder.constant
        self.table = walker.builder.table
        self.component = walker.builder.component
        self.as_kind = walker.builder.as_kind
        self.attribute = walker.compiler.attribute
        self.made: dict[str, Value] = {}

    def socket(self, identifier: str):
        """The input socket of that identifier (or, failing that, name); None where this Blender has no such socket."""
        return by_identifier(self.node.inputs, identifier) or self.node.inputs.get(identifier)

    def has(self, identifier: str) -> bool:
        return self.socket(identifier) is not None

    def linked(self, identifier: str) -> bool:
        socket = self.socket(identifier)
        return socket is not None and self.walker.resolve(self.context, socket).node is not None

    def input(self, identifier: str, kind: str | None = None, default=None) -> Value:
        """What arrives at an input. `default` is used where the socket does not exist (older Blenders)."""
        socket = self.socket(identifier)
        if socket is None:
            if default is None:
                raise KeyError(f"{self.node.bl_idname} has no input {identifier}")
            return self.constant(*default) if isinstance(default, tuple) else self.constant(default)
        return self.walker.value(self.context, socket, kind)

    def linked_or(self, identifier: str, default) -> Value:
        """What is linked to an input, or `default`: for sockets whose own value means nothing (Normal, Vector, Tangent)."""
        if self.linked(identifier):
            return self.input(identifier)
        return default if isinstance(default, Value) else self.constant(*default)

    def output(self, identifier: str, value: Value) -> None:
        self.made[identifier] = value

    def wants(self, identifier: str) -> bool:
        """Whether anything is linked to an output: expensive outputs are made only then."""
        socket = by_identifier(self.node.outputs, identifier) or self.node.outputs.get(identifier)
        return socket is not None and socket.is_linked

    def closure(self, identifier: str, weight: Value) -> None:
        """Compiles the shader linked to an input. Inputs of Mix and Add Shader go by their index."""
        self.walker.closure_input(self.context, self.socket(identifier), weight)

    def branch(self, condition: Value):
        return self.walker.branch(condition)

    def shifted(self, axis: int):
        return self.walker.shifted(axis)

    def image(self, key, load) -> int:
        return self.compiler.image(key, load)

    def warn(self, text: str) -> None:
        """One warning for the user, naming the material and this node."""
        self.compiler.warn(f"{self.walker.who}: node '{self.node.name}' ({self.node.bl_label}): {text}")

    def pass_defaults(self) -> None:
        """An unsupported node gives the value of its outputs' own defaults."""
        for socket in self.node.outputs:
            self.output(socket.identifier, self.walker.default(socket))

    def bump_displacement(self) -> None:
        """Displacement as a change of the shading normal alone, before the surface is compiled."""
        heights = [self.op("dot_normal", self.input("Displacement"))]
        for axis in (0, 1):
            with self.shifted(axis):
                heights.append(self.op("dot_normal", self.input("Displacement")))
        self.op("set_normal", self.op("bump", *heights, 1.0, 1.0, (0.0, 0.0, 0.0), imm=(0,)))


def by_identifier(sockets, identifier: str):
    return next((s for s in sockets if s.identifier == identifier), None)


def group_output(node):
    if node.node_tree is None:
        return None
    outputs = [n for n in node.node_tree.nodes if n.type == "GROUP_OUTPUT"]
    return next((n for n in outputs if n.is_active_output), outputs[0] if outputs else None)
