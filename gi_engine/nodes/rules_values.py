"""Rules of the nodes that hold constants. No bpy."""

from __future__ import annotations

from .rules import rule


@rule("ShaderNodeValue", "ShaderNodeRGB")
def constant(b):
    b.pass_defaults()  # the number or the colour is kept in the output socket
