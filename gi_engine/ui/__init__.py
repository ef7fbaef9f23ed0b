"""Panels and operators: our own, and Blender's that we join."""

from . import compare, compat, lightmap, object_panels, operators, render_panels, strategies

PARTS = (operators, strategies, render_panels, lightmap, compare, object_panels, compat)


def register() -> None:
    for part in PARTS:
        part.register()


def unregister() -> None:
    for part in reversed(PARTS):
        part.unregister()
