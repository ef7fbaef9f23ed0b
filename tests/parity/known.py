"""Where GI Engine is known to differ from Cycles, and why. Each is a row of docs/parity.md too."""

import bpy

KNOWN: dict[str, str] = {
    "zeyu_telescope": "two of its spheres are in the same place: in Cycles rounding lets them shadow one another, ours are lit; "
    "with either one alone all blocks agree",
}

if bpy.app.version < (5, 0, 0):
    KNOWN["principled / principled thin film metal"] = "7 % darker than Cycles 4.5, cause not looked into; 5.2 agrees"
