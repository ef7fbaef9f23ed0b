"""The shared scenes: where they are, and how one is made small enough to compare. Not part of the repository."""

from __future__ import annotations

from pathlib import Path

import bpy

from . import compare

ROOT = Path(__file__).resolve().parents[2]
SMALL = ("small/**/*.blend", "ignis/evaluation/blender/*.blend")


def folder() -> Path | None:
    """Beside the checkout, or beside a worktree's main checkout; None if these scenes are not here."""
    for parent in ROOT.parents:
        if (parent / "shared" / "scenes").is_dir():
            return parent / "shared" / "scenes"
    return None


def files(pick=()) -> list[Path]:
    found = sorted(folder().glob("*.blend"))
    for pattern in SMALL:
        found += sorted(folder().glob(pattern))
    return [f for f in found if not pick or any(word in str(f) for word in pick)]


def open_small(path: Path, longest: int, samples: int):
    """Opens the scene with its own bounce limits, at most `longest` pixels wide or high."""
    compare.register_once()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    scene = bpy.context.scene
    compare.neutral(scene, samples)
    render = scene.render
    factor = longest / max(render.resolution_x, render.resolution_y)
    render.resolution_x = max(8, round(render.resolution_x * factor / 8) * 8)
    render.resolution_y = max(8, round(render.resolution_y * factor / 8) * 8)
    render.resolution_percentage = 100
    render.film_transparent = False
    return scene
