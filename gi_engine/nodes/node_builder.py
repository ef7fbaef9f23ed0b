"""What a rule sees of its node: inputs, outputs, instructions, warnings. No bpy. Following links is links.py's work."""

from __future__ import annotations

from .program import Value

DISPLACEMENT_FILTER_WIDTH = 0.1  # pixels, as of a new Bump node


class NodeBuilder:
    """What a rule sees of its node."""

    def __init__(self, walker, context, node):
        self.walker, self.context, self.node = walker, context, node
        self.builder = walker.builder
        self.resources = walker.resources
        self.op = walker.builder.op
        self.constant = walker.builder.constant
        self.table = walker.builder.table
        self.component = walker.builder.component
        self.as_kind = walker.builder.as_kind
        self.attribute = walker.resources.attribute
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

    def shifted_values(self, make, width: Value) -> list[Value]:
        """make() at the point, and with the point moved by `width` pixels along each axis."""
        values = [make()]
        for axis in (0, 1):
            with self.walker.shifted(axis, width):
                values.append(make())
        return values

    @property
    def owner(self):
        """The material, light or world."""
        return self.walker.owner

    def matrix_of(self, owner):
        """The object to world matrix of another object that the node refers to."""
        return self.resources.matrix_of(owner)

    def image(self, key, load) -> int:
        return self.resources.image(key, load)

    def warn(self, text: str) -> None:
        """One warning for the user, naming the material and this node."""
        self.walker.remarks.approximate(self.node, text)

    def need(self, what: str) -> None:
        """Says that it takes an integrator that carries `what` ("subsurface", "absorption", "volumes", "portals")."""
        self.walker.needs.add(what)

    def pass_defaults(self) -> None:
        """An unsupported node gives the value of its outputs' own defaults."""
        for socket in self.node.outputs:
            self.output(socket.identifier, self.walker.default(socket))

    def bump_displacement(self, moved: bool) -> None:
        """Displacement as a change of the shading normal, before the surface is compiled. `moved`: the surface is displaced, too."""
        with self.walker.undisplaced() if moved else self.walker.isolated():
            width = self.constant(DISPLACEMENT_FILTER_WIDTH)
            heights = self.shifted_values(
                lambda: self.op("vector_dot_product", self.input("Displacement"), self.op("normal")), width
            )
            self.op("set_normal", self.op("bump", *heights, 1.0, 1.0, width, self.op("normal"), imm=(moved,)))


def by_identifier(sockets, identifier: str):
    return next((s for s in sockets if s.identifier == identifier), None)
