"""What materials were rendered as something else, by the last export: for the material tab and `gi-engine info`. No bpy."""

from __future__ import annotations

from .scene_data import Program

_known: dict[str, list[str]] = {}  # by material


def note(programs: list[Program]) -> None:
    """Remembers what an export found; materials that it had nothing to say of are forgotten."""
    for program in programs:
        _known.pop(program.name, None)
    for program in programs:
        if program.approximated:
            _known[program.name] = list(program.approximated)


def of(name: str) -> list[str]:
    """One text for each node of a material that is approximated."""
    return _known.get(name, [])


def heading(texts: list[str]) -> str:
    return f"{len(texts)} node{'' if len(texts) == 1 else 's'} approximated"
