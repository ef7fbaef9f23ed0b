"""The RenderEngine: what Blender calls, and how errors, progress and images get back to it."""

from __future__ import annotations

import contextlib
import math
import threading
import time
import traceback
from pathlib import Path

import bpy
import numpy as np

from . import caches, control, log, native, viewport
from .bake import BakeError, bake_for_blender, blender_folders
from .denoise import Stopped, denoise
from .display import duration
from .export import Exported, ExportError, export
from .keeping import Keeping, KeepingError, KeptFileError, keeps
from .passes import NOISY, aovs_of, contract_name, passes_of
from .session import RenderFailed, Session

WHOLE = 1 << 16  # begin_result clamps it to the border's size
PREVIEW_SAMPLES = 32
WINDOW = not bpy.app.background
# Seconds between what is told. Each status has the window draw the picture anew; without one, it is a line on the console.
STATUS_SECONDS = 0.5 if WINDOW else 5.0
SHOW_SECONDS, SHOW_SECONDS_LATER = 0.25, 3.0
USER_ERRORS = (BakeError, ExportError, KeepingError, RenderFailed, native.NativeMissing)

LEAVE_SECONDS = 10.0  # that a render has to stop when the add-on is switched off
SWITCHED_OFF = "the add-on is switched off"

# Said once in an animation, not once a frame.
_reported: set[str] = set()
# What the frames of an animation keep for one another, and Cameras of frames to come.
_kept: dict = {}
_path: list = []
# One entry for each render that is running, on threads of Blender's. Switching the add-on off has to end them first:
# Blender crashes when a class goes while its render runs.
_running: list[str] = []
_leaving = threading.Event()


