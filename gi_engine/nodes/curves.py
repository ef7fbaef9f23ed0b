"""Curve mappings and colour ramps as lookup tables. No bpy."""

from __future__ import annotations

import numpy as np

SIZE = 256  # entries of a table, as in Cycles


def bits(number: float) -> int:
    """A float32 as the immediate of an op."""
    return int(np.float32(number).view(np.int32))


def curve_immediates(b, mapping, channels: int) -> tuple:
    """Adds the table of a curve mapping; what the ops float_curve and curves want to know of it.

    A fourth curve is combined: it comes before the others."""
    mapping.update()
    curves = list(mapping.curves)
    ends = [curve.points[i].location[0] for curve in curves for i in (0, -1)]
    lo, hi = min(ends), max(ends)
    if hi <= lo:
        hi = lo + 1.0
    positions = np.linspace(lo, hi, SIZE)
    combined = [mapping.evaluate(curves[3], x) for x in positions] if len(curves) > 3 else positions
    table = [[mapping.evaluate(curve, x) for curve in curves[:channels]] for x in combined]
    return (b.table(table), SIZE, mapping.extend == "EXTRAPOLATED", bits(lo), bits(hi))


def ramp_immediates(b, ramp) -> tuple:
    """Adds the table of a colour ramp; what the op color_ramp wants to know of it."""
    table = [tuple(ramp.evaluate(i / (SIZE - 1))) for i in range(SIZE)]
    return (b.table(table), SIZE, ramp.interpolation != "CONSTANT")
