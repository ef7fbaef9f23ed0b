"""Small scenes in which GI Engine is known to differ from Cycles, and why. Each is a row of docs/parity-features.md too."""

KNOWN: dict[str, str] = {}
