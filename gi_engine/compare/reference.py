"""The reference: a long render in pieces by different seeds, each kept as EXR, so that an interrupted one goes on where it was.
Its noise comes from how the pieces differ. Or an EXR file of the user's."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..output import Target
from .metrics import own_noise
from .pictures import PictureError, read_exr, read_passes, reads_passes
from .plan import Plan

FIRST_SEED = 1000  # far from those of the pictures that are compared
TIMES = 10  # an engine's seconds or samples


@dataclass
class Reference:
    name: str
    pixels: np.ndarray  # (height, width, 3)
    variance: np.ndarray | float  # of each pixel; 0 where nobody knows
    passes: dict[str, np.ndarray]
    figures: dict  # for the report


def goal(plan: Plan) -> dict:
    """Seconds or samples that the reference takes in all."""
    if plan.reference_seconds:
        return {"sampling": plan.reference_seconds}
    if plan.reference_samples or plan.samples:
        return {"samples": plan.reference_samples or TIMES * plan.samples}
    return {"sampling": TIMES * plan.seconds if plan.seconds else 300.0}


def times_of(plan: Plan) -> float:
    """How many times as long as an engine's picture it takes; a guess where that is not known."""
    if isinstance(plan.reference, Path):
        return 0.0
    (what, wanted), own = next(iter(goal(plan).items())), {"sampling": plan.seconds, "samples": plan.samples}
    return wanted / own[what] if own[what] else TIMES


def from_file(path: Path, size: tuple[int, int]) -> Reference:
    """Raises PictureError where it is damaged or of another size."""
    pixels = read_exr(path)
    height, width, _ = pixels.shape
    if (width, height) != tuple(size):
        raise PictureError(f'"{path}" is {width}x{height} pixels, the pictures are {size[0]}x{size[1]}')
    bad = np.count_nonzero(~np.isfinite(pixels))
    if bad:
        raise PictureError(f'"{path}" has {bad} values that are not finite numbers')
    passes = read_passes(path) if reads_passes() else {}
    return Reference(path.name, pixels, 0.0, passes, {"file": str(path)})


def render(child, plan: Plan, folder: Path, warn, on_progress) -> Reference:
    """Adds the pieces that are missing. Raises ChildFailed, Cancelled, PictureError."""
    folder.mkdir(parents=True, exist_ok=True)
    (what, wanted), done = next(iter(goal(plan).items())), 0.0
    pieces: list[tuple[np.ndarray, dict]] = []
    rendered = number = 0
    while done < 0.98 * wanted:
        path = folder / f"piece_{number:03d}.exr"
        kept = read_piece(path, warn)
        if kept is None:
            share = wanted / plan.reference_pieces
            limits = {"samples": max(1, round(share)) if what == "samples" else 0}
            limits["seconds"] = share if what == "sampling" else 0.0
            at = done / wanted
            kept = render_piece(child, plan, path, number, limits, lambda said, at=at: on_progress(at, said))
            rendered += 1
        pieces.append(kept)
        done += max(kept[1][what], 1e-3)
        number += 1
    return merged(pieces, folder, rendered)


def read_piece(path: Path, warn) -> tuple[np.ndarray, dict] | None:
    figures = path.with_suffix(".json")
    if not figures.exists() or not path.exists():
        return None
    try:
        return read_exr(path), json.loads(figures.read_text())
    except (PictureError, ValueError) as error:
        warn(f"reference: a piece that was kept is rendered anew: {error}")
        return None


def render_piece(child, plan: Plan, path: Path, number: int, limits: dict, on_progress):
    """Into the folder of pieces, whole or not at all; the figures come last and make it count."""
    first = number == 0 and reads_passes()
    with Target(path) as target:
        figures = child.ask(
            "render",
            plan.limit + 4 * limits["seconds"],
            on_progress,
            path=str(target.folder / "piece.exr"),
            seed=FIRST_SEED + number,
            passes=first,
            **limits,
        )
        pixels = read_exr(target.folder / "piece.exr")
        target.publish(path, "piece")
    path.with_suffix(".json").write_text(json.dumps(figures))
    return pixels, figures


def merged(pieces: list, folder: Path, rendered: int) -> Reference:
    weights = np.array([figures["samples"] for _, figures in pieces], np.float64)
    weights /= weights.sum()
    mean = sum(w * pixels.astype(np.float64) for w, (pixels, _) in zip(weights, pieces, strict=True))
    variance: np.ndarray | float = 0.0
    if len(pieces) > 1:  # a piece of weight w has variance v / w
        spread = sum(w * (pixels - mean) ** 2 for w, (pixels, _) in zip(weights, pieces, strict=True))
        variance = spread / (len(pieces) - 1)
    passes_file = folder / "piece_000_passes.exr"
    passes = read_passes(passes_file) if reads_passes() and passes_file.exists() else {}
    figures = {
        "folder": str(folder),
        "samples": sum(f["samples"] for _, f in pieces),
        "seconds": sum(f["sampling"] for _, f in pieces),
        "export": pieces[0][1]["export"],
        "pieces": len(pieces),
        "rendered_now": rendered,
        "noise": own_noise(mean, variance),
    }
    return Reference("", mean.astype(np.float32), variance, passes, figures)
