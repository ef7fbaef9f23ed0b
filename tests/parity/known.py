"""Where GI Engine is known to differ from Cycles, and why. Each is a row of docs/parity.md too."""

import bpy

KNOWN: dict[str, str] = {
    "sky, Hosek-Wilkie": "not supported: Preetham's sky is shown, and a warning says so",
    "armory_instancing": "its sky is Hosek and Wilkie's, see below",
    "closures / sheen microfiber": "the layer of fibres is fitted to its own random walks, up to 5 % from Cycles' table near its edge",
    "inputs / image premultiplied": "a byte image set to premultiplied after it was packed: our colours are divided by alpha once too often",
    "inputs on balls / image premultiplied": "a byte image set to premultiplied after it was packed: our colours are divided by alpha once too often",
}

if bpy.app.version < (5, 0, 0):
    KNOWN["principled / principled thin film metal"] = "thin films on metal are Blender 5's; Cycles 4.5 leaves them out"
