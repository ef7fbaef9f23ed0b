"""A viewport's picture, worked out in a thread: first few pixels, then all of them, until there are enough samples or something newer is
asked for. No bpy; knows nothing of windows."""

from __future__ import annotations

import dataclasses
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from . import log, native
from .cleaner import Cleaner
from .denoise import Stopped, denoise, load
from .look import reduced
from .scene_data import Camera, Film, Scene, Settings
from .session import RenderFailed, Session

AIM_SECONDS = 0.05  # for the first picture after a change: its pixels become fewer or more until it takes about as long
FIRST_PIXELS, LEAST_PIXELS, MOST_PIXELS = (
    4_000,
    500,
    12_000,
)  # of it: before it was ever timed, and within which it stays
CACHE_SECONDS = 0.025  # that caches may take of it: what they do not know by then is path traced
PATIENCE = 0.1  # seconds for which a first picture is finished though something newer is wanted, or none would come while a view turns
MOST_PATIENCE = 2.0  # the same, after several that took longer
POLL_SECONDS = 0.005
SCALES = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)  # by how much the resolution may be reduced

_running: set = set()  # Refiners whose threads have not ended


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
    clean: bool = False  # denoised


class Refiner:
    """One for each viewport. `redraw` is called from its thread; it returns False once nobody looks any more."""

    def __init__(self, redraw: Callable[[], bool], denoiser: tuple[str, ...] = ()):
        self.redraw, self.denoiser = redraw, denoiser
        self.picture: Picture | None = None
        self.error = ""
        self.stage = ""  # what is done while no picture comes
        self.warnings: list[str] = []
        self.lacks_denoiser = False
        self.starts = 0  # how often a picture was begun
        self._wish: Job | None = None
        self._closed = False
        self._wake = threading.Condition()
        self._built: tuple | None = None  # the Scene, and what the native side made of it
        self._last: Session | None = None  # which knows of light in the scene, by caches and photons
        self._job: Job | None = None  # at work, or done
        self._cleaner = Cleaner()
        self._first = FirstPicture()
        self._patience = PATIENCE
        _running.add(self)
        self._thread = threading.Thread(target=self._run, name="GI Engine viewport", daemon=True)
        self._thread.start()

    def show(self, job: Job) -> None:
        with self._wake:
            self._wish = job
            self.starts += 1
            self._wake.notify()

    def pause(self, paused: bool) -> None:
        """What is at work stops after its sample, and goes on from there."""
        with self._wake:
            for job in (self._job, self._wish):
                if job is not None:
                    job.paused = paused
            self._wake.notify()

    def close(self, wait: bool = True) -> None:
        """Ends the thread, as soon as what it is at can be left; `wait`: until then."""
        with self._wake:
            self._closed = True
            self._wake.notify()
        if wait and threading.current_thread() is not self._thread:
            self._thread.join()

    def _run(self) -> None:
        try:
            self._work()
        finally:
            self._cleaner.wait()
            self._forget()
            _running.discard(self)

    def _work(self) -> None:
        while not self._closed:
            with self._wake:
                while (self._wish is None or self._wish.paused) and not self._closed:
                    self._wake.wait()
                job, self._wish = self._wish, None
                self._job = job
            if job is None or self._closed:
                continue
            try:
                self.error = ""
                self._refine(job)
            except (native.NativeMissing, RenderFailed, ValueError, RuntimeError, MemoryError) as error:
                self.error, self._last = str(error) or "out of memory", None
                self._tell()

    def _forget(self) -> None:
        self._last = self._built = None

    def _outdated(self) -> bool:
        return self._closed or self._wish is not None

    def _tell(self) -> None:
        if not self.redraw():
            self._closed = True

    def _refine(self, job: Job) -> None:
        before = None
        if self._built is None or self._built[0] is not job.scene:
            before, self._last = self._built and self._built[1], None
            built = native.build_scene(job.scene, job.settings.threads, movable=True, before=before)
            self._built = (job.scene, built)
            self.warnings = list(built.warnings)
        started = time.monotonic()
        for scale in scales(job.film, self._first.pixels_of(job.settings.integrator)):
            if not self._stage(job, scale, started):
                return
            before = None  # freeing it did not delay the picture

    def _stage(self, job: Job, scale: int, started: float) -> bool:
        """One session at 1/scale of the resolution. False where something newer is wanted."""
        samples = job.settings.samples if scale == 1 else 1
        threads = job.settings.threads or max(1, (os.cpu_count() or 2) - 1)  # one is left to the window
        is_first = scale > 1 and (self.picture is None or self.picture.job is not job)
        limit = 2 * CACHE_SECONDS if is_first else 0.0  # caches take half of it at most
        settings = dataclasses.replace(
            job.settings, samples=samples, threads=threads, time_limit=limit, noise_target=0.0
        )
        scene = dataclasses.replace(job.scene, camera=job.camera, film=reduced(job.film, scale))
        session = self._last = Session(scene, settings, built=self._built[1], earlier=self._knowing(settings))
        shown, clean_at = 0, job.start_sample
        session.native.pause(job.paused)
        with session:
            while True:
                session.native.pause(job.paused)
                done = session.native.wait(POLL_SECONDS)
                if self._outdated() and not (is_first and self._finishes(started)):
                    session.native.cancel()
                    return False
                progress = session.progress()
                if progress["error"]:
                    raise RenderFailed(progress["error"])
                self._note(progress["stage"])
                if progress["passes"] > shown:
                    shown = progress["passes"]
                    clean = scale == 1 and (shown >= clean_at or shown == samples)
                    clean_at = 2 * shown if clean else clean_at
                    self._publish(session, job, shown if scale == 1 else 0, time.monotonic() - started, clean)
                    if is_first:
                        self._first.took(self.picture)
                        self._patience = PATIENCE
                if done:
                    break
        return not self._outdated()

    def _finishes(self, started: float) -> bool:
        """Whether a first picture that is out of date is finished nevertheless. After one that was not, there is more patience with the next:
        where changes come all the time, pictures do, too."""
        if self._closed:
            return False
        if time.monotonic() - started < self._patience:
            return True
        self._patience = min(2 * self._patience, MOST_PATIENCE)
        return False

    def _note(self, stage: str) -> None:
        """Passes on what the integrator is at, without what it counts meanwhile."""
        stage = stage.split(",")[0]
        if stage != self.stage:
            self.stage = stage
            self._tell()

    def _knowing(self, settings: Settings) -> Session | None:
        """The last session, if what it worked out serves this one: it was perhaps stopped on its way, by a camera that moved."""
        last, self._last = self._last, None
        if last is None or not settings.keep:
            return None
        alike = (last.settings.integrator, last.settings.parameters) == (settings.integrator, settings.parameters)
        return last if alike else None

    def _publish(self, session: Session, job: Job, samples: int, seconds: float, clean: bool) -> None:
        wishes = job.settings.denoising if job.shown == "Combined" else None
        picture = Picture(rgba(session.read(job.shown)), job.film.region, samples, seconds, job)
        self.lacks_denoiser = bool(wishes) and load(self.denoiser) is None
        if wishes and clean and not self.lacks_denoiser:
            guides = {guide: session.read(name) for guide, name in wishes.guides.items()}
            self._cleaner.submit(lambda: self._clean(picture, guides))
        if self.picture and self.picture.job is job and self.picture.clean:
            return  # better than a newer noisy one
        self._show(picture)

    def _clean(self, noisy: Picture, guides: dict[str, np.ndarray]) -> None:
        """In the cleaner's thread."""
        wishes = noisy.job.settings.denoising
        try:
            stopped = lambda: not self._is_current(noisy.job)  # noqa: E731
            found = denoise(noisy.pixels, guides, self.denoiser, wishes.quality, wishes.prefilter, stopped)
        except Stopped:
            return
        except RuntimeError as error:
            log.logger.warning("%s; the viewport's picture stays noisy", error)
            return
        self._show(dataclasses.replace(noisy, pixels=rgba(found), clean=True))

    def _is_current(self, job: Job) -> bool:
        return self._job is job and not self._outdated()

    def _show(self, picture: Picture) -> None:
        with self._wake:
            if picture.clean and not self._is_current(picture.job):
                return
            self.picture = picture
        self._tell()


