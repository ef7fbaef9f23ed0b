"""One render of one view layer by the native engine: build, start, poll, read, stop. No bpy."""

from __future__ import annotations

import numpy as np

from . import native
from .scene_data import Lightmap, Scene, Settings

POLL_SECONDS = 0.05  # how soon a cancel is seen


class RenderFailed(RuntimeError):
    """The native engine gave up; the message is for the user."""


class Session:
    """Owns the native scene and session. Use as a context manager: leaving it stops the threads."""

    def __init__(
        self,
        scene: Scene,
        settings: Settings,
        lightmap: Lightmap | None = None,
        built=None,
        kept=None,
        path=(),
        steady=False,
        earlier=None,
    ):
        """`earlier`: a Session of the same scene and integrator that has ended, whose work serves on; `kept`: tables that a session like this one kept, to be used as they are where it is `steady`; `path`: Cameras of
        other frames."""
        self.scene, self.settings = scene, settings
        try:
            self.native_scene = built or native.build_scene(scene, settings.threads)
            self.native = native.module().Session(self.native_scene, scene.camera, scene.film, settings, lightmap)
            if earlier:
                self.native.continue_from(earlier.native)
            if kept:
                self.native.take_over(kept)
            self.native.look_along(list(path))
            if steady:
                self.native.stay_steady()
        except native.NativeMissing:
            raise
        except (ValueError, RuntimeError) as error:  # bad input, a library that fails
            raise RenderFailed(str(error)) from error

    def again(self, settings: Settings) -> Session:
        """Another render of the scene that was built."""
        return Session(self.scene, settings, built=self.native_scene)

    def __enter__(self) -> Session:
        self.native.start()
        return self

    def __exit__(self, *_) -> None:
        self.native.cancel()
        while not self.native.wait(POLL_SECONDS):
            pass

    def wait(self) -> bool:
        """Waits a moment, without the GIL; True when the render is done. Raises RenderFailed."""
        done = self.native.wait(POLL_SECONDS)
        if done and (error := self.progress().get("error")):
            raise RenderFailed(error)
        return done

    def progress(self) -> dict:
        return self.native.progress()

    def read(self, name: str) -> np.ndarray:
        """The pass as it is now: (height, width, channels) float32 of the rendered region, row 0 at the bottom."""
        return self.native.read(name)

    def warnings(self) -> list[str]:
        """What the native side found wrong with the scene."""
        return list(self.native_scene.warnings)