class GIEngine(bpy.types.RenderEngine):
    bl_idname = "GI_ENGINE"
    bl_label = "GI Engine"
    bl_use_preview = True
    bl_use_shading_nodes_custom = False  # Blender's own shader nodes
    bl_use_eevee_viewport = True  # Material Preview
    bl_use_postprocess = True  # compositing and sequencer

    # Class attributes rather than __init__, whose arguments differ between versions.
    exported: Exported | None = None
    failure: Exception | None = None
    next_status: float = 0.0
    viewport: viewport.Viewport | None = None

    def update(self, data=None, depsgraph=None):
        # Blender holds still here (under its draw lock), so here is where the scene is read.
        self.exported, self.failure = None, None
        _running.append("export")
        try:
            if _leaving.is_set():  # the settings may be gone already
                raise RenderFailed(SWITCHED_OFF)
            self.update_stats("", "Exporting")
            control.report(control.Progress(stage="Export"))
            started = time.monotonic()
            self.exported = self.export(depsgraph)
            log.logger.debug("exported in %.2f s", time.monotonic() - started)
        except Exception as error:  # told in render(), which must run: a result that is never begun crashes Blender
            self.failure = error
        finally:
            _running.pop()

    def export(self, depsgraph) -> Exported:
        overrides = control.current.overrides if control.current else {}
        found = export(
            depsgraph, native.integrators(), self, (self.resolution_x, self.resolution_y), overrides.get("integrator")
        )
        found.settings = control.apply(found.settings)
        if self.is_preview:
            found.settings.samples = min(found.settings.samples, PREVIEW_SAMPLES)
        return found

    def render(self, depsgraph):
        _running.append(depsgraph.view_layer.name)
        try:
            for view in [view.name for view in self.views()] or [""]:
                self.render_view(depsgraph, view)
        finally:
            _running.pop()

    def views(self) -> list:
        result = self.get_result()
        return list(result.views) if result else []

    def render_view(self, depsgraph, view: str) -> None:
        result = self.begin_result(0, 0, WHOLE, WHOLE, layer=depsgraph.view_layer.name, view=view)
        # Allocates the passes: saving an EXR crashes Blender where no result was ever merged.
        self.update_result(result)
        try:
            if self.failure:
                raise self.failure
            if view:
                self.active_view_set(view)
                self.exported = self.export(depsgraph)
            self.render_result(result, depsgraph)
            self.end_result(result)
        except Exception as error:
            self.end_result(result, cancel=True)
            self.fail(error)

    def render_result(self, result, depsgraph) -> None:
        scene, settings = self.exported.scene, self.exported.settings
        for message in self.exported.warnings:
            self.warn(message)
        if control.inspected(depsgraph.view_layer.name, scene, settings):
            return
        x0, y0, x1, y1 = scene.film.region
        if (x1 - x0, y1 - y0) != (result.resolution_x, result.resolution_y):
            raise RuntimeError(
                f"border is {x1 - x0}x{y1 - y0} pixels, Blender expects {result.resolution_x}x{result.resolution_y}"
            )
        self.update_stats("", "Building the scene")
        control.report(control.Progress(stage="Build"))
        started = time.monotonic()
        keeping = self.keeping(depsgraph) if keeps(settings) and not self.is_preview else None
        tables = keeping.tables if keeping else None
        path = (control.current.path if control.current else _path) if keeping and tables is None else ()
        with Session(scene, settings, kept=tables, path=path, steady=bool(keeping and keeping.steady)) as session:
            self.exported.scene = None  # the native side has taken what it needs
            log.logger.debug("%s; built in %.2f s", session.native_scene.embree, time.monotonic() - started)
            for message in session.warnings():
                self.warn(message)
            self.stream(session, result)
        if keeping:
            self.hand_on(keeping, session)

    def keeping(self, depsgraph) -> Keeping:
        """What this render takes over."""
        settings, scene, layer = self.exported.settings, depsgraph.scene, depsgraph.view_layer.name
        memory = control.current.kept if control.current else _kept
        path = kept_path(settings.kept_file)
        if path and sum(view_layer.use for view_layer in scene.view_layers) > 1:
            path = path.with_stem(f"{path.stem}-{bpy.path.clean_name(layer)}")
        keeping = Keeping(
            self.exported.scene, settings, memory if settings.keep else {}, (scene.name_full, layer), path
        )
        for message in keeping.warnings:
            self.warn(message)
        return keeping

    def hand_on(self, keeping: Keeping, session: Session) -> None:
        try:
            keeping.hand_on(session.native.kept())
            if keeping.path:
                caches.mark_used(keeping.path)
                caches.trim()
        except KeptFileError as error:
            self.warn(str(error))
        for message in keeping.messages:
            self.report({"INFO"}, message)

    def stream(self, session: Session, result) -> None:
        """Shows the image as it grows until it is done or the user has had enough."""
        started = shown = time.monotonic()
        while not session.wait():
            if _leaving.is_set():  # no picture, or an animation would write it and go on
                raise RenderFailed(SWITCHED_OFF)
            if self.stopped():
                session.native.cancel()
                break
            now = time.monotonic()
            if WINDOW and now - shown >= show_interval(now - started):
                self.show(session, result)
                shown = time.monotonic()
            self.tell(session.progress())
        self.show(session, result)
        progress = session.progress()
        log.logger.info(
            "%s: %s, %s threads: %s", result.layers[0].name, self.exported.settings.integrator,
            self.exported.settings.threads or "all", status_words(progress),
        )  # fmt: skip
        if self.exported.settings.denoising and progress["passes"] and not self.is_preview:
            self.denoise(session, result)
        self.next_status = 0.0
        self.tell(progress)
        for message in session.native.messages():
            self.report({"INFO"}, message)
        if progress["bad_samples"]:
            self.warn(f"{progress['bad_samples']} samples were not finite numbers and were left out")

    def stopped(self) -> bool:
        return _leaving.is_set() or self.test_break() or control.cancelled()

    def show(self, session: Session, result) -> None:
        aovs = dict(session.scene.film.aovs)
        for blender_pass in result.layers[0].passes:
            name = blender_pass.name if blender_pass.name in aovs else contract_name(blender_pass.name)
            if name:
                fill(blender_pass, session.read("Combined" if name == NOISY else name))
        self.update_result(result)

    def denoise(self, session: Session, result) -> None:
        """Of the finished picture: the pass Noisy Image stays as it is."""
        wishes = self.exported.settings.denoising
        self.update_stats("", "Denoising")
        guides = {guide: session.read(name) for guide, name in wishes.guides.items()}
        try:
            was_stopped = self.stopped()  # what is finished is denoised all the same
            picture, folders = session.read("Combined"), blender_folders()
            stopped = lambda: not was_stopped and self.stopped()  # noqa: E731
            clean = denoise(picture, guides, folders, wishes.quality, wishes.prefilter, stopped)
        except Stopped:
            return
        except RuntimeError as error:
            self.warn(f"{error}; the picture stays as it is")
            return
        if clean is None:
            self.warn("this Blender brings no denoiser: the picture stays as it is")
            return
        fill(result.layers[0].passes["Combined"], clean)
        self.update_result(result)

    def tell(self, progress: dict) -> None:
        left = progress["remaining"] if math.isfinite(progress["remaining"]) else None
        noise = progress["noise"] if math.isfinite(progress["noise"]) else None
        if time.monotonic() >= self.next_status:
            self.next_status = time.monotonic() + STATUS_SECONDS
            memory = progress["memory"] / 2**20
            self.update_progress(progress["fraction"])
            self.update_memory_stats(memory_used=memory, memory_peak=memory)
            self.update_stats("", status(progress, left, self.exported.settings.samples))
        control.report(
            control.Progress(
                stage=progress.get("stage") or "Render",
                fraction=progress["fraction"],
                passes=progress["passes"],
                rays=progress["rays"],
                seconds=progress["seconds"],
                seconds_left=left,
                noise=noise,
                note=progress.get("note", ""),
            )
        )

    def warn(self, message: str) -> None:
        control.warn(message)
        if message not in _reported and not self.is_preview:
            _reported.add(message)
            self.report({"WARNING"}, message)

    def fail(self, error: Exception) -> None:
        # Only report() makes the operator fail and keeps Blender from writing a file; error_set is for the window.
        message = describe(error)
        control.fail(message)
        if WINDOW:
            self.error_set(message)
        self.report({"ERROR"}, message)

    def view_update(self, context, depsgraph):
        try:
            self.viewport = self.viewport or viewport.Viewport(self)
            self.viewport.update(context, depsgraph)
        except Exception as error:
            self.update_stats("", describe(error))

    def view_draw(self, context, depsgraph):
        try:
            self.viewport = self.viewport or viewport.Viewport(self)
            self.viewport.draw(self, context, depsgraph)
        except Exception as error:
            self.update_stats("", describe(error))

    def __del__(self):
        with contextlib.suppress(ReferenceError):  # Blender's part of it is gone, as after a final render
            if self.viewport:
                self.viewport.close()
        with contextlib.suppress(AttributeError):  # not every version has one
            super().__del__()

    def bake(self, depsgraph, obj, pass_type, pass_filter, width, height):
        """Blender's own Bake button, once for each object and image. The active UV map is the one it bakes to."""
        _running.append("bake")
        # The name has to differ from call to call: the same one again would overwrite the first image.
        result = self.begin_result(0, 0, width, height, layer=f"bake {obj.name} {time.monotonic_ns()}")
        try:
            pixels, warnings = bake_for_blender(depsgraph, obj, pass_type, pass_filter, (width, height), self.stopped)
            for message in warnings:
                self.warn(message)
            combined = result.layers[0].passes["Combined"]
            combined.rect.foreach_set(np.ascontiguousarray(pixels[..., : combined.channels], np.float32).ravel())
            self.end_result(result)
        except Exception as error:
            self.end_result(result, cancel=True)
            self.fail(error)
        finally:
            _running.pop()

    def update_render_passes(self, scene=None, renderlayer=None):
        for p in (*passes_of(renderlayer, scene), *aovs_of(renderlayer)):
            self.register_pass(scene, renderlayer, p.blender_name, len(p.channels), p.channels, p.kind)


