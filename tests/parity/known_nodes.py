"""Nodes that give other values than in Cycles, and why: rows of docs/parity-nodes.md that are known to fail."""

KNOWN: dict[str, str] = {}
# In one of Blender's versions, or by a pixel more or less than is allowed.
SOMETIMES: dict[str, str] = {
    "ShaderNodeTexIES": "up to Blender 4.5 vectors that are not unit count as they are",
    "ShaderNodeTexPointDensity": "up to Blender 4.5: not made",
    "ShaderNodeTexSky": "up to Blender 4.5 a sun of sixty degrees has another edge where the vector is not unit",
    "ShaderNodeTexVoronoi": "powers of Minkowski's metric are rounded differently",
    "ShaderNodeWireframe": "how wide a pixel is differs a little",
}
