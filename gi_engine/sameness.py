"""Whether two exports, or parts of them, hold the same: by identity where they share, else by value. No bpy."""

from __future__ import annotations

import dataclasses

import numpy as np


def same(a, b) -> bool:
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b)
    if dataclasses.is_dataclass(a):
        return all(same(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    if isinstance(a, list | tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    return a == b


def same_scene(a, b) -> bool:
    """Of two scene_data.Scenes, whether they show the same to any camera on any film."""
    cheapest_first = ("world", "lights", "attribute_names", "programs", "instances", "meshes", "images")
    return all(same(getattr(a, name), getattr(b, name)) for name in cheapest_first)