def kept_path(text: str) -> Path | None:
    """Of the scene's Cache File: what is named without a folder lies in the preferences' one."""
    if not text:
        return None
    return caches.light_file(text) if Path(text).name == text else Path(bpy.path.abspath(text))


def fill(blender_pass, pixels: np.ndarray) -> None:
    blender_pass.rect.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())


def describe(error: Exception) -> str:
    """One line for the user; what was not foreseen leaves its traceback on the console."""
    if isinstance(error, MemoryError):
        return "out of memory"
    if not isinstance(error, USER_ERRORS):
        traceback.print_exception(error)
        return f"internal error: {type(error).__name__}: {error}"
    return str(error)


def show_interval(elapsed: float) -> float:
    """Seconds until the picture is shown anew: seldom once it changes slowly, for showing costs the window time."""
    return min(max(SHOW_SECONDS, 0.1 * elapsed), SHOW_SECONDS_LATER)


def status(progress: dict, left: float | None, samples: int) -> str:
    """The line over the picture. Blender leaves its own figure of the memory out where there is one."""
    rate = progress["rays"] / progress["seconds"] * 1e-6 if progress["seconds"] > 0 else 0
    parts = [
        f"Mem:{progress['memory'] / 2**20:.0f}M",
        progress.get("stage") or f"Sample {progress['samples_per_pixel']:.0f}/{samples}",
        f"{rate:.1f} Mrays/s",
    ]
    if progress.get("note"):
        parts.append(progress["note"])
    if left is not None:
        parts.insert(0, f"Remaining {duration(left)}")
    return " | ".join(parts)


