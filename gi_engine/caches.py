"""The folder of caches: references that comparisons have rendered, and what integrators keep in files named without a folder. Beyond a limit
what was not used for longest is dropped. No bpy. Touches nothing that is not ours, wherever the folder may lie."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

from . import kept_file, log, machine

REFERENCES, LIGHT = "references", "light"
KEY = re.compile(r"[0-9a-f]{24}")  # names of references' folders


@dataclass(frozen=True)
class Entry:
    """One reference's folder or one file."""

    path: Path
    size: int  # bytes
    used: float  # seconds since 1970, of the last time


def system_folder() -> Path:
    """Where caches lie by the habits of the system."""
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or Path.home())
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / "gi-engine"


def folder(kind: str) -> Path:
    return (machine.current.cache_folder or system_folder()) / kind


def light_file(name: str) -> Path:
    """Of a file that is named without its folder. The folder is made."""
    with contextlib.suppress(OSError):  # who writes the file will say so
        folder(LIGHT).mkdir(parents=True, exist_ok=True)
    return folder(LIGHT) / name


def mark_used(path: Path) -> None:
    with contextlib.suppress(OSError):
        os.utime(path)


def entries() -> list[Entry]:
    """The last used first."""
    found = [entry_of(path) for path in listed(folder(REFERENCES)) if KEY.fullmatch(path.name) and path.is_dir()]
    found += [entry_of(path) for path in listed(folder(LIGHT)) if is_ours(path)]
    return sorted(found, key=lambda entry: entry.used, reverse=True)


def listed(path: Path) -> list[Path]:
    try:
        return list(path.iterdir())
    except OSError:
        return []


def is_ours(path: Path) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(len(kept_file.MAGIC)) == kept_file.MAGIC
    except OSError:
        return False


def entry_of(path: Path) -> Entry:
    size = 0
    for file in (path, *(path.rglob("*") if path.is_dir() else ())):
        with contextlib.suppress(OSError):
            size += file.stat().st_size if file.is_file() else 0
    try:
        return Entry(path, size, path.stat().st_mtime)
    except OSError:
        return Entry(path, 0, 0.0)


def trim(limit: int | None = None) -> list[Entry]:
    """Drops what was not used for longest until no more than `limit` bytes (the machine's, unless told otherwise; 0: no limit) are left.
    The last used stays, however large. Returns what went."""
    limit = machine.current.cache_limit if limit is None else limit
    if not limit:
        return []
    dropped, total = [], 0
    for number, entry in enumerate(entries()):
        total += entry.size
        if total > limit and number > 0:
            drop(entry)
            dropped.append(entry)
            total -= entry.size
    return dropped


def clear() -> list[Entry]:
    found = entries()
    for entry in found:
        drop(entry)
    return found


def drop(entry: Entry) -> None:
    try:
        shutil.rmtree(entry.path) if entry.path.is_dir() else entry.path.unlink()
        log.logger.info('"%s" is dropped from the cache (%s)', entry.path, words(entry.size))
    except OSError as error:
        log.logger.warning('"%s" cannot be dropped from the cache: %s', entry.path, error.strerror)


def words(size: int) -> str:
    """Bytes for people: 1.5 GB."""
    value = float(size)
    for unit in ("bytes", "KB", "MB"):
        if value < 1024:
            return f"{value:.0f} {unit}" if unit == "bytes" or value >= 10 else f"{value:.1f} {unit}"
        value /= 1024
    return f"{value:.1f} GB"
