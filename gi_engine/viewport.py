"""The Rendered viewport: brings Blender's view and scene to the refiner, and its pictures onto the screen. One for each viewport."""

from __future__ import annotations

import atexit
import dataclasses
import weakref

import numpy as np

from . import native
from .bake import blender_folders
from .export import ExportError
from .export.camera import set_depth_of_field
from .export.film import export_film
from .export.settings import resolve
from .look import border_region, camera_of, same_camera
from .refine import Job, Picture, Refiner, close_all
from .scene_data import Denoising, Film
from .sync import Sync

_open: weakref.WeakSet = weakref.WeakSet()


class Viewport:
    def __init__(self, engine):
        self.sync = Sync()
        self.refiner = Refiner(redrawer(weakref.ref(engine)), blender_folders())
        self.job: Job | None = None
        self.failure = ""
        self._texture: tuple | None = None  # the Picture and what the GPU has of it
        _open.add(self)

    def close(self) -> None:
        """Its thread ends when it can: nobody waits for it."""
        self.refiner.close(wait=False)
        _open.discard(self)

    def update(self, context, depsgraph) -> None:
        """The scene may have changed."""
        try:
            self.failure = ""
            self.sync.update(depsgraph, context.space_data)
        except ExportError as error:
            self.failure = str(error)
        self.refiner.redraw()  # Blender does not draw after every change, a script's of a setting among them

    def draw(self, engine, context, depsgraph) -> None:
        if self.sync.is_stale(depsgraph, context.space_data):
            self.update(context, depsgraph)
        if self.sync.exported:
            self.submit(self.wanted(context, depsgraph))
        picture = self.refiner.picture
        if picture:
            self.paint(engine, depsgraph.scene, picture)
        engine.update_stats("", self.status(picture))

    def submit(self, job: Job) -> None:
        """Nothing begins anew that is as it was, a pause between or not."""
        if not same_job(job, self.job):
            self.job = job
            self.refiner.show(job)
        elif job.paused != self.job.paused:
            self.refiner.pause(job.paused)

    def wanted(self, context, depsgraph) -> Job:
        scene, layer, region = depsgraph.scene_eval, depsgraph.view_layer_eval, context.region
        view, space, own = context.region_data, context.space_data, context.scene.gi_engine
        camera = camera_of(np.array(view.view_matrix), np.array(view.window_matrix))
        if view.view_perspective == "CAMERA" and space.camera and space.camera.type == "CAMERA":
            data = space.camera.evaluated_get(depsgraph).data
            if data.dof.use_dof and camera.kind == "PERSP":
                set_depth_of_field(camera, data, camera.matrix)
        film = export_film(scene, layer, resolve(scene, layer), (region.width, region.height))
        film = dataclasses.replace(film, region=region_of(context, film))
        # Not every version tells of settings that change.
        self.sync.exported.settings = self.sync.settings(depsgraph)
        return make_job(self.sync.exported, camera, film, own, resolve(scene, layer))

    def paint(self, engine, scene, picture: Picture) -> None:
        import gpu
        from gpu_extras.presets import draw_texture_2d

        height, width, _ = picture.pixels.shape
        if self._texture is None or self._texture[0] is not picture:
            buffer = gpu.types.Buffer("FLOAT", (height, width, 4), picture.pixels)
            self._texture = (picture, gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer))
        x0, y0, x1, y1 = picture.region
        gpu.state.blend_set("ALPHA_PREMULT")
        engine.bind_display_space_shader(scene)
        draw_texture_2d(self._texture[1], (x0, y0), x1 - x0, y1 - y0)
        engine.unbind_display_space_shader()
        gpu.state.blend_set("NONE")

    def status(self, picture: Picture | None) -> str:
        """The line in the header: what goes on, or what is wrong."""
        error = self.failure or self.refiner.error
        if error or self.job is None:
            return error or "Preparing"
        settings = self.job.settings
        name = next((d["label"] for d in native.integrators() if d["id"] == settings.integrator), settings.integrator)
        stage = self.refiner.stage and f" | {self.refiner.stage.capitalize()}"
        if picture is None:
            return f"{name} | Preparing{stage}"
        paused = "Paused | " if self.job.paused else ""  # first: in narrow views Blender's gizmos cover the end
        noisy = " | No denoiser in this Blender" if settings.denoising and self.refiner.lacks_denoiser else ""
        return f"{paused}{name} | Sample {picture.samples}/{settings.samples} | {picture.seconds:.1f} s{stage}{noisy}"


def make_job(exported, camera, film: Film, own, resolved) -> Job:
    """The scene's viewport settings, applied to what was exported."""
    denoising = None
    if own.use_preview_denoising:
        denoising = Denoising(own.preview_denoising_input_passes, "FAST", own.preview_denoising_quality)
    passes = ["Combined"] + [own.viewport_pass] * (own.viewport_pass != "Combined")
    passes += [name for name in (denoising.guides.values() if denoising else ()) if name not in passes]
    film = dataclasses.replace(film, passes=passes, aovs=[])
    settings = dataclasses.replace(
        exported.settings, samples=resolved.preview_samples or 1 << 20, denoising=denoising, kept_file=""
    )
    start = own.preview_denoising_start_sample
    return Job(exported.scene, camera, film, settings, own.viewport_pass, start, resolved.preview_pause)


def same_job(a: Job, b: Job | None) -> bool:
    return b is not None and a.scene is b.scene and same_camera(a.camera, b.camera) and rest(a) == rest(b)


def rest(job: Job) -> tuple:
    return job.film, job.settings, job.shown, job.start_sample


def region_of(context, film: Film) -> tuple[int, int, int, int]:
    """What of the view is rendered: all, or the render region."""
    view, space, render = context.region_data, context.space_data, context.scene.render
    if view.view_perspective == "CAMERA" and space.camera:
        if not render.use_border:
            return (0, 0, film.width, film.height)
        frame = camera_frame(context)
        share = ((render.border_min_x, render.border_min_y), (render.border_max_x, render.border_max_y))
        corners = [tuple(frame[0][k] + s[k] * (frame[1][k] - frame[0][k]) for k in (0, 1)) for s in share]
        return border_region(corners, film.width, film.height)
    if not space.use_render_border:
        return (0, 0, film.width, film.height)
    corners = (
        (space.render_border_min_x, space.render_border_min_y),
        (space.render_border_max_x, space.render_border_max_y),
    )
    return border_region(corners, film.width, film.height)


def camera_frame(context) -> tuple[tuple, tuple]:
    """The camera's frame in the view: its lower left and upper right corner as shares of the region."""
    item = context.space_data.camera
    corners = np.array([corner[:] for corner in item.data.view_frame(scene=context.scene)])
    world = np.array(item.matrix_world.normalized())
    seen = np.c_[corners, np.ones(4)] @ world.T @ np.array(context.region_data.perspective_matrix).T
    share = seen[:, :2] / seen[:, 3:] * 0.5 + 0.5
    return tuple(share.min(axis=0)), tuple(share.max(axis=0))


def redrawer(engine):
    """Asks Blender to draw again, from any thread; False once the viewport is gone."""

    def redraw() -> bool:
        found = engine()
        try:
            if found is not None:
                found.tag_redraw()
        except ReferenceError:  # Blender has let go of it
            return False
        return found is not None

    return redraw


def register() -> None:
    atexit.register(close_all)


def unregister() -> None:
    atexit.unregister(close_all)
    close_all()
