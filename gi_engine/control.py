"""What whoever starts a render from outside Blender's UI wants of it: settings to override, a way to watch, a way to stop.

The command line sets `current`; the engine asks it. No bpy in here. Where nobody set it, rendering is Blender's own affair.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

from .scene_data import Scene, Settings


class RenderError(RuntimeError):
    """The scene could not be read or rendered; the message names what is wrong."""


@dataclass
class Progress:
    """The state of a running render, as the engine tells it after every poll."""

    stage: str = ""  # what is being done where no pass is running: "Export", "Build BVH", …
    fraction: float = 0.0  # 0..1 of whichever target (samples, time, noise) comes first
    passes: int = 0  # passes in the film
    rays: int = 0  # traced so far
    seconds: float = 0.0  # of sampling; start-up not counted
    seconds_left: float | None = None  # None while nobody can say
    noise: float | None = None  # 95th percentile of the relative standard error, where it is measured
    note: str = ""  # what the integrator has to say of itself


@dataclass
class Control:
    """One caller's wishes. `overrides` are fields of Settings by name; `parameters` go to the integrator by name."""

    overrides: dict = field(default_factory=dict)
    parameters: dict = field(default_factory=dict)
    on_progress: Callable[[Progress], None] | None = None
    # Given each view layer's export instead of rendering it.
    inspect: Callable[[str, Scene, Settings], None] | None = None
    # Set by a signal handler; the engine stops after the poll that sees it and keeps what it has.
    cancelled: bool = False
    # What one frame keeps for the next (keeping.Memory), and Cameras of frames to come.
    kept: dict = field(default_factory=dict)
    path: list = field(default_factory=list)
    last: Progress = field(default_factory=Progress)
    warnings: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)


current: Control | None = None


def apply(settings: Settings) -> Settings:
    """The scene's settings with the caller's overrides over them."""
    if current is None:
        return settings
    return replace(settings, **current.overrides, parameters={**settings.parameters, **current.parameters})


def report(progress: Progress) -> None:
    if current is not None:
        current.last = progress
        if current.on_progress is not None:
            current.on_progress(progress)


def cancelled() -> bool:
    return current is not None and current.cancelled


def inspected(view_layer: str, scene: Scene, settings: Settings) -> bool:
    """True where the caller only wanted to look at what would be rendered, and has."""
    if current is None or current.inspect is None:
        return False
    current.inspect(view_layer, scene, settings)
    return True


def warn(message: str) -> None:
    """A warning that names the thing; the engine reports it to Blender as well."""
    if current is not None and message not in current.warnings:
        current.warnings.append(message)


def fail(message: str) -> None:
    """The message of a render that failed; the engine reports it to Blender as well."""
    if current is not None:
        current.errors.append(message)
