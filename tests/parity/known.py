"""Where GI Engine is known to differ from Cycles, and why. Each is a row of docs/parity.md too."""

import bpy

KNOWN: dict[str, str] = {
    "closures / sheen microfiber": "up to 5 % off near its edge; perhaps our own fit of the layer of fibres, not proven",
    "inputs / image premultiplied": "a byte image set to premultiplied after it was packed: our colours are divided by alpha once too often",
    "inputs on balls / image premultiplied": "a byte image set to premultiplied after it was packed: our colours are divided by alpha once too often",
}

if bpy.app.version < (5, 0, 0):
    KNOWN["principled / principled thin film metal"] = "7 % darker than Cycles 4.5, cause not looked into; 5.2 agrees"
