"""Node trees as Blender has them: which tree counts, its groups, what sockets hold. No bpy."""

from __future__ import annotations

import sys
from contextlib import contextmanager
from dataclasses import dataclass

from .program import COLOR, FLOAT, VECTOR

KIND_OF_SOCKET = {"VALUE": FLOAT, "INT": FLOAT, "BOOLEAN": FLOAT, "VECTOR": VECTOR, "ROTATION": VECTOR, "RGBA": COLOR}
DEEPEST = 20000  # Python's recursion limit while a tree is compiled: some frames for each node of a chain


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
    through: tuple = ()  # kinds of the sockets of groups and muted nodes that the value passes on its way, last one first


def kind_of(socket) -> str:
    return KIND_OF_SOCKET.get(socket.type, FLOAT)


def inlined(owner):
    """From Blender 5.0 on: the tree without groups, zones, closures, bundles and menus. None before, and where nothing is left of
    the tree: that it has a cycle is then found by walking it as it is."""
    made = owner.inline_shader_nodes() if is_inlined(owner) and owner.node_tree is not None else None
    return made if made and made.node_tree.get_output_node("CYCLES") else None


def is_inlined(owner) -> bool:
    """From Blender 5.0 on renderers get trees without groups, where links lead from node to node: values that come out of
    nodes are not converted at the borders of groups. Materials and worlds always have their nodes in use, too."""
    return hasattr(owner, "inline_shader_nodes")


def has_nodes(owner) -> bool:
    return owner.node_tree is not None and (is_inlined(owner) or owner.use_nodes)


@contextmanager
def deep_recursion():
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(max(limit, DEEPEST))
    try:
        yield
    finally:
        sys.setrecursionlimit(limit)


def contexts(context: Context):
    """The tree and all groups in it."""
    yield context
    for node in context.tree.nodes:
        if node.type in {"GROUP", "CUSTOM GROUP"} and node.node_tree is not None and not node.mute:
            yield from contexts(Context(node.node_tree, node, context))


def group_output(node):
    if node.node_tree is None:
        return None
    outputs = [n for n in node.node_tree.nodes if n.type == "GROUP_OUTPUT"]
    return next((n for n in outputs if n.is_active_output), outputs[0] if outputs else None)
