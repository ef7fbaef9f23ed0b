"""The process that renders: opens one scene and renders it as its parent asks (child.py). Leaves the file untouched.

What is not about light transport is off for every engine: denoising, adaptive sampling, compositing, the sequencer. Everything else is
the scene's own."""

from __future__ import annotations

import re
import sys
import time
from pathlib import Path

import bpy
import numpy as np

from .. import control, headless, machine
from ..control import Control, RenderError
from .metrics import BLOCK
from .service import serve

UNLIMITED = 1 << 20  # samples, where time is the limit
TELL_SECONDS = 0.25
SAMPLE = re.compile(r"Sample (\d+)/\d+")


def main() -> None:
    serve(DEEDS, State)


class State:
    def __init__(self, say):
        self.say = say
        self.engine = ""
        self.samples = self.told = 0
        self.marks: dict[str, float] = {}  # when sampling began, when the picture was done

    def listen(self) -> None:
        """After a file was opened, which takes handlers away."""
        bpy.app.handlers.render_stats.append(self.on_stats)
        bpy.app.handlers.render_post.append(self.on_post)

    def on_stats(self, text, *_) -> None:
        """Cycles tells how far it is in words only."""
        found = SAMPLE.search(str(text))
        if found and self.engine == "cycles":
            self.marks.setdefault("sampling", time.perf_counter())
            self.samples = max(self.samples, int(found[1]))
            self.tell(self.samples)

    def on_post(self, *_) -> None:
        self.marks["done"] = time.perf_counter()

    def on_progress(self, progress) -> None:
        self.tell(progress.passes)

    def tell(self, samples: int) -> None:
        if time.perf_counter() > self.told + TELL_SECONDS:
            self.told = time.perf_counter()
            self.say(progress=True, samples=samples)


# What can be asked for


def open_scene(state: State, file: str, engine: str, view: dict) -> dict:
    start = time.perf_counter()
    headless.register_once()
    headless.open_file(Path(file), factory_settings=not bpy.app.binary_path)
    state.listen()
    scene = bpy.context.scene
    if scene.camera is None:
        raise RenderError(f'scene "{scene.name}" has no camera')
    state.engine = engine
    choose_engine(scene, engine)
    prepare(scene, view)
    render = scene.render
    factor = render.resolution_percentage / 100
    return {
        "seconds": time.perf_counter() - start,
        "scene": scene.name,
        "frame": scene.frame_current,
        "size": [int(render.resolution_x * factor), int(render.resolution_y * factor)],
        "blender": bpy.app.version_string,
        "view_transform": scene.view_settings.view_transform,
        "reads": bpy.utils.blend_paths(absolute=True, packed=False, local=False),
    }


def choose_engine(scene, engine: str) -> None:
    name = "CYCLES" if engine == "cycles" else "GI_ENGINE"
    try:
        scene.render.engine = name
    except TypeError:
        raise RenderError(f"{'Cycles' if engine == 'cycles' else 'GI Engine'} is not in this Blender") from None


def prepare(scene, view: dict) -> None:
    render = scene.render
    if view["frame"] is not None:
        scene.frame_set(view["frame"])
    if view["resolution"]:
        headless.set_resolution(scene, *view["resolution"])
    if view["longest"]:
        headless.set_resolution(scene, *shrunk(scene.render, view["longest"]))
    if view["region"]:
        render.use_border = render.use_crop_to_border = True
        render.border_min_x, render.border_min_y, render.border_max_x, render.border_max_y = view["region"]
    threads = view["threads"] or (machine.current.threads if render.threads_mode != "FIXED" else 0)
    if threads:  # as many for Cycles
        render.threads_mode, render.threads = "FIXED", threads
    render.use_compositing = render.use_sequencer = False
    for layer in scene.view_layers:
        layer.samples = 0
    if hasattr(scene, "cycles"):
        cycles = scene.cycles
        cycles.use_adaptive_sampling = cycles.use_denoising = cycles.use_animated_seed = False
        cycles.device = "CPU"
        if view["neutral"]:
            neutralize(cycles)


def shrunk(render, longest: int) -> tuple[int, int]:
    """The picture's size with `longest` pixels along its longer side, in whole blocks."""
    factor = longest / max(render.resolution_x, render.resolution_y)
    sides = (render.resolution_x, render.resolution_y)
    return tuple(max(BLOCK, round(side * factor / BLOCK) * BLOCK) for side in sides)


