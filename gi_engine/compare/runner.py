"""Runs a comparison: the reference, then each engine, then figures and maps. What fails for one engine is told; the rest goes on."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from .. import caches
from . import metrics, pictures, reference
from .child import Cancelled, Child, ChildFailed
from .pictures import PictureError
from .plan import FIRST_SECONDS, STEP, Plan, content_key, engine_label
from .reference import Reference

ENGINE_TIMES = 2.3  # an engine's own time, in all: the shorter renders, and the one by another seed
MOST_SECONDS = 600.0  # of a run until an error is reached


@dataclass
class Rendered:
    """What one engine made."""

    engine: str
    label: str
    error: str = ""  # why there is nothing, or less than was wanted
    startup: float = 0.0  # of the process and Blender
    load: float = 0.0  # of the file
    steps: list[dict] = field(default_factory=list)  # figures of each render, in order
    figures: dict = field(default_factory=dict)  # of the last one against the reference
    passes: dict[str, dict] = field(default_factory=dict)
    pixels: np.ndarray | None = None
    again: np.ndarray | None = None  # by another seed
    maps: dict[str, np.ndarray] = field(default_factory=dict)


@dataclass
class Comparison:
    plan: Plan
    facts: dict = field(default_factory=dict)  # of the scene, as the worker told
    engines: list[Rendered] = field(default_factory=list)
    reference: Reference | None = None
    warnings: list[str] = field(default_factory=list)  # of the comparison itself
    unsupported: list[str] = field(default_factory=list)  # what GI Engine met
    cancelled: bool = False


class Watcher:
    """Who wants to know how far a comparison is, and may stop it."""

    def progress(self, fraction: float, text: str) -> None:
        pass

    def say(self, text: str) -> None:
        pass

    def stopped(self) -> bool:
        return False


class Run:
    def __init__(self, plan: Plan, watcher: Watcher):
        self.plan, self.watcher = plan, watcher
        self.result = Comparison(plan)
        self.result.engines = [Rendered(engine, engine_label(engine)) for engine in plan.engines]
        # Shares of the time that the reference and each engine will take.
        self.parts = [reference.times_of(plan), *(len(plan.engines) * [ENGINE_TIMES])]
        self.scratch = plan.output / "images"

    def warn(self, text: str) -> None:
        if text not in self.result.warnings:
            self.result.warnings.append(text)
            self.watcher.say(f"warning: {text}")

    def go(self) -> Comparison:
        self.scratch.mkdir(parents=True, exist_ok=True)
        try:
            self.make_reference()
            for number, rendered in enumerate(self.result.engines, 1):
                self.render_engine(number, rendered)
        except Cancelled:
            self.result.cancelled = True
            for rendered in self.result.engines:
                if rendered.pixels is None and not rendered.error:
                    rendered.error = "cancelled before it was rendered"
        self.judge()
        return self.result

    @contextlib.contextmanager
    def child(self, engine: str):
        """A process with the scene open for `engine`; yields it and what it says of the scene."""
        with Child(self.watcher.stopped) as child:
            facts = child.ask("open", file=str(self.plan.file.resolve()), engine=engine, view=self.plan.view())
            self.result.facts = self.result.facts or facts
            yield child, facts

    def tell(self, part: float, label: str, text: str) -> None:
        number = min(int(part), len(self.parts) - 1)
        done = sum(self.parts[:number]) + min(part - number, 1.0) * self.parts[number]
        self.watcher.progress(done / sum(self.parts), f"{label}: {text}")

    # The reference

    def make_reference(self) -> None:
        wanted = self.plan.reference
        try:
            if isinstance(wanted, Path):
                with self.child(self.plan.engines[0]) as (_, facts):
                    size = facts["size"] if not self.plan.region else self.region_size(facts["size"])
                self.result.reference = reference.from_file(wanted, size)
            else:
                label = engine_label(wanted)
                with self.child(wanted) as (child, facts):
                    place = self.plan.cache or caches.folder(caches.REFERENCES)
                    folder = place / content_key(self.plan, wanted, facts)
                    self.result.reference = reference.render(
                        child,
                        self.plan,
                        folder,
                        self.warn,
                        lambda at, said: self.tell(at, f"reference ({label})", f"{said['samples']} samples"),
                    )
                self.result.reference.name = label
                caches.mark_used(folder)
                if self.plan.cache is None:  # another place is the user's affair
                    caches.trim()
            pictures.write_exr(self.plan.output / "reference.exr", self.result.reference.pixels)
        except (ChildFailed, PictureError, OSError) as error:
            self.warn(f"no reference: {error}; pictures are shown without figures")

    def region_size(self, size) -> tuple[int, int]:
        left, bottom, right, top = self.plan.region
        return round(size[0] * right) - round(size[0] * left), round(size[1] * top) - round(size[1] * bottom)

    # The engines

    def render_engine(self, number: int, rendered: Rendered) -> None:
        try:
            with self.child(rendered.engine) as (child, facts):
                rendered.startup, rendered.load = child.startup, facts["seconds"]
                for limits in self.limits(rendered):
                    self.step(child, number, rendered, limits)
        except (ChildFailed, PictureError) as error:
            rendered.error = str(error)
            self.watcher.say(f"{rendered.label} failed: {error}")

    def limits(self, rendered: Rendered):
        """Limits of each render in turn; the last is rendered by two seeds."""
        plan = self.plan
        if plan.until:
            seconds = FIRST_SECONDS
            yield {"seconds": seconds, "samples": 0}
            while self.error_of(rendered) > plan.until and seconds < MOST_SECONDS:
                seconds *= 2
                yield {"seconds": seconds, "samples": 0}
            if self.error_of(rendered) > plan.until:
                self.warn(f"{rendered.label} did not reach the error of {plan.until:g} in {seconds:.0f} s")
            yield {"seconds": seconds, "samples": 0}
            return
        shares = [STEP**-k for k in range(plan.steps - 1, -1, -1)] + [1.0]
        before = 0
        for share in shares:
            samples = max(1, round(plan.samples * share)) if plan.samples else 0
            if share == 1.0 or not plan.samples or samples != before:
                yield {"seconds": plan.seconds * share, "samples": samples}
            before = samples

    def error_of(self, rendered: Rendered) -> float:
        if self.result.reference is None:
            raise ChildFailed("there is no reference that an error could be reached against")
        return rendered.steps[-1].get("relative_mse", float("inf"))

    def step(self, child: Child, number: int, rendered: Rendered, limits: dict) -> None:
        plan, seed = self.plan, len(rendered.steps) + 1
        path = plan.output / f"{rendered.engine}_{seed}.exr"
        wanted = limits["seconds"] or limits["samples"]
        words = f"{wanted:g} s" if limits["seconds"] else f"{wanted} samples"
        self.tell(number + 0.2 * min(seed - 1, 4), rendered.label, words)
        figures = child.ask(
            "render",
            plan.limit + 4 * limits["seconds"],
            lambda said: self.tell(number + 0.2 * min(seed - 1, 4), rendered.label, f"{said['samples']} samples"),
            path=str(path.resolve()),
            seed=seed,
            passes=pictures.reads_passes(),
            **limits,
        )
        pixels = pictures.read_exr(path)
        figures["file"] = path.name
        rendered.steps.append(figures)
        rendered.again, rendered.pixels = rendered.pixels, pixels
        for message in figures.pop("warnings"):
            if message not in self.result.unsupported:
                self.result.unsupported.append(message)
        figures["not_finite"] = int(np.count_nonzero(~np.isfinite(pixels)))
        found = self.result.reference
        if found is not None and found.pixels.shape == pixels.shape:
            figures["relative_mse"] = metrics.relative_mse(np.nan_to_num(pixels), found.pixels)

    # Figures and maps

    def judge(self) -> None:
        self.show()
        if self.result.reference is not None:
            self.name_missing_packages()
        for rendered in self.result.engines:
            if rendered.pixels is None or self.result.reference is None:
                continue
            if rendered.pixels.shape != self.result.reference.pixels.shape:
                (h, w), (rh, rw) = rendered.pixels.shape[:2], self.result.reference.pixels.shape[:2]
                rendered.error = f"the picture is {w}x{h} pixels, the reference {rw}x{rh}: not compared"
                continue
            judge_one(rendered, self.result.reference, self.plan.output)

    def name_missing_packages(self) -> None:
        """Inside Blender there is no pip."""
        if not metrics.has_flip():
            self.warn("FLIP is left out: the Python package flip-evaluator is not there")
        if not pictures.reads_passes():
            self.warn("passes are left out: the Python package OpenEXR is not there")

    def show(self) -> None:
        """Pictures through the scene's view transform, by a process with the scene open."""
        names = {r.engine: r.steps[-1]["file"] for r in self.result.engines if r.steps}
        if self.result.reference is not None:
            names["reference"] = "reference.exr"
        if not names:
            return
        self.watcher.progress(1.0, "figures and pictures")
        try:
            with Child() as child:  # a cancelled run shows what it has
                child.ask(
                    "open", file=str(self.plan.file.resolve()), engine=self.plan.engines[0], view=self.plan.view()
                )
                for name, file in names.items():
                    source, target = (self.plan.output / file).resolve(), (self.scratch / f"{name}.png").resolve()
                    child.ask("show", source=str(source), target=str(target))
        except ChildFailed as error:
            self.warn(f"pictures cannot be shown: {error}")


