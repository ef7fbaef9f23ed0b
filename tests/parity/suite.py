"""All small cases, rendered once each and kept; what one tile of them says. Shared by the tests and the report."""

from __future__ import annotations

from functools import lru_cache

from . import cases_lights, cases_materials, cases_nodes, compare
from .studio import Case, Unavailable, empty, tile_region

CASES = {case.name: case for module in (cases_lights, cases_materials, cases_nodes) for case in module.CASES}


@lru_cache(maxsize=4)
def rendered(name: str, factor: int = 1):
    """Engine -> images, `factor` times the case's samples. Raises Unavailable where this Blender lacks the node."""
    compare.register_once()
    case = CASES[name]
    scene = empty(case.size)
    case.build(scene)
    compare.neutral(scene, case.samples * factor)
    return compare.render_pairs(scene)


def agreements(name: str, factor: int = 1) -> list[compare.Agreement]:
    """One for the scene, or one for each tile of a sheet."""
    case, pairs = CASES[name], rendered(name, factor)
    if not case.tiles:
        return [compare.agreement(name, pairs, case.tolerance)]
    return [tile_agreement(case, pairs, i) for i in range(len(case.tiles))]


def tile_agreement(case: Case, pairs, index: int) -> compare.Agreement:
    rows, columns = tile_region(case, index)
    cut = {engine: images[:, rows, columns] for engine, images in pairs.items()}
    return compare.agreement(f"{case.name} / {case.tiles[index]}", cut, case.tolerance)


__all__ = ["CASES", "Unavailable", "agreements", "rendered", "tile_agreement"]