def neutralize(cycles) -> None:
    """Takes away what makes the engines differ by design or pixels depend on one another."""
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.light_sampling_threshold, cycles.pixel_filter_type, cycles.filter_width = 0.0, "BOX", 1.0
    cycles.use_guiding = cycles.use_fast_gi = False
    cycles.sampling_pattern = "TABULATED_SOBOL"
    for item in bpy.data.objects:
        if hasattr(item, "shadow_terminator_geometry_offset"):
            item.shadow_terminator_geometry_offset = 0.0  # moves where shadow rays begin, by taste
    for lamp in bpy.data.lights:
        lamp.cycles.is_caustics_light = False  # manifold walks: too dark beside caustics


def render(
    state: State, path: str, seed: int, samples: int, seconds: float, passes: bool, parameters: dict | None = None
) -> dict:
    """One picture into `path` (.exr: the combined pass), every pass into `path` with "_passes" if asked for; `parameters`: of the
    integrator, by name, over the scene's."""
    scene = bpy.context.scene
    state.samples, state.marks = 0, {}
    before = memory_now()
    wishes = Control(on_progress=state.on_progress, parameters=parameters or {})
    if state.engine == "cycles":
        scene.cycles.samples, scene.cycles.time_limit = samples or UNLIMITED, seconds
        scene.cycles.seed = seed
    else:
        limits = {"samples": samples, "time_limit": seconds, "noise_target": 0.0, "denoising": None}
        wishes.overrides = limits | {"integrator": state.engine, "seed": seed, "keep": False, "kept_file": ""}
    target = Path(path)
    set_exr(scene, multilayer=True)
    scene.render.filepath = headless.escaped(str(target.with_name(target.stem + "_passes.exr")))
    scene.render.use_file_extension = True
    control.current = wishes
    start = time.perf_counter()
    try:
        headless.start_render(scene, write_still=passes)
    finally:
        control.current = None
    wall = state.marks.get("done", time.perf_counter()) - start
    set_exr(scene, multilayer=False)
    bpy.data.images["Render Result"].save_render(path, scene=scene)
    if state.engine == "cycles":
        sampling = start + wall - state.marks.get("sampling", start)
        done, rays = state.samples, None
    else:
        sampling, done, rays = wishes.last.seconds, wishes.last.passes, wishes.last.rays
        if not done:
            raise RenderError("; ".join(wishes.errors) or "no pass was finished")
    return {
        "wall": wall,
        "sampling": sampling,
        "export": max(wall - sampling, 0.0),
        "samples": done,
        "rays": rays,
        "memory": peak_memory() - before,
        "warnings": wishes.warnings,
        "note": wishes.last.note,
    }


def set_exr(scene, multilayer: bool) -> None:
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # from 5.0 on
        settings.media_type = "MULTI_LAYER_IMAGE" if multilayer else "IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER" if multilayer else "OPEN_EXR"
    settings.color_depth, settings.exr_codec = "32", "ZIP"
    if not multilayer:
        settings.color_mode = "RGB"


def show(state: State, source: str, target: str) -> dict:
    """A picture through the scene's view transform: as PNG, and its bytes as an array beside it for who reads no PNG."""
    scene = bpy.context.scene
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = "PNG", "RGB", "8"
    image = bpy.data.images.load(source)
    image.save_render(target, scene=scene)
    bpy.data.images.remove(image)
    image = bpy.data.images.load(target)
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    width, height = image.size
    bpy.data.images.remove(image)
    np.save(Path(target).with_suffix(".npy"), pixels.reshape(height, width, -1)[::-1, :, :3])
    return {"size": [width, height]}


DEEDS = {"open": open_scene, "render": render, "show": show}


def memory_now() -> float:
    """MiB in use; 0 where the system does not say."""
    try:
        with open("/proc/self/status") as status:
            return int(next(line for line in status if line.startswith("VmRSS")).split()[1]) / 1024
    except OSError:
        return 0.0


def peak_memory() -> float:
    try:
        import resource
    except ImportError:  # Windows
        return 0.0
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / (1 << 20 if sys.platform == "darwin" else 1 << 10)
