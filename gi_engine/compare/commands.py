"""`gi-engine compare`, `series` and `parity`: from arguments to files. What they share with other commands is in cli.py."""

from __future__ import annotations

import importlib.util
import json
import shutil
from pathlib import Path

from .. import control, native
from ..arguments import ArgumentError, check_file
from ..control import Control, Progress
from ..display import display_on
from ..output import OutputError
from . import parity, report, runner, summary
from . import plan as plans
from .child import Cancelled

DONE, FAILED, CANCELLED = 0, 1, 130


def compare_command(arguments, out, err) -> int:
    from ..cli import controlled, interruptible

    plan = plan_of(arguments)
    wishes = Control()
    with controlled(wishes, err), interruptible(wishes), display_on(err) as display:
        result = runner.compare(plan, Teller(display, err))
        page = report.write(result)
        return outcome(result, page, display, (out, err))


def outcome(result: runner.Comparison, page: Path, display, streams) -> int:
    out, err = streams
    display.say(report.summary(result), out)
    display.say(f"{page}", out)
    if result.cancelled:
        display.say("gi-engine: cancelled; the report has what was finished", err)
        return CANCELLED
    failed = [r for r in result.engines if r.error]
    for rendered in failed:
        display.say(f"gi-engine: {rendered.label}: {rendered.error}", err)
    return FAILED if failed or result.reference is None else DONE


def series_command(arguments, out, err) -> int:
    from ..cli import controlled, interruptible

    missing = [name for name in ("OpenEXR", "PIL") if importlib.util.find_spec(name) is None]
    if missing:
        raise ArgumentError(f"series needs the Python packages OpenEXR and pillow; not there: {', '.join(missing)}")
    from .series import SHEET, series, steps

    native.module()
    engines = list(dict.fromkeys(step.engine for step in steps()))
    file = scene_file(arguments)
    plan = plans.Plan(file, engines, made(arguments.output), frame=arguments.frame, **limits_of(arguments))
    wishes = Control()
    with controlled(wishes, err), interruptible(wishes), display_on(err) as display:
        try:
            finished = series(plan, Teller(display, err))
        except Cancelled:
            display.say("gi-engine: cancelled; what was finished is there", err)
            return CANCELLED
        display.say(f"{plan.output / SHEET}", out)
    return FAILED if any(step.error for step in finished) else DONE


def parity_command(arguments, out, err) -> int:
    from ..cli import controlled, interruptible

    survey = survey_of(arguments)
    wishes = Control()
    with controlled(wishes, err), interruptible(wishes), display_on(err) as display:
        rows, cancelled = parity.run(survey, Teller(display, err))
        if rows:
            display.say(f"{summary.counts(rows)}\n{survey.output / 'parity.html'}", out)
        if cancelled:
            display.say("gi-engine: cancelled; the same command goes on where it was", err)
            return CANCELLED
    return FAILED if any(row.get("error") for row in rows) else DONE


def survey_of(arguments) -> parity.Survey:
    """Raises ArgumentError, OutputError."""
    native.module()
    try:
        engine, scenes = plans.find_engine(arguments.engine), parity.find_scenes(arguments.folders)
        notes = json.loads(arguments.notes.read_text(encoding="utf-8")) if arguments.notes else {}
    except plans.PlanError as error:
        raise ArgumentError(str(error)) from error
    except (OSError, ValueError) as error:
        raise ArgumentError(f'--notes: "{arguments.notes}" cannot be read: {error}') from error
    survey = parity.Survey(scenes, made(arguments.output), engine, longest=arguments.size, limit=arguments.limit)
    survey.samples, survey.seconds = (0 if arguments.time else arguments.samples or 64), arguments.time or 0.0
    survey.threads, survey.notes = arguments.threads or 0, notes
    if arguments.fresh:
        shutil.rmtree(survey.output / "scenes", ignore_errors=True)
    return survey


class Teller(runner.Watcher):
    """To the terminal."""

    def __init__(self, display, err):
        self.display, self.err = display, err
        self.title = None

    def progress(self, fraction: float, text: str) -> None:
        title, _, words = text.partition(": ")
        if title != self.title:
            self.title = title
            self.display.begin(title)
        self.display.update(Progress(stage=words or "…", fraction=fraction))

    def say(self, text: str) -> None:
        self.display.say(f"gi-engine: {text}", self.err)

    def stopped(self) -> bool:
        return control.cancelled()


def plan_of(arguments) -> plans.Plan:
    """Raises ArgumentError, OutputError."""
    native.module()
    try:
        return plans.Plan(
            file=scene_file(arguments),
            engines=plans.find_engines(arguments.engines),
            output=made(arguments.output),
            reference=plans.find_reference(arguments.reference),
            until=getattr(arguments, "until_error", None) or 0.0,
            region=getattr(arguments, "region", None),
            frame=getattr(arguments, "frame", None),
            **limits_of(arguments),
        )
    except plans.PlanError as error:
        raise ArgumentError(str(error)) from error


def limits_of(arguments) -> dict:
    """Fields of Plan that all three commands have."""
    free = not arguments.samples and not getattr(arguments, "until_error", None)
    return {
        "seconds": arguments.time or (plans.DEFAULT_SECONDS if free else 0.0),
        "samples": arguments.samples or 0,
        "reference_seconds": arguments.reference_time or 0.0,
        "reference_samples": arguments.reference_samples or 0,
        "resolution": arguments.resolution,
        "threads": arguments.threads or 0,
        "limit": arguments.limit,
        "cache": arguments.cache,
    }


def scene_file(arguments) -> Path:
    if arguments.file is None:  # inside Blender: what is open
        import bpy

        if not bpy.data.filepath:
            raise ArgumentError("what is open has no file; name a .blend")
        arguments.file = Path(bpy.data.filepath)
    check_file(arguments)
    return arguments.file


def made(folder: Path) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f'output folder "{folder}" cannot be made: {error.strerror}') from error
    return folder
