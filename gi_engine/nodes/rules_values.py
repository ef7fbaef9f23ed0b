"""Rules of the nodes that hold constants. No bpy."""

from __future__ import annotations

from .program import VECTOR
from .rules import rule


@rule("ShaderNodeValue", "ShaderNodeRGB")
def constant(b):
    b.pass_defaults()  # the number or the colour is kept in the output socket


@rule("FunctionNodeInputVector")
def vector(b):
    """Blender puts these where it has worked out a vector while flattening a tree."""
    numbers = (*b.node.vector, 0.0, 0.0)[:3]
    b.output("Vector", b.constant(*map(float, numbers), kind=VECTOR))


@rule("FunctionNodeInputInt", "FunctionNodeInputBool")
def number(b):
    name = "integer" if b.node.bl_idname == "FunctionNodeInputInt" else "boolean"
    b.output(name.title(), b.constant(float(getattr(b.node, name))))
