"""Small scenes in which GI Engine is known to differ from Cycles, and why. Each is a row of docs/parity-features.md too."""

import bpy

KNOWN: dict[str, str] = {}
if bpy.app.version < (5, 0):
    KNOWN["light below surfaces"] = (
        "1 % brighter than Cycles 4.5, up to 6 % in a block; the cause is not found. 5.2 agrees"
    )
