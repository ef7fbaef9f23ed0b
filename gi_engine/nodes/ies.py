"""IES photometric files (IESNA LM-63) to the floats of the native IesTable. No bpy.

Types A and B are turned to C's angles, symmetric halves and quarters are filled in, as Cycles does: it is lenient with what the standard
asks for. Lamps' sizes and the tilt of the lamp are left out."""

from __future__ import annotations

import numpy as np

# Candela to the watts that Blender's lamps count in: 4 pi over the luminous efficacy of daylight (D65), 177.83 lm/W.
WATTS_PER_CANDELA = 0.0706650768394
TYPE_C, TYPE_B, TYPE_A = 1, 2, 3
CLOSE = 1e-4  # degrees


def ies_table(text: str) -> np.ndarray | None:
    """Counts, horizontal angles, vertical angles (radians), values by horizontal angle; None for what is not IES data."""
    try:
        kind, h, v, values = parse(text)
        h, v, values = {TYPE_C: from_c, TYPE_B: from_b, TYPE_A: from_a}[kind](h, v, values)
    except (ValueError, IndexError, KeyError):
        return None
    if len(h) < 2 or len(v) < 2:
        return None
    return np.concatenate([(len(h), len(v)), np.radians(h), np.radians(v), values.ravel()]).astype(np.float32)


def parse(text: str) -> tuple:
    """Type, horizontal and vertical angles in degrees, values (h, v)."""
    text = text.replace(",", " ")
    at = text.index("\nTILT=")
    tilt, _, rest = text[at + len("\nTILT=") :].partition("\n")
    numbers = [float(word) for word in rest.split()]
    if tilt.startswith("INCLUDE"):
        numbers = numbers[2 + 2 * int(numbers[1]) :]
    v_count, h_count, kind = int(numbers[3]), int(numbers[4]), int(numbers[5])
    factor = numbers[2] * numbers[10] * numbers[11] * WATTS_PER_CANDELA
    angles, values = numbers[13 : 13 + v_count + h_count], numbers[13 + v_count + h_count :]
    values = np.array(values[: h_count * v_count]).reshape(h_count, v_count) * factor
    return kind, np.array(angles[v_count:]), np.array(angles[:v_count]), values


def close(a: float, b: float) -> bool:
    return abs(a - b) < CLOSE


def from_c(h, v, values) -> tuple:
    if close(h[0], 90.0):
        h = h - 90.0
    if len(h) == 1:
        h, values = np.array([0.0, 360.0]), np.repeat(values, 2, axis=0)
    for whole in (180.0, 360.0):  # a quarter to a half, a half to all around
        if close(h[-1], whole / 2.0):
            h, values = np.concatenate([h, whole - h[-2::-1]]), np.concatenate([values, values[-2::-1]])
    if close(h[0], 0.0) and not close(h[-1], 360.0):
        gap = 360.0 - h[-1]
        if close(h[-1] - h[-2], gap) or close(h[1] - h[0], gap):  # the last angle was left out
            h, values = np.append(h, 360.0), np.concatenate([values, values[:1]])
    return h, v, values


def from_b(h, v, values) -> tuple:
    """The pole lies: angles change places."""
    h, v, values = v, h, values.T
    if close(h[0], 0.0):
        h, values = np.concatenate([90.0 - h[:0:-1], 90.0 + h]), np.concatenate([values[:0:-1], values])
    else:
        h = h + 90.0
    if close(v[0], 0.0):
        v, values = np.concatenate([90.0 - v[:0:-1], 90.0 + v]), np.concatenate([values[:, :0:-1], values], axis=1)
    else:
        v = v + 90.0
    return h, v, values


def from_a(h, v, values) -> tuple:
    turned, mirrored = 180.0 - h[::-1], values[::-1]
    if close(h[0], 0.0):
        turned, mirrored = np.concatenate([turned, 180.0 + h[1:]]), np.concatenate([mirrored, values[1:]])
    return turned, v + 90.0, mirrored
