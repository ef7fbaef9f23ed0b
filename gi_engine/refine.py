"""A viewport's picture, worked out in a thread: first few pixels, then all of them, until there are enough samples or something newer is
asked for. No bpy; knows nothing of windows."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from . import native
from .denoise import denoise
from .look import reduced
from .scene_data import Camera, Film, Scene, Settings
from .session import RenderFailed, Session

FIRST_PIXELS = 12_000  # of the first picture after a change: as many as are traced before it feels slow
POLL_SECONDS = 0.01


@dataclass
class Job:
    """What is to be shown."""

    scene: Scene
    camera: Camera
    film: Film
    settings: Settings
    shown: str = "Combined"  # pass
    start_sample: int = 1  # of the denoiser
    paused: bool = False


@dataclass
class Picture:
    pixels: np.ndarray  # (height, width, 4) float32, row 0 at the bottom
    region: tuple  # of the view, in its own pixels
    samples: int
    seconds: float
    job: Job


class Refiner:
    """One for each viewport. `redraw` is called from its thread; it returns False once nobody looks any more."""

    def __init__(self, redraw: Callable[[], bool], denoiser: tuple[str, ...] = ()):
        self.redraw, self.denoiser = redraw, denoiser
        self.picture: Picture | None = None
        self.error = ""
        self.warnings: list[str] = []
        self.starts = 0  # how often a picture was begun
        self._wish: Job | None = None
        self._closed = False
        self._wake = threading.Condition()
        self._built: tuple | None = None  # the Scene, and what the native side made of it
        self._kept: dict = {}
        self._thread = threading.Thread(target=self._run, name="GI Engine viewport", daemon=True)
        self._thread.start()

    def show(self, job: Job) -> None:
        with self._wake:
            self._wish = job
            self.starts += 1
            self._wake.notify()

    def close(self) -> None:
        """Ends the thread, and waits for it."""
        with self._wake:
            self._closed = True
            self._wake.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join()
        self._built = None

    def _run(self) -> None:
        while not self._closed:
            with self._wake:
                while self._wish is None and not self._closed:
                    self._wake.wait()
                job, self._wish = self._wish, None
            if job is None or job.paused:
                continue
            try:
                self.error = ""
                self._refine(job)
            except (native.NativeMissing, RenderFailed, ValueError, RuntimeError, MemoryError) as error:
                self.error = str(error) or "out of memory"
                self._tell()
        self._built = None

    def _outdated(self) -> bool:
        return self._closed or self._wish is not None

    def _tell(self) -> None:
        if not self.redraw():
            self._closed = True

    def _refine(self, job: Job) -> None:
        if self._built is None or self._built[0] is not job.scene:
            self._built, self._kept = None, {}
            self._built = (job.scene, native.build_scene(job.scene, job.settings.threads))
            self.warnings = list(self._built[1].warnings)
        started = time.monotonic()
        for scale in scales(job.film):
            samples = job.settings.samples if scale == 1 else 1
            if not self._stage(job, scale, samples, started):
                return

    def _stage(self, job: Job, scale: int, samples: int, started: float) -> bool:
        """One session at 1/scale of the resolution. False where something newer is wanted."""
        threads = job.settings.threads or max(1, (os.cpu_count() or 2) - 1)  # one is left to the window
        settings = dataclasses.replace(job.settings, samples=samples, threads=threads, time_limit=0.0, noise_target=0.0)
        scene = dataclasses.replace(job.scene, camera=job.camera, film=reduced(job.film, scale))
        session = Session(scene, settings, built=self._built[1], kept=self._kept.get(settings.integrator))
        shown, clean_at = 0, job.start_sample
        with session:
            while True:
                done = session.native.wait(POLL_SECONDS)
                if self._outdated():
                    session.native.cancel()
                    return False
                progress = session.progress()
                if progress["error"]:
                    raise RenderFailed(progress["error"])
                if progress["passes"] > shown:
                    shown = progress["passes"]
                    clean = scale == 1 and (shown >= clean_at or shown == samples)
                    clean_at = 2 * shown if clean else clean_at
                    self._publish(session, job, shown if scale == 1 else 0, time.monotonic() - started, clean)
                if done:
                    break
        with contextlib.suppress(ValueError):
            kept = session.native.kept()
            if kept and job.settings.keep:
                self._kept[settings.integrator] = kept
        return not self._outdated()

    def _publish(self, session: Session, job: Job, samples: int, seconds: float, clean: bool) -> None:
        pixels = session.read(job.shown)
        wishes = job.settings.denoising
        if wishes and job.shown == "Combined" and clean:
            guides = {guide: session.read(name) for guide, name in wishes.guides.items()}
            with contextlib.suppress(RuntimeError):
                found = denoise(pixels, guides, self.denoiser, wishes.quality, wishes.prefilter)
                pixels = pixels if found is None else found
        elif wishes and job.shown == "Combined" and samples > job.start_sample:
            return  # the last clean picture is better than a newer noisy one
        self.picture = Picture(rgba(pixels), job.film.region, samples, seconds, job)
        self._tell()


def scales(film: Film) -> list[int]:
    """By how much the resolution is reduced, first to last."""
    x0, y0, x1, y1 = film.region
    first = 1
    while (x1 - x0) * (y1 - y0) > FIRST_PIXELS * first * first:
        first *= 2
    return [first, max(1, first // 4), 1] if first > 4 else [first, 1] if first > 1 else [1]


def rgba(pixels: np.ndarray) -> np.ndarray:
    """(height, width, 4) float32 of a pass with any number of channels."""
    height, width, channels = pixels.shape
    if channels == 4:
        return np.ascontiguousarray(pixels, np.float32)
    made = np.ones((height, width, 4), np.float32)
    made[..., :3] = pixels[..., :1] if channels < 3 else pixels[..., :3]
    return made
