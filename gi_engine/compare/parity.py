"""One engine against Cycles on many .blend files, each in a process of its own: a crash or a hang is one row. What was finished is kept, so
that a run goes on where it was stopped. What the rows say is in summary.py."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from dataclasses import dataclass, field
from pathlib import Path

from .. import native
from ..output import Target
from . import report, summary
from .child import Cancelled, Child, ChildFailed
from .plan import CYCLES, Plan, PlanError, engine_label, to_json
from .runner import Watcher

ROW = "row.json"
VERSION = 1  # of what rows mean; another one renders anew
# What differs is rendered again with this many times the samples, and that counts: rare bright samples can make noise look smaller than it is.
CONFIRM = 4


@dataclass
class Survey:
    """What is asked for, of every scene."""

    scenes: dict[str, Path]
    output: Path
    engine: str = "path"
    samples: int = 64  # of each of two pictures, by Cycles too; 0: by seconds
    seconds: float = 0.0
    longest: int = 128  # pixels along the longer side
    threads: int = 0
    limit: float = 1800.0  # seconds of one scene in all
    notes: dict[str, str] = field(default_factory=dict)  # what is known of a scene, by name


def find_scenes(folders: list[Path]) -> dict[str, Path]:
    """By name: where they lie in their folder. Raises PlanError."""
    found: dict[str, Path] = {}
    for folder in folders:
        if not folder.exists():
            raise PlanError(f'"{folder}" is not there')
        files = sorted(folder.rglob("*.blend")) if folder.is_dir() else [folder]
        top = folder if folder.is_dir() else folder.parent
        for path in files:
            name = path.relative_to(top).with_suffix("").as_posix()
            if name in found and found[name] != path:
                name = f"{top.resolve().name}/{name}"
            while name in found and found[name] != path:
                name += "'"
            found[name] = path
    if not found:
        raise PlanError(f"no .blend file in {', '.join(map(str, folders))}")
    return found


def run(survey: Survey, watcher: Watcher) -> tuple[list[dict], bool]:
    """Rows in order, and whether it was cancelled. The tables are written after each scene."""
    rows, cancelled = [], False
    folders = folders_of(survey)
    for number, (name, path) in enumerate(survey.scenes.items()):
        tell = lambda part, text, number=number, name=name: watcher.progress(  # noqa: E731
            (number + part) / len(survey.scenes), f"{name}: {text}"
        )
        folder = survey.output / folders[name]
        row = kept(survey, path, folder)
        if row is None:
            try:
                row = compare(survey, path, folder, watcher.stopped, tell)
            except Cancelled:
                cancelled = True
                break
            put_row(folder, row)
            watcher.say(f"{name}: {summary.verdict(row)[1]}")
        note = {"note": survey.notes[name]} if name in survey.notes else {}
        rows.append(row | note | {"name": name, "folder": folders[name]})
        write(survey, rows)
    return rows, cancelled


def folders_of(survey: Survey) -> dict[str, str]:
    """A folder's name for each scene, no two the same."""
    found: dict[str, str] = {}
    for name in survey.scenes:
        plain = re.sub(r"[^\w.-]+", "_", name)
        while f"scenes/{plain}" in found.values():
            plain += "_"
        found[name] = f"scenes/{plain}"
    return found


def compare(survey: Survey, path: Path, folder: Path, stopped, tell) -> dict:
    """A row. Raises Cancelled."""
    row = {"key": key_of(survey, path), "engine": survey.engine}
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    tell(0.0, "…")
    try:
        for times in (1, CONFIRM):
            plan = plan_of(survey, path, folder, times)
            with Child(stopped, "one") as child:
                child.ask(
                    "compare", survey.limit, lambda said: tell(said["fraction"], said["text"]), plan=to_json(plan)
                )
            found = row | facts_of(json.loads((folder / "report.json").read_text()), path) | {"times": times}
            if summary.verdict(found)[0] not in (summary.DIFFERS, summary.UNSUPPORTED):
                break
        return found
    except (ChildFailed, OSError) as error:
        return row | {"error": str(error)}


