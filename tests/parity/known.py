"""Where GI Engine is known to differ from Cycles, and why. Each is a row of docs/parity.md too."""

KNOWN: dict[str, str] = {
    "zeyu_telescope": "two of its spheres are in the same place: in Cycles rounding lets them shadow one another, ours are lit; "
    "with either one alone all blocks agree",
}
