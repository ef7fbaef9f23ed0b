"""Work in a thread of its own of which only the newest counts: a viewport's denoising, which may take longer than a picture. No bpy."""

from __future__ import annotations

import threading
from collections.abc import Callable

from . import log


class Cleaner:
    """The thread is there only while there is work."""

    def __init__(self):
        self._lock = threading.Lock()
        self._next: Callable[[], None] | None = None
        self._thread: threading.Thread | None = None

    def submit(self, work: Callable[[], None]) -> None:
        """After what is at work now; what was waiting is forgotten."""
        with self._lock:
            self._next = work
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="GI Engine denoiser", daemon=True)
                self._thread.start()

    def _run(self) -> None:
        while True:
            with self._lock:
                work, self._next = self._next, None
                if work is None:
                    self._thread = None
                    return
            try:
                work()
            except Exception:  # what waits for this thread must not wait for ever
                log.logger.exception("denoising the viewport failed")

    def wait(self) -> None:
        """Until nothing is at work."""
        while (thread := self._thread) is not None:
            thread.join()
