"""Hands for scripts inside Blender with a window: real keys by xdotool, waiting without blocking, memory, and the gaps between ticks of Blender's
main loop. A story is a generator that yields seconds to wait; Blender ends with status 0 after it, or 1 after the first thing that went wrong."""

import contextlib
import ctypes
import gc
import importlib
import os
import subprocess
import sys
import threading
import time
import traceback

import bpy

F12, ESCAPE = "96", "Escape"  # by key code: xdotool's own F12 comes with a wrong Alt


def xdotool(*words):
    subprocess.run(["xdotool", *map(str, words)], check=True)


def press(code):
    xdotool("mousemove", 400, 400, "sleep", 0.2, "key", code)


def click(x, y):
    """Screen coordinates, origin at the top left."""
    xdotool("mousemove", round(x), round(y), "sleep", 0.3, "click", 1)


def renders():
    return bpy.app.is_job_running("RENDER")


def until(test, seconds, what):
    end = time.monotonic() + seconds
    while not test():
        if time.monotonic() > end:
            raise TimeoutError(f"{what}: waited {seconds} s")
        yield 0.05


def in_window(kind=None):
    """Context of the largest area, or of the largest of a kind, for operators."""
    window = bpy.context.window_manager.windows[0]
    areas = [area for area in window.screen.areas if kind in (None, area.type)]
    area = max(areas, key=lambda a: a.width * a.height)
    region = next(r for r in area.regions if r.type == "WINDOW")
    return bpy.context.temp_override(window=window, area=area, region=region)


def viewport():
    with in_window("VIEW_3D"):
        return bpy.context.area.spaces.active


def engine_module(name):
    """Of the add-on as it is installed."""
    return importlib.import_module(next(found for found in sys.modules if found.endswith(f"gi_engine.{name}")))


def memory():
    """MB that the process holds, without what it has freed and the C library keeps."""
    gc.collect()
    with contextlib.suppress(AttributeError):
        ctypes.CDLL(None).malloc_trim(0)
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20


class Ticks:
    """Gaps between ticks of a timer, which Blender's main loop runs; where Python held the main thread during the longest, says so."""

    INTERVAL = 0.01

    def __init__(self):
        self.gaps, self.longest, self.where = [], 0.0, ""
        self.last = time.monotonic()
        self.main = threading.main_thread().ident
        self.ends = False
        bpy.app.timers.register(self.tick, persistent=True)
        self.watcher = threading.Thread(target=self.watch, daemon=True)
        self.watcher.start()

    def tick(self):
        now = time.monotonic()
        self.gaps.append(now - self.last)
        self.last = now
        return None if self.ends else self.INTERVAL

    def watch(self):
        while not self.ends:
            time.sleep(0.02)
            gap = time.monotonic() - self.last
            if gap > max(0.1, self.longest):
                self.longest = gap
                frame = sys._current_frames().get(self.main)
                self.where = "".join(traceback.format_stack(frame)[-4:]) if frame else "no Python"

    def end(self):
        self.ends = True
        self.watcher.join()
        gaps = sorted(self.gaps[1:]) or [0.0]
        return f"{len(gaps)} ticks, median {gaps[len(gaps) // 2] * 1e3:.0f} ms, 99 % below {gaps[int(0.99 * len(gaps))] * 1e3:.0f} ms, longest {gaps[-1] * 1e3:.0f} ms"


def picture(name, area=None):
    """Of the screen or an area of it, into the folder SCREENSHOTS of the environment where there is one."""
    folder = os.environ.get("SCREENSHOTS")
    if folder:
        crop = ["-crop", "{}x{}+{}+{}".format(area.width, area.height, *corner(area)), "+repage"] if area else []
        subprocess.run(["import", "-silent", "-window", "root", *crop, os.path.join(folder, name + ".png")], check=True)


def corner(area):
    """The upper left one of an area or region, on the screen."""
    return area.x, bpy.context.window_manager.windows[0].height - (area.y + area.height)


def run(story):
    def step():
        try:
            return next(story)
        except StopIteration:
            code = 0
        except Exception:
            traceback.print_exc()
            picture("failed")
            code = 1
        leave(code)

    bpy.app.timers.register(step, first_interval=1.0, persistent=True)


def leave(code):
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
