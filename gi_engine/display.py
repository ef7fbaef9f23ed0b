"""The progress of a render on a terminal: a bar with the time left and the rays per second, or plain lines where the
output is not a terminal or rich is not there (inside Blender). Silences what Blender itself prints."""

from __future__ import annotations

import contextlib
import ctypes
import math
import os
import sys
import time

from .control import Progress

PLAIN_INTERVAL = 5.0  # seconds between plain lines


@contextlib.contextmanager
def quiet(active: bool = True):
    """Sends what the process prints to nowhere, C and Python alike, and gives (out, err) streams that still arrive."""
    if not active:
        yield sys.stdout, sys.stderr
        return
    flush_all()
    saved = [os.dup(1), os.dup(2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    os.close(nowhere)
    streams = [os.fdopen(os.dup(fd), "w", buffering=1, encoding="utf-8", errors="replace") for fd in saved]
    try:
        with open(os.devnull, "w") as null, contextlib.redirect_stdout(null), contextlib.redirect_stderr(null):
            yield tuple(streams)
    finally:
        flush_all()
        for fd, copy, stream in zip((1, 2), saved, streams, strict=True):
            stream.close()
            os.dup2(copy, fd)
            os.close(copy)


def flush_all() -> None:
    sys.stdout.flush()
    sys.stderr.flush()
    if sys.platform != "win32":
        ctypes.CDLL(None).fflush(None)


def amount(value: float) -> str:
    """1234567 as 1.23 M."""
    for unit, scale in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if value >= scale:
            return f"{value / scale:.3g} {unit}"
    return f"{value:.3g} "


def duration(seconds: float) -> str:
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    minutes, whole = divmod(int(seconds + 0.5), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{whole:02d}" if hours else f"{minutes:02d}:{whole:02d}"


def seconds_left(progress: Progress) -> float | None:
    if progress.seconds_left is not None:
        return progress.seconds_left
    if progress.fraction <= 0.0:
        return None
    return progress.seconds * (1.0 - progress.fraction) / progress.fraction


def details(progress: Progress) -> str:
    """The words beside the bar."""
    if progress.stage and progress.passes == 0:
        return progress.stage
    left = seconds_left(progress)
    rate = progress.rays / progress.seconds if progress.seconds > 0.0 else 0.0
    words = [f"{progress.passes} passes", f"{duration(left)} left" if left is not None else "", f"{amount(rate)}rays/s"]
    if progress.noise is not None and math.isfinite(progress.noise):
        words.append(f"noise {progress.noise:.3g}")
    return ", ".join(word for word in words if word)


class PlainDisplay:
    def __init__(self, stream):
        self.stream = stream
        self.next = time.monotonic() + PLAIN_INTERVAL
        self.title = ""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def begin(self, title: str) -> None:
        self.title = title

    def say(self, text: str, stream) -> None:
        print(text, file=stream)

    def update(self, progress: Progress) -> None:
        if time.monotonic() >= self.next:
            self.next = time.monotonic() + PLAIN_INTERVAL
            print(f"{self.title}: {100 * progress.fraction:.0f} %, {details(progress)}", file=self.stream)


class RichDisplay:
    def __init__(self, stream):
        from rich import console
        from rich import progress as bars

        columns = (
            bars.TextColumn("{task.description}"),
            bars.BarColumn(),
            bars.TaskProgressColumn(),
            bars.TextColumn("{task.fields[details]}"),
        )
        self.bar = bars.Progress(
            *columns,
            console=console.Console(file=stream, force_terminal=True),
            redirect_stdout=False,
            redirect_stderr=False,
        )
        self.task = None

    def __enter__(self):
        self.bar.start()
        return self

    def __exit__(self, *_):
        self.bar.stop()

    def begin(self, title: str) -> None:
        if self.task is not None:
            self.bar.remove_task(self.task)
        self.task = self.bar.add_task(title, total=1.0, details="")

    def say(self, text: str, stream) -> None:
        """Prints a line on `stream`: above the bar, where that is on the same terminal."""
        if stream.isatty():
            self.bar.console.print(text, markup=False, highlight=False, soft_wrap=True)
        else:
            print(text, file=stream)

    def update(self, progress: Progress) -> None:
        self.bar.update(self.task, completed=min(progress.fraction, 1.0), details=details(progress))


def display_on(stream):
    if stream.isatty():
        with contextlib.suppress(ImportError):
            return RichDisplay(stream)
    return PlainDisplay(stream)
