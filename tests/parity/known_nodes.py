"""Nodes that give other values than in Cycles, and why: rows of docs/parity-nodes.md that are known to fail."""

KNOWN: dict[str, str] = {}
# Rows (a part of their name) in which Cycles does not agree with itself.
CYCLES_OWN: dict[tuple[str, str], str] = {
    (
        "ShaderNodeBsdfHairPrincipled",
        "Coat moved",
    ): "Cycles draws a coated first reflection as wide as without the coat and weighs it as with it: "
    "how bright it is depends on how lights are sampled (tests/parity/test_cycles_own.py)",
}
