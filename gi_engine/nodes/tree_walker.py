"""One program from a tree: values and closures that arrive at sockets, each node compiled once in its scope by its rule.

Anything that cannot be rendered gets a stated fallback and a remark that names the node.
"""

from __future__ import annotations

import importlib
from contextlib import contextmanager

from ..scene_data import Program
from .links import Links
from .node_builder import NodeBuilder
from .program import COLOR, FLOAT, ProgramBuilder, Value
from .remarks import Remarks
from .resources import Resources
from .rules import CLOSURE_RULES, RULES
from .trees import KIND_OF_SOCKET, Context, Source, inlined, is_inlined, kind_of

for _family in ("values", "math", "color", "vector", "input", "textures", "voxels", "closures", "volume"):
    importlib.import_module(f"{__package__}.rules_{_family}")

COMBINING = {"ShaderNodeMixShader", "ShaderNodeAddShader"}
MOST_CLOSURES = 24  # Bsdf::kMaxLobes


class TreeWalker:
    """Follows links from the output node and lets rules emit instructions into `builder`."""

    def __init__(self, resources: Resources, who: str, owner, is_volume: bool = False):
        self.is_volume = is_volume
        self.resources = resources
        self.owner = owner
        self.inlined = inlined(owner)  # held, or its tree would go
        self.tree = self.inlined.node_tree if self.inlined else owner.node_tree
        self.remarks = Remarks(who, resources.warn, self.inlined is not None)
        self.resolve = Links(owner, self.remarks).resolve
        self.builder = ProgramBuilder()
        self.outputs: list[dict] = [{}]  # outputs of nodes by (context, node), innermost scope last
        self.closures = 0
        self.active: list[tuple] = []  # nodes being compiled, to find cycles
        self.needs: set[str] = set()  # what an integrator has to carry

    def output_node(self):
        return self.tree.get_output_node("CYCLES")

    def finish(self, name: str) -> Program:
        """The program, with all that was said of it; the user is told."""
        program = self.builder.finish(name)
        program.needs, program.approximated = sorted(self.needs), self.remarks.summed_up()
        return program

    # ---------------------------------------------------------------- values

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
            self.remarks.say(f"node '{self.remarks.name_of(node)}' is part of a cycle; it gives 0 there")
            return {}
        made = NodeBuilder(self, context, node)
        rule = RULES.get(node.bl_idname)
        if rule is None:
            self.remarks.approximate(node, "not supported; it gives its default")
            made.pass_defaults()
        else:
            self.active.append(key)
            rule(made)
            self.active.pop()
        self.outputs[-1][key] = made.made
        return made.made

    # ---------------------------------------------------------------- closures

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
            self.remarks.approximate(node, "not supported; it renders black")
        elif key in self.active:
            self.remarks.say(f"node '{self.remarks.name_of(node)}' is part of a cycle and is left out there")
        else:
            self.active.append(key)
            self.closures += node.bl_idname not in COMBINING
            if self.closures == MOST_CLOSURES + 1:
                self.resources.warn(
                    f"{self.remarks.who} has more than {MOST_CLOSURES} closures; of those that show in one place the first count"
                )
            rule(NodeBuilder(self, source.context, node), weight)
            self.active.pop()

    # ---------------------------------------------------------------- scopes

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
