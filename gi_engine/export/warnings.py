"""What went wrong but did not stop the export: one message per kind of trouble, naming the objects it struck.

No bpy: callers hand in names.
"""

from __future__ import annotations

NAMES_SHOWN = 5


class Warnings:
    """Collects messages; those of one kind are merged into one that lists the names."""

    def __init__(self):
        self._names: dict[str, list[str]] = {}

    def add(self, text: str, name: str = "") -> None:
        """Notes `text`, said of `name` (an object, material, …) where one is to blame."""
        names = self._names.setdefault(text, [])
        if name and name not in names:
            names.append(name)

    def messages(self) -> list[str]:
        """One line per kind: "name, name and 3 more: text"."""
        return [f"{listed(names)}: {text}" if names else text for text, names in self._names.items()]


def listed(names: list[str]) -> str:
    more = len(names) - NAMES_SHOWN
    shown = ", ".join(f'"{name}"' for name in names[:NAMES_SHOWN])
    return f"{shown} and {more} more" if more > 0 else shown