def status_words(progress: dict) -> str:
    """Of a render that has ended, for the log."""
    rate = progress["rays"] / progress["seconds"] * 1e-6 if progress["seconds"] > 0 else 0
    ended = "stopped after" if progress["cancelled"] else "done:"
    memory = progress["memory"] / 2**20
    return f"{ended} {progress['passes']} samples, {progress['seconds']:.2f} s, {rate:.1f} Mrays/s, {memory:.0f} MB"


def look_ahead(cameras: list) -> None:
    """Where the camera will be in the frames of the render that begins next."""
    _path[:] = cameras


@bpy.app.handlers.persistent
def forget(*_):
    _reported.clear()
    _kept.clear()
    _path.clear()


HANDLERS = (bpy.app.handlers.render_complete, bpy.app.handlers.render_cancel, bpy.app.handlers.load_post)


def in_use() -> bool:
    """Blender may be about to call us or to let go of what it has called."""
    return bool(_running) or (WINDOW and bpy.app.is_job_running("RENDER"))


def stop_renders() -> None:
    """Ends the renders that are running, and waits until they have returned to Blender."""
    if not in_use():
        return
    _leaving.set()
    end = time.monotonic() + LEAVE_SECONDS
    while _running and time.monotonic() < end:
        time.sleep(0.05)


def let_go() -> float | None:
    """Takes the class away once Blender's render job, which only the main loop can end, is over. A timer."""
    if in_use():
        return 0.05
    bpy.utils.unregister_class(GIEngine)
    return None


def register() -> None:
    _leaving.clear()
    viewport.register()
    if bpy.app.timers.is_registered(let_go):  # switched off and on during a render: it is there yet
        bpy.app.timers.unregister(let_go)
    else:
        bpy.utils.register_class(GIEngine)
    for handlers in HANDLERS:
        handlers.append(forget)


def unregister() -> None:
    stop_renders()
    viewport.unregister()
    for handlers in HANDLERS:
        handlers.remove(forget)
    forget()
    if in_use():
        bpy.app.timers.register(let_go, persistent=True)
    else:
        bpy.utils.unregister_class(GIEngine)
