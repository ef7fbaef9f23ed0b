"""Veach's pyramid: every technique of a bidirectional integrator by itself, weighted as it counts in the picture and unweighted, as EXR
files and as two contact sheets [Veach 1997, fig. 10.2]. For any integrator with the parameters in NEEDED. Leaves out buttons and arguments."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import bpy
import numpy as np

from . import control, native
from .bake import save, tell
from .export import export
from .output import Target
from .session import Session

NEEDED = {"only_s", "only_t", "weighted"}
LONGEST = 8  # vertices of the paths that are shown, luminaire and lens included
EDGE = 2  # pixels between the pictures of a sheet
INK = 0.6  # scene-linear
# Five rows of three pixels each, top first, as octal digits: Blender offers no font to Python that would do without its window.
GLYPHS = {
    **dict(
        zip(
            "0123456789",
            (0o75557, 0o26227, 0o71747, 0o71717, 0o55711, 0o74717, 0o74757, 0o71244, 0o75757, 0o75717),
            strict=True,
        )
    ),
    **{"s": 0o34216, "t": 0o27223, "x": 0o05250, "/": 0o11244},
}
INDEX = "strategies.json"


class StrategyError(ValueError):
    """The pyramid cannot be made; the message says why."""


def has_strategies(parameters: list[dict]) -> bool:
    return {parameter["name"] for parameter in parameters} >= NEEDED


def techniques(max_bounces: int) -> list[tuple[int, int]]:
    """(s, t): vertices from the light, vertices from the eye; short paths first. A lamp is never joined to the lens itself."""
    longest = min(LONGEST, max_bounces + 3)
    return [(s, n - s) for n in range(2, longest + 1) for s in range(n) if (s, n - s) != (1, 1)]


@dataclass
class Pyramid:
    """What was rendered so far: (height, width, 3) float32 by ((s, t), weighted), row 0 at the bottom."""

    wanted: list[tuple[tuple[int, int], bool]]
    session: Session
    settings: object
    warnings: list[str]
    images: dict = field(default_factory=dict)

    def next(self) -> Session | None:
        """A session for the next technique; None when all are there."""
        if len(self.images) == len(self.wanted):
            return None
        (s, t), weighted = self.wanted[len(self.images)]
        parameters = {**self.settings.parameters, "only_s": s, "only_t": t, "weighted": int(weighted)}
        return self.session.again(replace(self.settings, parameters=parameters))

    def take(self, session: Session) -> None:
        self.images[self.wanted[len(self.images)]] = session.read("Combined")[..., :3]

    def fraction(self, of_this: float) -> float:
        return (len(self.images) + of_this) / len(self.wanted)


def begin(context, integrator: str | None = None) -> Pyramid:
    """Raises StrategyError, ExportError, RenderFailed."""
    context.scene.update_tag()  # scripts' changes of settings would go unnoticed
    found = export(context.evaluated_depsgraph_get(), native.integrators(), None, integrator=integrator)
    settings = control.apply(found.settings)
    chosen = next(d for d in native.integrators() if d["id"] == settings.integrator)
    if not has_strategies(chosen["parameters"]):
        able = ", ".join(d["id"] for d in native.integrators() if has_strategies(d["parameters"]))
        raise StrategyError(f'integrator "{chosen["id"]}" has no strategies to show; these have: {able}')
    found.scene.film.passes, found.scene.film.aovs = ["Combined"], []
    max_bounces = int(settings.parameters["max_bounces"])
    wanted = [(way, weighted) for way in techniques(max_bounces) for weighted in (True, False)]
    session = Session(found.scene, settings)
    warnings = found.warnings + session.warnings()
    if max_bounces + 3 > LONGEST:
        warnings.append(f"strategies: paths of more than {LONGEST} vertices are not shown")
    return Pyramid(wanted, session, settings, warnings)


def render(context, folder: Path, integrator: str | None = None, stopped=lambda: False) -> Pyramid | None:
    """The whole pyramid into `folder`, waiting; None where it was stopped, and nothing is written then."""
    pyramid = begin(context, integrator)
    while session := pyramid.next():
        with session:
            while not session.wait():
                if stopped():
                    return None
                tell({**session.progress(), "fraction": pyramid.fraction(session.progress()["fraction"])})
        pyramid.take(session)
    write(context.scene, pyramid, folder)
    return pyramid


# ---------------------------------------------------------------- files


def write(scene, pyramid: Pyramid, folder: Path) -> None:
    """One EXR for each picture, both sheets, and an index of what they hold. Raises OutputError."""
    brightening = brightenings(pyramid.images)
    index = {"samples": pyramid.settings.samples, "brightened": brightening, "pictures": []}
    for ((s, t), weighted), pixels in pyramid.images.items():
        name = f"s{s}_t{t}{'' if weighted else '_unweighted'}.exr"
        with_image(pixels, folder / name, save)
        mean = float(pixels.mean(dtype=np.float64))
        index["pictures"].append({"file": name, "s": s, "t": t, "weighted": weighted, "mean": mean})
    for weighted, name in ((True, "weighted.png"), (False, "unweighted.png")):
        pictures = {way: pixels for (way, w), pixels in pyramid.images.items() if w == weighted}
        with_image(sheet(pictures, brightening), folder / name, lambda image, path: save_png(scene, image, path))
    with Target(folder / INDEX) as target:
        (target.folder / INDEX).write_text(json.dumps(index, indent=1) + "\n")
        target.publish(folder / INDEX, Path(INDEX).stem)


def brightenings(images: dict) -> dict[int, float]:
    """By vertices of a path: the power of two that makes a row of the sheets about as bright as the brightest row."""
    rows: dict[int, float] = {}
    for ((s, t), weighted), pixels in images.items():
        if weighted:
            rows[s + t] = rows.get(s + t, 0.0) + float(pixels.mean(dtype=np.float64))
    most = max(rows.values())
    return {n: 2.0 ** round(math.log2(most / mean)) if mean > 1e-6 * most else 1.0 for n, mean in rows.items()}


def label(text: str, scale: int) -> np.ndarray:
    """(5, 4 · characters) pixels of 0 and INK, times `scale`, row 0 at the bottom."""
    canvas = np.zeros((5, 4 * len(text)), np.float32)
    for i, character in enumerate(text):
        bits = GLYPHS.get(character, 0)
        for pixel in range(15):
            canvas[pixel // 3, 4 * i + 2 - pixel % 3] = INK * (bits >> pixel & 1)
    return np.kron(canvas, np.ones((scale, scale), np.float32))


def factor_name(factor: float) -> str:
    return f"x{factor:.0f}" if factor >= 1 else f"x1/{1 / factor:.0f}"


def sheet(pictures: dict, brightening: dict[int, float]) -> np.ndarray:
    """A row for each number of vertices, short paths on top; in a row, more vertices from the light towards the right. Over each
    picture its s and t, left of each row what it is brightened by."""
    height, width, _ = next(iter(pictures.values())).shape
    lengths = sorted(brightening)
    columns = lengths[-1]
    scale = max(1, width // 48)
    strip = 5 * scale + 2 * EDGE
    margin = 4 * scale * max(len(factor_name(f)) for f in brightening.values()) + 2 * EDGE
    pitch_x, pitch_y = width + EDGE, height + strip
    canvas = np.zeros((len(lengths) * pitch_y + EDGE, max(columns * pitch_x, margin) + margin, 3), np.float32)

    def write(text: str, x: int, y: int) -> None:
        pixels = label(text, scale)
        there = canvas[y : y + pixels.shape[0], x : x + pixels.shape[1]]
        there += pixels[: there.shape[0], : there.shape[1], None]

    for (s, t), pixels in pictures.items():
        row = len(lengths) - 1 - lengths.index(s + t)  # row 0 of the canvas is at the bottom
        x = margin + s * pitch_x + (columns - s - t) * pitch_x // 2
        y = EDGE + row * pitch_y
        canvas[y : y + height, x : x + width] = pixels * brightening[s + t]
        write(f"s{s} t{t}", x, y + height + EDGE)
        if s == 0:
            write(factor_name(brightening[s + t]), EDGE, y + (height - 5 * scale) // 2)
    return canvas


def with_image(pixels: np.ndarray, path: Path, write_image) -> None:
    """Calls write_image(a Blender image of `pixels`, path); the file appears whole or not at all."""
    height, width, _ = pixels.shape
    image = bpy.data.images.new("Strategies", width, height, alpha=True, float_buffer=True)
    try:
        opaque = np.dstack([pixels, np.ones((height, width), np.float32)])
        image.pixels.foreach_set(np.ascontiguousarray(opaque, np.float32).ravel())
        image.update()
        with Target(path) as target:
            write_image(image, target.folder / ("picture" + path.suffix))
            target.publish(path, "picture")
    finally:
        bpy.data.images.remove(image)


def save_png(scene, image, path: Path) -> None:
    """As the scene's view transform shows it."""
    settings = scene.render.image_settings
    names = [name for name in ("media_type", "file_format", "color_depth", "color_mode") if hasattr(settings, name)]
    before = {name: getattr(settings, name) for name in names}
    try:
        if "media_type" in before:  # from 5.0 on
            settings.media_type = "IMAGE"
        settings.file_format = "PNG"
        settings.color_depth, settings.color_mode = "8", "RGB"
        image.save_render(str(path), scene=scene)
    finally:
        for name, value in before.items():
            setattr(settings, name, value)
