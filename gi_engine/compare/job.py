"""A comparison of the scene that is open, behind Blender's back: a copy of the file, unsaved changes included, is compared on by a process of
its own (one.py) while Blender goes on. Leaves out buttons (ui/compare.py)."""

from __future__ import annotations

import json
import math
import shutil
import tempfile
import threading
from pathlib import Path

import bpy

from .. import caches, machine, native
from ..output import OutputError
from .child import Cancelled, Child, ChildFailed
from .plan import CYCLES, Plan, PlanError, find_reference, to_json

REPORT = "report.html"


class JobError(RuntimeError):
    """There is nothing to show; the message says why."""


class Job:
    """Begins when it is made. `finish` or `cancel` ends it. Raises OutputError, PlanError, JobError."""

    def __init__(self, scene):
        settings = scene.gi_engine.compare
        engines = [name for name in (*(d["id"] for d in native.integrators()), CYCLES) if name in settings.engines]
        if not engines:
            raise PlanError("no engine is chosen")
        reference = reference_of(settings)
        self.fraction, self.text, self.warnings, self.error = 0.0, "", [], ""
        self.folder, self.fresh = result_folder(settings.folder)
        # What is here becomes the result at once, or vanishes.
        self.work = Path(tempfile.mkdtemp(prefix=".gi-engine-", dir=self.folder))
        try:
            self.copy = save_copy()
        except JobError:
            self.leave()
            raise
        plan = Plan(self.copy, engines, self.work, reference, seconds=settings.seconds)
        # The process has the preferences as they were saved, which need not be those of now.
        plan.cache = caches.folder(caches.REFERENCES)
        plan.threads = machine.current.threads if scene.render.threads_mode != "FIXED" else 0
        self.stopping = threading.Event()
        self.thread = threading.Thread(target=self.run, args=(to_json(plan),), daemon=True)
        self.thread.start()

    def run(self, plan: dict) -> None:
        """In the thread, without bpy."""
        try:
            with Child(self.stopping.is_set, "one") as child:
                child.ask("compare", math.inf, self.hear, plan=plan)
        except Cancelled:
            self.error = "cancelled"
        except (ChildFailed, OSError) as error:
            self.error = str(error)

    def hear(self, said: dict) -> None:
        self.fraction, self.text = said["fraction"], said["text"]

    def done(self, timeout: float = 0.0) -> bool:
        self.thread.join(timeout)
        return not self.thread.is_alive()

    def finish(self) -> dict:
        """Of a job that is done: what report.json says. Raises JobError."""
        if self.error:
            self.leave()
            raise JobError(f"nothing was compared: {self.error}")
        try:
            for made in self.work.iterdir():
                goal = self.folder / made.name
                if goal.is_dir():
                    shutil.rmtree(goal)
                made.replace(goal)
            self.fresh = False
        except OSError as error:
            raise JobError(f'"{error.filename}" cannot be written: {error.strerror}') from error
        finally:
            self.leave()
            caches.trim()
        return json.loads((self.folder / "report.json").read_text(encoding="utf-8"))

    def cancel(self) -> None:
        """Ends the processes and leaves nothing behind."""
        self.stopping.set()
        self.thread.join()
        self.leave()

    def leave(self) -> None:
        shutil.rmtree(self.work, ignore_errors=True)
        shutil.rmtree(session_folder("scene"), ignore_errors=True)
        if self.fresh:
            shutil.rmtree(self.folder, ignore_errors=True)


def reference_of(settings) -> str | Path:
    if settings.reference != "FILE":
        return settings.reference
    path = bpy.path.abspath(settings.reference_file)
    if not path.lower().endswith(".exr"):
        raise PlanError(f'reference "{path}": the name must end in .exr')
    return find_reference(path)


def result_folder(chosen: str) -> tuple[Path, bool]:
    """And whether it was made now. Raises OutputError."""
    if not chosen:
        return session_folder("report"), False
    if chosen.startswith("//") and not bpy.data.filepath:
        raise OutputError(f'"{chosen}" is beside the .blend file, which was never saved')
    folder = Path(bpy.path.abspath(chosen))
    fresh = not folder.exists()
    try:
        folder.mkdir(exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f'output folder "{folder}" cannot be used: {error.strerror}') from error
    return folder, fresh


def session_folder(name: str) -> Path:
    """Lasts until Blender is closed."""
    folder = Path(bpy.app.tempdir) / "gi_engine_compare" / name
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def save_copy() -> Path:
    """What is open, as a file elsewhere whose relative paths lead where they did. Raises JobError."""
    path = session_folder("scene") / (Path(bpy.data.filepath).name or "untitled.blend")
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, relative_remap=True, compress=False)
    except RuntimeError as error:
        raise JobError(f"the scene cannot be copied: {str(error).strip()}") from error
    return path


def pictures_of(facts: dict, folder: Path) -> dict[str, Path]:
    """Name of an image → EXR: what GI Engine made, Cycles' or else the reference last."""
    found = {engine["label"]: folder / engine["picture"] for engine in facts["engines"] if engine["picture"]}
    cycles = next((e["label"] for e in facts["engines"] if e["engine"] == CYCLES and e["picture"]), None)
    if cycles:
        found[cycles] = found.pop(cycles)
    elif facts["reference"]:
        found[f"Reference ({facts['reference']['name']})"] = folder / "reference.exr"
    return found
