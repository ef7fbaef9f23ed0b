"""The classic figure: ray tracing, soft shadows, caustics from photons, global illumination, and a path traced reference, each as EXR and
all on one labelled sheet [Jensen 1996, fig. 6; Jensen 2001]. What fails leaves its place empty; the others stay."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..output import Target
from .child import Child, ChildFailed
from .plan import Plan
from .reference import TIMES
from .runner import Watcher

SHEET = "series.png"
CAPTION, EDGE = 0.09, 0.012  # of a picture's height; of its width
PAPER, INK, EMPTY = (255, 255, 255), (20, 20, 20), (200, 200, 200)


@dataclass
class Step:
    name: str  # of its files
    caption: str
    engine: str
    parameters: dict = field(default_factory=dict)
    error: str = ""
    shown: np.ndarray | None = None  # (height, width, 3) of 0 to 1, through the view transform


def steps() -> list[Step]:
    return [
        Step("ray_tracing", "Ray tracing", "whitted"),
        Step("soft_shadows", "+ soft shadows", "distributed"),
        Step("caustics", "+ caustics", "photon_map", {"global_light": "NONE"}),
        Step("global_illumination", "+ global illumination", "photon_map", {"global_light": "CACHED"}),
        Step("reference", "Path traced reference", "path"),
    ]


def series(plan: Plan, watcher: Watcher) -> list[Step]:
    """Renders into plan.output. Raises Cancelled; what was finished is there then."""
    made = steps()
    try:
        for number, step in enumerate(made):
            watcher.progress(number / len(made), f"{step.caption}: …")
            try:
                render_step(plan, watcher, step, number / len(made))
            except (ChildFailed, OSError) as error:
                step.error = str(error)
                watcher.say(f"{step.caption} failed: {error}")
    finally:
        write_sheet(made, plan.output / SHEET)
    return made


def render_step(plan: Plan, watcher: Watcher, step: Step, before: float) -> None:
    """Its picture as EXR, and as it is shown."""
    times = TIMES if step.name == "reference" else 1
    limits = {"seconds": times * plan.seconds, "samples": times * plan.samples}
    if step.name == "reference" and (plan.reference_seconds or plan.reference_samples):
        limits = {"seconds": plan.reference_seconds, "samples": plan.reference_samples}
    path = (plan.output / f"{step.name}.exr").resolve()
    with Child(watcher.stopped) as child:
        child.ask("open", file=str(plan.file.resolve()), engine=step.engine, view=plan.view())
        child.ask(
            "render",
            plan.limit + 4 * limits["seconds"],
            lambda said: watcher.progress(before, f"{step.caption}: {said['samples']} samples"),
            path=str(path),
            seed=1,
            passes=False,
            parameters=step.parameters,
            **limits,
        )
        target = path.with_suffix(".png")
        child.ask("show", source=str(path), target=str(target))
    shown = target.with_suffix(".npy")
    step.shown = np.load(shown)
    shown.unlink()


def write_sheet(made: list[Step], path: Path) -> None:
    """All in a row, each above its caption."""
    from PIL import Image, ImageDraw, ImageFont

    sizes = [step.shown.shape[:2] for step in made if step.shown is not None]
    if not sizes:
        return
    height, width = sizes[0]
    strip, edge = max(round(CAPTION * height), 12), max(round(EDGE * width), 2)
    sheet = Image.new("RGB", (len(made) * (width + edge) + edge, height + strip + 2 * edge), PAPER)
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(0.6 * strip)
    for number, step in enumerate(made):
        left = edge + number * (width + edge)
        if step.shown is None:
            draw.rectangle((left, edge, left + width, edge + height), EMPTY)
        else:
            shown = (np.clip(np.nan_to_num(step.shown), 0, 1) * 255 + 0.5).astype(np.uint8)
            sheet.paste(Image.fromarray(shown), (left, edge))
        caption = step.caption if step.shown is not None else f"{step.caption}: failed"
        draw.text((left + width / 2, edge + height + strip / 2 + edge / 2), caption, INK, font, anchor="mm")
    with Target(path) as target:
        sheet.save(target.folder / ("file" + path.suffix))
        target.publish(path, "file")
