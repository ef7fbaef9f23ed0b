"""A process of its own that does what it is asked for: renders (worker.py) or compares on one scene (one.py). What crashes, hangs or fails
there is a ChildFailed here. No bpy."""

from __future__ import annotations

import collections
import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

TAG = "GI-COMPARE "  # before what the worker says; Blender says other things
POLL = 0.1
START_LIMIT = 180.0  # seconds for starting Blender and opening a file


class ChildFailed(RuntimeError):
    """What was asked for could not be done; the message is for the user."""


class Cancelled(Exception):
    """The user has had enough."""


def blender_program() -> str:
    """Blender's program; "" where Blender is a module of Python's."""
    bpy = sys.modules.get("bpy")
    return bpy.app.binary_path if bpy else ""


def command(module: str) -> list[str]:
    """Runs `main` of a module of this package."""
    run = f"import importlib; importlib.import_module({__package__ + '.' + module!r}).main()"
    program = blender_program()
    if program:  # with the user's preferences, which know the add-on
        return [program, "--background", "--python-exit-code", "1", "--python-expr", run]
    return [sys.executable, "-c", run]


class Child:
    """Use as a context manager: leaving it ends the process, and what that has started."""

    def __init__(self, stopped=lambda: False, module: str = "worker"):
        self.stopped = stopped
        self.lines: queue.Queue = queue.Queue()
        self.last_words: collections.deque = collections.deque(maxlen=5)
        start = time.monotonic()
        # The add-on from where it is; Blender's module adds to sys.path what only it can import.
        paths = [str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
        self.process = subprocess.Popen(
            command(module),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env=None if blender_program() else environment,
            # Ctrl-C is for the parent, which then ends the child.
            start_new_session=sys.platform != "win32",
            text=True,
            encoding="utf-8",
            errors="replace",
        )
        for stream, keep in ((self.process.stdout, self.hear), (self.process.stderr, self.last_words.append)):
            threading.Thread(target=self.listen, args=(stream, keep), daemon=True).start()
        try:
            self.answer(START_LIMIT, None)
        except BaseException:
            self.close()
            raise
        self.startup = time.monotonic() - start

    def __enter__(self) -> Child:
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def listen(self, stream, keep) -> None:
        for line in stream:
            keep(line.rstrip())
        if stream is self.process.stdout:
            self.lines.put(None)

    def hear(self, line: str) -> None:
        _, tag, words = line.partition(TAG)
        if tag:
            self.lines.put(words)

    def ask(self, do: str, limit: float = START_LIMIT, on_progress=None, **arguments) -> dict:
        """The worker's answer. Raises ChildFailed where it fails, crashes or takes longer than `limit` seconds; Cancelled."""
        try:
            self.process.stdin.write(json.dumps({"do": do, **arguments}, default=str) + "\n")
            self.process.stdin.flush()
        except OSError:
            raise ChildFailed(self.end()) from None
        return self.answer(limit, on_progress)

    def answer(self, limit: float, on_progress) -> dict:
        deadline = time.monotonic() + limit
        while True:
            if self.stopped():
                self.close()
                raise Cancelled
            try:
                line = self.lines.get(timeout=POLL)
            except queue.Empty:
                if time.monotonic() > deadline:
                    self.close()
                    raise ChildFailed(f"not done after {limit:g} s") from None
                continue
            if line is None:
                raise ChildFailed(self.end())
            said = json.loads(line)
            if "progress" in said:
                if on_progress:
                    on_progress(said)
            elif "error" in said:
                raise ChildFailed(said["error"])
            else:
                return said

    def end(self) -> str:
        """Why the process is gone."""
        code = self.process.wait()
        self.close()
        if code < 0:
            with contextlib.suppress(ValueError):
                return f"crashed ({signal.Signals(-code).name})"
        words = [line for line in self.last_words if line.strip()]
        return f"ended with code {code}" + (f": {words[-1]}" if words else "")

    def close(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout, self.process.stderr):
            with contextlib.suppress(OSError):
                stream.close()
