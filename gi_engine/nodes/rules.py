"""The table of rules: one small function for each kind of shader node, by its bl_idname. No bpy.

    @rule("ShaderNodeGamma")
    def gamma(b):
        b.output("Color", b.op("gamma", b.input("Color"), b.input("Gamma"), kind=COLOR))

    @closure_rule("ShaderNodeBsdfTransparent")
    def transparent(b, weight):
        b.op("transparent", weight, b.input("Color"))

`b` is a node_builder.NodeBuilder.
"""

from __future__ import annotations

RULES: dict = {}
CLOSURE_RULES: dict = {}


def rule(*idnames: str):
    """The function sets the node's outputs with b.output(identifier, value)."""

    def add(function):
        RULES.update(dict.fromkeys(idnames, function))
        return function

    return add


def closure_rule(*idnames: str):
    """The function takes (b, weight) and emits closure ops whose first input is the weight."""

    def add(function):
        CLOSURE_RULES.update(dict.fromkeys(idnames, function))
        return function

    return add
