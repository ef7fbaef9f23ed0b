"""What a render takes over from those before it, from the last frame or from a file, and what it hands on. No bpy.

What was kept of another scene is refused with the reason; of a scene in which objects changed, what lies near them is left out, for
integrators that keep things by place.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import content, kept_file, native
from .content import Content
from .kept_file import KeptFile, KeptFileError
from .scene_data import Scene, Settings

BOUNDS = "bounds"  # the table of Content.bounds in a file


class KeepingError(RuntimeError):
    """A file that cannot be used, where the render is to stop then. The message names the file and the reason."""


@dataclass
class Kept:
    content: Content
    tables: dict[str, np.ndarray]
    path: Path | None  # of the file that holds it or may be written


Memory = dict  # of Kept, by scene and view layer


class Keeping:
    """Of one render: `tables` is what it takes over, None for nothing. `messages` and `warnings` are for the user."""

    def __init__(self, scene: Scene, settings: Settings, memory: Memory, key, path: Path | None):
        self.descriptor = next(d for d in native.integrators() if d["id"] == settings.integrator)
        self.memory, self.key, self.path = memory, key, path
        self.tables: dict[str, np.ndarray] | None = None
        self.steady = False  # what the last frame showed is shown the same
        self.messages: list[str] = []
        self.warnings: list[str] = []
        self.content = content.content_of(scene, settings)
        self.in_file: dict[str, np.ndarray] | None = None  # tables that the file holds for the scene as it is
        if not self.from_memory() and path is not None:
            self.from_file(settings.kept_misfit)

    def from_memory(self) -> bool:
        kept = self.memory.get(self.key)
        if kept is None:
            return False
        reason = self.adopt(kept)
        if reason:
            self.messages.append(f"nothing is kept of the last render: {reason}")
            return False
        self.path = kept.path if self.path is not None else None
        self.steady = True
        return True

    def from_file(self, misfit: str) -> None:
        try:
            if not self.path.parent.is_dir():
                raise KeptFileError(self.path, "cannot be written: there is no such folder", foreign=True)
            if not self.path.exists():
                return
            reason = self.adopt(read_kept(self.path, self.descriptor))
            if reason:
                raise KeptFileError(self.path, f"does not fit the scene: {reason}")
        except KeptFileError as error:
            if misfit == "STOP":
                raise KeepingError(str(error)) from error
            replaces = misfit == "REPLACE" and not error.foreign
            fate = "it is replaced" if replaces else "it is left as it is, and rendered without"
            self.warnings.append(f"{error}; {fate}")
            if not replaces:
                self.path = None

    def adopt(self, kept: Kept) -> str:
        """Takes over what holds; returns the reason where nothing does."""
        change = content.compare(kept.content, self.content)
        if change.names and not self.descriptor["kept_by_place"]:
            change.reason = f'object "{change.names[0]}" has changed'
        if change.reason:
            return change.reason
        self.tables = kept.tables
        if not change.names:
            self.in_file = kept.tables
        else:
            self.tables = {name: t[far(change.boxes, t)] for name, t in kept.tables.items()}
            dropped = count_rows(kept.tables) - count_rows(self.tables)
            more = f" and {len(change.names) - 1} more" if len(change.names) > 1 else ""
            self.messages.append(f'{dropped} records near "{change.names[0]}"{more} are dropped: it has changed')
        return ""

    def hand_on(self, tables: dict[str, np.ndarray]) -> None:
        """After the render. Raises KeptFileError where the file cannot be written."""
        self.memory[self.key] = Kept(self.content, tables, self.path)
        if self.path is not None and count_rows(tables) > 0 and not same(self.in_file, tables):
            write_kept(self.path, self.descriptor, self.memory[self.key])
            self.messages.append(f'"{self.path}": {count_rows(tables)} records')


def keeps(settings: Settings) -> bool:
    """Whether the integrator has anything to keep, and is wanted to."""
    descriptor = next((d for d in native.integrators() if d["id"] == settings.integrator), None)
    return bool(descriptor and descriptor["kept_version"] and (settings.keep or settings.kept_file))


def count_rows(tables: dict[str, np.ndarray]) -> int:
    return sum(len(table) for table in tables.values())


def far(boxes: np.ndarray, table: np.ndarray) -> np.ndarray:
    return content.far_from(boxes, table[:, :3], table[:, 3:6])


def same(old: dict[str, np.ndarray] | None, new: dict[str, np.ndarray]) -> bool:
    return old is not None and old.keys() == new.keys() and all(np.array_equal(old[name], new[name]) for name in old)


def read_kept(path: Path, descriptor: dict) -> Kept:
    file = kept_file.read(path, descriptor["id"], descriptor["kept_version"])
    objects = {name: tuple(value) for name, value in file.notes["objects"].items()}
    return Kept(Content(file.notes["everywhere"], objects, file.tables.pop(BOUNDS)), file.tables, path)


def write_kept(path: Path, descriptor: dict, kept: Kept) -> None:
    notes = {"everywhere": kept.content.everywhere, "objects": kept.content.objects}
    tables = {BOUNDS: kept.content.bounds, **kept.tables}
    kept_file.write(path, KeptFile(descriptor["id"], descriptor["kept_version"], notes, tables))
