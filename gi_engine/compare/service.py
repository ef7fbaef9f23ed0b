"""The child's side of child.py: does what its parent asks for, line by line, and ends with its parent. What can be asked for is elsewhere.

Answers are lines of JSON after child.TAG: what was asked for, "progress" before that, or "error"."""

from __future__ import annotations

import json
import os
import queue
import sys
import threading

from ..control import RenderError
from ..display import quiet
from .child import TAG


def serve(deeds: dict, make_state) -> None:
    """`deeds`: functions of a state and what was asked, by name. `make_state`: given what says a line to the parent."""
    with quiet() as (out, _):
        say = lambda **said: print(TAG + json.dumps(said), file=out, flush=True)  # noqa: E731
        state, asked = make_state(say), queue.Queue()
        threading.Thread(target=hear, args=(asked,), daemon=True).start()
        say(ready=True)
        while True:
            request = json.loads(asked.get())
            try:
                answer = deeds[request.pop("do")](state, **request)
            except Exception as error:
                answer = {"error": first_line(error)}
            say(**answer)


def hear(asked: queue.Queue) -> None:
    """Ends the process when the parent is gone, in the middle of a render too."""
    for line in sys.stdin:
        asked.put(line)
    os._exit(0)


def first_line(error: Exception) -> str:
    if not isinstance(error, (RenderError, RuntimeError, OSError, ValueError)):
        return f"internal error: {type(error).__name__}: {error}"
    lines = str(error).strip().removeprefix("Error: ").splitlines()
    return lines[0] if lines else type(error).__name__
