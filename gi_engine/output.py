"""Where pictures go: names, frame numbers, and files that appear whole or not at all. No bpy, no pixels."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from pathlib import Path

SUFFIXES = (".png", ".exr")


class OutputError(ValueError):
    """The output cannot be written; the message names the file or folder."""


def check_suffix(path: Path) -> None:
    if path.suffix.lower() not in SUFFIXES:
        raise OutputError(f'output "{path}": the name must end in {" or ".join(SUFFIXES)}')


def numbered(path: Path, frame: int, always: bool) -> Path:
    """The name of one frame's file: '#'s hold the number; without any, it goes before the suffix where `always` asks."""
    marks = list(re.finditer("#+", path.stem))
    if marks:
        start, end = marks[-1].span()
        return path.with_name(path.stem[:start] + digits(frame, end - start) + path.stem[end:] + path.suffix)
    return path.with_name(f"{path.stem}{digits(frame, 4)}{path.suffix}") if always else path


def digits(frame: int, width: int) -> str:
    """Blender's way: the sign comes on top of the width."""
    return f"{'-' if frame < 0 else ''}{abs(frame):0{width}d}"


class Target:
    """A folder beside the output, to write in; `publish` then renames what is in it. Made before rendering starts,
    so that a folder that is missing or read-only is known at once."""

    def __init__(self, path: Path):
        folder = path.parent
        if path.is_dir():
            raise OutputError(f'output "{path}" is a folder')
        if not folder.is_dir():
            raise OutputError(f'output folder "{folder}" does not exist')
        try:
            self.folder = Path(tempfile.mkdtemp(prefix=".gi-engine-", dir=folder))
        except OSError as error:
            raise OutputError(f'output folder "{folder}" is not writable: {error.strerror}') from error

    def __enter__(self) -> Target:
        return self

    def __exit__(self, *_) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)

    def publish(self, path: Path, stem: str) -> list[Path]:
        """Renames each file that was written as `stem`… (several views add a suffix of their own) to `path`'s name."""
        published = []
        for written in sorted(self.folder.iterdir()):
            goal = path.with_name(path.stem + written.stem.removeprefix(stem) + path.suffix)
            try:
                os.replace(written, goal)
            except OSError as error:
                raise OutputError(f'output "{goal}" cannot be written: {error.strerror}') from error
            published.append(goal)
        return published