class FirstPicture:
    """How many pixels it has, by how long the last ones took."""

    def __init__(self):
        self.pixels, self.integrator = FIRST_PIXELS, ""

    def pixels_of(self, integrator: str) -> int:
        if integrator != self.integrator:
            self.pixels, self.integrator = FIRST_PIXELS, integrator
        return self.pixels

    def took(self, picture: Picture) -> None:
        height, width, _ = picture.pixels.shape
        pace = AIM_SECONDS / max(picture.seconds, 1e-3)
        if pace < 1 or pace > 2:  # between, pixels that change their size all the time would be worse
            self.pixels = int(min(max(height * width * min(max(pace, 0.25), 2.5), LEAST_PIXELS), MOST_PIXELS))


def scales(film: Film, pixels: int = FIRST_PIXELS) -> list[int]:
    """By how much the resolution is reduced, first to last; `pixels` of the first picture."""
    x0, y0, x1, y1 = film.region
    enough = (scale for scale in SCALES if (x1 - x0) * (y1 - y0) <= pixels * scale * scale)
    first = next(enough, SCALES[-1])
    return [first, max(1, first // 4), 1] if first > 4 else [first, 1] if first > 1 else [1]


def close_all() -> None:
    """Waits for the end of all threads."""
    for refiner in list(_running):
        refiner.close()


def rgba(pixels: np.ndarray) -> np.ndarray:
    """(height, width, 4) float32 of a pass with any number of channels."""
    height, width, channels = pixels.shape
    if channels == 4:
        return np.ascontiguousarray(pixels, np.float32)
    made = np.ones((height, width, 4), np.float32)
    made[..., :3] = pixels[..., :1] if channels < 3 else pixels[..., :3]
    return made
