"""All small cases, rendered once each and kept; what one tile of them says. Shared by the tests and the report."""

from __future__ import annotations

from functools import lru_cache

from . import cases_hair, cases_lights, cases_materials, cases_nodes, compare
from .studio import Case, Unavailable, empty, tile_region

CASES = {
    case.name: case for module in (cases_hair, cases_lights, cases_materials, cases_nodes) for case in module.CASES
}


@lru_cache(maxsize=4)
def rendered(name: str, factor: int = 1):
    """Engine -> images, `factor` times the case's samples. Raises Unavailable where this Blender lacks the node."""
    compare.register_once()
    case = CASES[name]
    scene = empty(case.size)
    case.build(scene)
    compare.neutral(scene, case.samples * factor)
    for name, value in case.cycles.items():
        setattr(scene.cycles, name, value)
    return compare.render_pairs(scene)


def agreements(name: str) -> list[compare.Agreement]:
    """One for the scene, or one for each tile of a sheet."""
    return [confirmed(CASES[name], i) for i in range(len(CASES[name].tiles) or 1)]


CONFIRM = 8  # times the samples; rare bright samples can make a block's error look smaller than it is


def confirmed(case: Case, index: int) -> compare.Agreement:
    """One tile, or the scene. What differs is rendered again with more samples, and that counts."""
    found = one(case, index, 1)
    return found if found.agrees else one(case, index, CONFIRM)


def one(case: Case, index: int, factor: int) -> compare.Agreement:
    pairs = rendered(case.name, factor)
    return tile_agreement(case, pairs, index) if case.tiles else compare.agreement(case.name, pairs, case.tolerance)


def tile_agreement(case: Case, pairs, index: int) -> compare.Agreement:
    rows, columns = tile_region(case, index)
    cut = {engine: images[:, rows, columns] for engine, images in pairs.items()}
    return compare.agreement(f"{case.name} / {case.tiles[index]}", cut, case.tolerance)


__all__ = ["CASES", "Unavailable", "agreements", "confirmed"]
