"""What of this machine the engine may use, whatever the scene. The add-on's preferences set `current`; where nobody has set them, as on the
command line, the defaults hold. No bpy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

GIB = 1 << 30


@dataclass(frozen=True)
class Machine:
    threads: int = 0  # 0: all; a scene that fixes their number has its own way
    cache_folder: Path | None = None  # None: the system's (caches.py)
    cache_limit: int = 4 * GIB  # bytes; 0: none


current = Machine()