def judge_one(rendered: Rendered, truth: Reference, output: Path) -> None:
    last = rendered.steps[-1]
    image = np.nan_to_num(rendered.pixels, posinf=0, neginf=0)
    figures = {"relative_mse": metrics.relative_mse(image, truth.pixels), "seconds": last["sampling"]}
    twice = rendered.again is not None and len(rendered.steps) > 1
    mean, variance = image, np.zeros_like(image)
    if twice:
        again = np.nan_to_num(rendered.again, posinf=0, neginf=0)
        mean, variance = metrics.of_two(image, again)
        figures["systematic_mse"] = metrics.systematic_mse(image, again, truth.pixels, truth.variance)
        figures["relative_mse"] = (figures["relative_mse"] + metrics.relative_mse(again, truth.pixels)) / 2
    figures["mean_ratio"], figures["mean_ratio_error"] = metrics.mean_ratio(
        mean, variance, truth.pixels, truth.variance
    )
    blocks = metrics.block_errors(mean, variance, truth.pixels, truth.variance)
    if twice:
        figures |= blocks.figures()
    figures["not_finite"] = sum(step["not_finite"] for step in rendered.steps)
    rendered.maps["difference"] = pictures.difference_map(image, truth.pixels)
    size = truth.pixels.shape[:2]
    rendered.maps["signed"] = pictures.signed_map(blocks.relative, blocks.beyond, metrics.BLOCK, size, 0.25)
    shown = [output / "images" / f"{name}.npy" for name in (rendered.engine, "reference")]
    if metrics.has_flip() and all(path.exists() for path in shown):
        figures["flip"], rendered.maps["flip"] = metrics.flip(*(np.load(path) for path in shown))
    rendered.figures = figures
    rendered.passes = passes_of(rendered, truth, output)


def passes_of(rendered: Rendered, truth: Reference, output: Path) -> dict[str, dict]:
    """Figures of each pass that both have."""
    path = output / rendered.steps[-1]["file"].replace(".exr", "_passes.exr")
    if not truth.passes or not path.exists():
        return {}
    found = {}
    for name, mine in pictures.read_passes(path).items():
        theirs = truth.passes.get(name)
        if theirs is None or theirs.shape != mine.shape:
            continue
        both = np.isfinite(mine).all(-1) & np.isfinite(theirs).all(-1) & (np.abs(theirs) < 1e9).all(-1)
        mine, theirs = mine[both].astype(np.float64), theirs[both].astype(np.float64)
        scale = float((theirs**2).mean()) if theirs.size else 0.0
        error = float(((mine - theirs) ** 2).mean()) if theirs.size else 0.0
        found[name] = {
            "mean": float(mine.mean()) if mine.size else 0.0,
            "reference_mean": float(theirs.mean()) if theirs.size else 0.0,
            "relative_mse": error / scale if scale > 0 else error,
        }
    return found


def compare(plan: Plan, watcher: Watcher) -> Comparison:
    return Run(plan, watcher).go()