def plan_of(survey: Survey, path: Path, folder: Path, times: int) -> Plan:
    """Two pictures by each engine: what the two have in common is no noise."""
    return Plan(
        file=path,
        engines=[survey.engine],
        output=folder,
        reference=CYCLES,
        samples=times * survey.samples,
        seconds=times * survey.seconds,
        reference_samples=2 * times * survey.samples,
        reference_seconds=2 * times * survey.seconds,
        reference_pieces=2,
        steps=1,
        longest=survey.longest,
        threads=survey.threads,
        limit=survey.limit,
        cache=survey.output / "references",
        neutral=True,
    )


def facts_of(facts: dict, path: Path) -> dict:
    """What a row takes from a report. Files beside the scene are named without their folder."""
    engine, beside = facts["engines"][0], f"{path.resolve().parent}{os.sep}"
    messages = [message.replace(beside, "") for message in facts["unsupported"]]
    found = {"blender": facts["blender"], "unsupported": messages}
    if engine["error"] or not facts["reference"]:
        missing = next((w for w in facts["warnings"] if w.startswith("no reference")), "")
        return found | {"error": engine["error"] or f"Cycles: {missing.removeprefix('no reference: ').split(';')[0]}"}
    seconds = {"seconds": engine["seconds"], "reference_seconds": facts["reference"]["seconds"]}
    return found | {name: engine.get(name) for name in summary.FIGURES} | seconds


def key_of(survey: Survey, path: Path) -> str:
    """A digest of what the row depends on: the file, the settings, the program."""
    digest = hashlib.sha256(path.read_bytes())
    settings = (survey.engine, survey.samples, survey.seconds, survey.longest, survey.threads, VERSION)
    digest.update(repr(settings).encode() + Path(native.module()._core.__file__).read_bytes())
    return digest.hexdigest()[:24]


def kept(survey: Survey, path: Path, folder: Path) -> dict | None:
    """The row of an earlier run, where nothing has changed since; what failed is tried anew."""
    try:
        row = json.loads((folder / ROW).read_text())
        return row if row["key"] == key_of(survey, path) and not row.get("error") else None
    except (OSError, ValueError, KeyError):
        return None


def put_row(folder: Path, row: dict) -> None:
    with Target(folder / ROW) as target:
        (target.folder / "file.json").write_text(json.dumps(row, ensure_ascii=False))
        target.publish(folder / ROW, "file")


def write(survey: Survey, rows: list[dict]) -> Path:
    """parity.md, .csv, .json, .html. Returns the page."""
    words = introduction(survey, rows)
    page = survey.output / "parity.html"
    report.put(page.with_suffix(".md"), summary.markdown(rows, words))
    report.put(page.with_suffix(".csv"), summary.table(rows))
    report.put(page.with_suffix(".json"), json.dumps(rows, indent=1, ensure_ascii=False) + "\n")
    report.put(page, summary.page(rows, words, survey.output))
    return page


def introduction(survey: Survey, rows: list[dict]) -> list[str]:
    blenders = " and ".join(dict.fromkeys(row["blender"] for row in rows if row.get("blender"))) or "?"
    each = f"{survey.samples} samples a pixel" if survey.samples else f"{survey.seconds:g} s"
    return [
        f"Written by `gi-engine parity`: {engine_label(survey.engine)} against Cycles of Blender {blenders}, two pictures by each with "
        f"different seeds and {each}, {survey.longest} pixels along the longer side.",
        "Scenes are rendered as they are, but for filters that bias, adaptive sampling, clamping and denoising, which are off.",
        f"What differs is rendered again with {CONFIRM} times the samples, and that counts.",
        "Mean: ours over Cycles', all channels. Worst: the largest difference of a block of 8×8 pixels in standard errors; the limit is Student's t "
        "for all blocks together, and 1 % of a block counts as rounding.",
        "FLIP: the difference that is seen when flipping between the two, noise included: 0 none, 1 black and white.",
    ]
