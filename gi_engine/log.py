"""What the engine says on the console, beside what Blender reports: as much as the preferences ask for. No bpy."""

from __future__ import annotations

import logging
import sys

logger = logging.getLogger("gi_engine")
LEVELS = ("WARNING", "INFO", "DEBUG")
FORMAT = "%(asctime)s GI Engine: %(message)s"


class Console(logging.StreamHandler):
    """On what standard error is at the time, for it is turned elsewhere now and then."""

    def __init__(self):
        super().__init__(sys.stderr)
        self.setFormatter(logging.Formatter(FORMAT, "%H:%M:%S"))

    def emit(self, record) -> None:
        self.stream = sys.stderr
        super().emit(record)


_console = Console()


def open_console(level: str = LEVELS[0]) -> None:
    """Saying it twice is saying it once."""
    logger.addHandler(_console)
    logger.setLevel(level)
    logger.propagate = False


def close_console() -> None:
    logger.removeHandler(_console)
    logger.setLevel(logging.NOTSET)
    logger.propagate = True
