"""The viewport without a window: its camera, its pictures, and what it takes over of a scene that changes."""

from __future__ import annotations

import dataclasses
import threading
import time
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

import gi_engine
from gi_engine import native, refine, viewport
from gi_engine.export import export
from gi_engine.look import border_region, camera_of, reduced
from gi_engine.refine import Refiner, scales
from gi_engine.scene_data import Denoising, Film
from gi_engine.session import Session

from .conftest import add, mesh


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_the_view_of_a_camera_is_the_cameras(scene, render_export, kind):
    camera = scene.camera
    camera.data.type, camera.data.shift_x, camera.data.shift_y = kind, 0.2, -0.1
    camera.rotation_euler, camera.scale = (0.4, 0.2, 1.0), (2, 2, 2)
    add(scene, "Square", mesh())
    depsgraph = bpy.context.evaluated_depsgraph_get()
    window = camera.calc_matrix_camera(depsgraph, x=16, y=12)
    found = camera_of(np.array(camera.matrix_world.normalized().inverted()), np.array(window))
    wanted = render_export().scene.camera
    np.testing.assert_allclose(found.view_plane, wanted.view_plane, rtol=1e-4)
    np.testing.assert_allclose(found.matrix[:3, :3], wanted.matrix[:3, :3], atol=1e-5)
    # An orthographic camera may stand elsewhere along its view, as long as it sees the same depths.
    back = (found.matrix[:3, 3] - wanted.matrix[:3, 3]) @ wanted.matrix[:3, 2]
    assert found.clip_start - back == pytest.approx(wanted.clip_start, abs=2e-3)
    assert found.clip_end - back == pytest.approx(wanted.clip_end, rel=1e-3)


def test_borders_and_reduced_films_keep_within_the_view():
    assert border_region(((0.25, 0.5), (0.75, 2.0)), 400, 100) == (100, 50, 300, 100)
    assert border_region(((1.5, -1), (1.2, -1)), 10, 10) == (9, 0, 10, 1)
    film = Film(width=401, height=99, region=(0, 0, 401, 99))
    assert scales(film)[-1] == 1 and scales(film) == sorted(scales(film), reverse=True)
    small = reduced(film, 8)
    assert small.region == (0, 0, 50, 12) and (small.width, small.height) == (50, 12)


@pytest.fixture
def lit(scene):
    add(scene, "Square", mesh(), location=(-2, -2, 0), scale=(4, 4, 4))
    add(scene, "Lamp", bpy.data.lights.new("Lamp", "POINT"), location=(0, 0, 2)).data.energy = 100
    return scene


@pytest.fixture
def job(lit):
    """What a viewport of 320 x 200 pixels through the camera wants."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    exported = export(depsgraph, native.integrators(), None, (320, 200))
    film = dataclasses.replace(exported.scene.film, region=(0, 0, 320, 200))
    exported.settings = dataclasses.replace(exported.settings, threads=1)
    resolved = type("Resolved", (), {"preview_samples": 3, "preview_pause": False})
    return viewport.make_job(exported, exported.scene.camera, film, lit.gi_engine, resolved)


def wait_for(test, seconds=60):
    end = time.monotonic() + seconds
    while not test():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_pictures_come_coarse_first_and_end_with_all_samples(job):
    seen = []
    refiner = Refiner(lambda: seen.append(refiner.picture) or True)
    refiner.show(job)
    wait_for(lambda: refiner.picture and refiner.picture.samples == 3)
    sizes = [picture.pixels.shape[:2] for picture in seen]
    assert sizes[0] < (200, 320) and sizes[-1] == (200, 320) and sizes == sorted(sizes)
    brightness = [picture.pixels[..., :3].mean() for picture in (seen[0], seen[-1])]
    assert brightness[0] == pytest.approx(brightness[1], rel=0.1) and brightness[1] > 0.01
    refiner.close()
    assert "GI Engine viewport" not in [thread.name for thread in threading.enumerate()]


def test_what_is_newer_replaces_what_is_worked_on(job):
    refiner = Refiner(lambda: True)
    endless = dataclasses.replace(job, settings=dataclasses.replace(job.settings, samples=1 << 20))
    refiner.show(endless)
    wait_for(lambda: refiner.picture)
    refiner.show(job)
    wait_for(lambda: refiner.picture.job is job and refiner.picture.samples == 3)
    assert refiner.starts == 2 and not refiner.error
    refiner.close()


def test_a_pause_ends_where_it_began(job):
    refiner = Refiner(lambda: True)
    endless = dataclasses.replace(job, settings=dataclasses.replace(job.settings, samples=1 << 20))
    refiner.show(endless)
    wait_for(lambda: refiner.picture and refiner.picture.samples > 2)
    refiner.pause(True)
    time.sleep(0.3)  # the sample under way
    held = refiner.picture
    time.sleep(0.3)
    assert refiner.picture is held
    refiner.pause(False)
    wait_for(lambda: refiner.picture is not held)
    assert refiner.picture.samples > held.samples and refiner.starts == 1
    refiner.close()


def test_what_changes_in_a_pause_is_shown_after_it(job):
    refiner = Refiner(lambda: True)
    refiner.show(job)
    wait_for(lambda: refiner.picture and refiner.picture.samples == 3)
    refiner.pause(True)
    held, other = refiner.picture, dataclasses.replace(turned(job, 1), paused=True)
    refiner.show(other)
    time.sleep(0.3)
    assert refiner.picture is held
    refiner.pause(False)
    wait_for(lambda: refiner.picture.job is other and refiner.picture.samples == 3)
    refiner.pause(True)
    refiner.show(dataclasses.replace(turned(job, 2), paused=True))
    refiner.close()  # nor does a pause keep anybody waiting
    assert not refiner.error


def turned(job, k):
    """The same, a little to the side."""
    matrix = job.camera.matrix.copy()
    matrix[0, 3] += 1e-4 * k
    return dataclasses.replace(job, camera=dataclasses.replace(job.camera, matrix=matrix))


@pytest.mark.parametrize("patience", [0.1, 2e-3])
def test_pictures_come_while_the_view_turns_all_the_time(job, monkeypatch, patience):
    """Each wish is newer before a first picture of the last is done, even if there is no time for one."""
    monkeypatch.setattr(refine, "PATIENCE", patience)
    monkeypatch.setattr(refine, "MOST_PATIENCE", 1.0)
    monkeypatch.setattr(refine, "POLL_SECONDS", 1e-4)
    shown = []
    refiner = Refiner(lambda: shown.append(refiner.picture.job) or True)
    end, k = time.monotonic() + 60, 0
    while len(shown) < 5 and time.monotonic() < end:
        refiner.show(turned(job, k := k + 1))
        time.sleep(0.0005)
    during = len(shown)
    last = turned(job, -1)
    refiner.show(last)
    wait_for(lambda: refiner.picture.job is last and refiner.picture.samples == 3)
    refiner.close()
    assert during >= 5 and not refiner.error


def test_the_first_picture_has_as_many_pixels_as_there_is_time_for():
    """However fast the machine, it is back at about the time aimed at after a few, and does not change its size all the time."""
    film = Film(width=1280, height=720, region=(0, 0, 1280, 720))
    for microseconds in (0.5, 8, 40, 300):  # a pixel
        first, sizes = refine.FirstPicture(), []
        for _ in range(8):
            scale = scales(film, first.pixels_of("path"))[0]
            width, height = reduced(film, scale).width, reduced(film, scale).height
            sizes.append(width * height)
            first.took(
                refine.Picture(
                    np.zeros((height, width, 4), np.float32), film.region, 0, 1e-6 * microseconds * sizes[-1], None
                )
            )
        assert sizes[0] <= refine.FIRST_PIXELS and len(set(sizes[-4:])) == 1
        seconds = 1e-6 * microseconds * sizes[-1]
        limits = sizes[-1] < refine.LEAST_PIXELS, sizes[-1] > refine.MOST_PIXELS / 2.5
        assert seconds < 1.1 * refine.AIM_SECONDS or limits[0]
        assert seconds > 0.3 * refine.AIM_SECONDS or limits[1]
    assert first.pixels_of("bdpt") == refine.FIRST_PIXELS  # another integrator: nothing is known of it


def test_closing_does_not_wait_for_what_cannot_be_left(job, monkeypatch):
    """Such as reading a large scene: Blender's window would stand still."""
    build, begun, goes_on = native.build_scene, threading.Event(), threading.Event()

    def slow(*words, **more):
        begun.set()
        goes_on.wait(30)
        return build(*words, **more)

    monkeypatch.setattr(native, "build_scene", slow)
    shown = viewport.Viewport(Engine())
    shown.submit(job)
    begun.wait(30)
    start = time.monotonic()
    shown.close()
    assert time.monotonic() - start < 1 and shown.refiner._thread.is_alive()
    goes_on.set()
    refine.close_all()  # as the add-on does when it is switched off
    assert not shown.refiner._thread.is_alive() and shown.refiner.picture is None


class Pulse:
    """The longest time for which Python's other threads could not go on."""

    def __enter__(self):
        self.longest, self.ends = 0.0, False
        self.thread = threading.Thread(target=self.beat)
        self.thread.start()
        return self

    def beat(self):
        last = time.monotonic()
        while not self.ends:
            time.sleep(0.001)
            now = time.monotonic()
            self.longest, last = max(self.longest, now - last), now

    def __exit__(self, *_):
        self.ends = True
        self.thread.join()


def test_native_work_leaves_python_to_others(job):
    """What is long and not rendering: taking many photons over and handing them out."""
    parameters = {"global_light": "GATHERED", "global_photons": 20_000, "caustic_photons": 100}
    settings = dataclasses.replace(job.settings, integrator="photon_map", samples=1, parameters=parameters)
    scene = dataclasses.replace(job.scene, camera=job.camera, film=reduced(job.film, 8))

    def rendered(kept=None):
        session = Session(scene, settings, kept=kept)
        with session:
            while not session.wait():
                pass
        return session

    kept = rendered().native.kept()
    head, rest = kept["global"][:1], kept["global"][1:]
    kept["global"] = np.concatenate([head, np.tile(rest, (3_000_000 // len(rest), 1))])
    many = rendered(kept)
    for work in (lambda: Session(scene, settings, built=many.native_scene, kept=kept), many.native.kept):
        with Pulse() as pulse:
            start = time.monotonic()
            held = work()
            took = time.monotonic() - start
        assert held and took > 0.05 and pulse.longest < 0.5 * took, (took, pulse.longest)


def test_a_viewport_that_is_gone_ends_its_thread(job):
    refiner = Refiner(lambda: False)
    refiner.show(dataclasses.replace(job, settings=dataclasses.replace(job.settings, samples=1 << 20)))
    refiner._thread.join(30)
    assert not refiner._thread.is_alive()


def of_integrator(job, integrator, camera_x=0.0, **parameters):
    settings = dataclasses.replace(job.settings, integrator=integrator, samples=1 << 20, parameters=parameters)
    matrix = job.camera.matrix.copy()
    matrix[0, 3] += camera_x
    return dataclasses.replace(job, settings=settings, camera=dataclasses.replace(job.camera, matrix=matrix))


@pytest.mark.parametrize(
    ("integrator", "shown", "parameters"),
    [
        ("irradiance_cache", "Cache Samples", {"record_samples": 32}),
        ("photon_map", "Photon Density", {"global_photons": 20_000, "caustic_photons": 1000}),
    ],
)
def test_caches_outlast_camera_moves_and_can_be_seen(job, integrator, shown, parameters):
    """Though the session that they were made in was stopped."""
    job.film.passes.append(shown)
    refiner = Refiner(lambda: True)
    refiner.show(of_integrator(job, integrator, **parameters))
    wait_for(lambda: refiner.picture and refiner.picture.samples > 0)
    moved = dataclasses.replace(of_integrator(job, integrator, 0.05, **parameters), shown=shown)
    refiner.show(moved)
    wait_for(lambda: refiner.picture.job is moved and refiner.picture.samples > 0)
    assert not refiner.error and (refiner.picture.pixels[..., 0] > 0).mean() > 0
    session = refiner._last.native
    refiner.close()
    assert session.figures()["cache records taken over"] > 10
    if integrator == "photon_map":
        assert "photon seconds" in session.figures()
        assert session.kept()["global"][0, 0] == parameters["global_photons"]


def test_a_first_look_at_photons_works_out_no_records(job):
    """It has no time for them, and shows all light nevertheless."""
    wish = of_integrator(job, "photon_map", global_light="CACHED", global_photons=3_000_000, caustic_photons=1000)
    scene = dataclasses.replace(wish.scene, camera=wish.camera, film=reduced(wish.film, 8))
    settings = dataclasses.replace(wish.settings, samples=1, time_limit=0.2)
    sessions, pictures = [None], []
    for _ in range(2):
        sessions.append(
            Session(scene, settings, earlier=sessions[-1], built=sessions[-1] and sessions[-1].native_scene)
        )
        with sessions[-1] as session:
            while not session.wait():
                pass
        pictures.append(session.read("Combined")[..., :3].mean())
    assert ["cache records" in session.native.figures() for session in sessions[1:]] == [True, False]
    assert pictures[1] == pytest.approx(pictures[0], rel=0.2) and pictures[1] > 0.01


class Engine:
    """Counts how often it is to be drawn."""

    tags = 0

    def tag_redraw(self):
        self.tags += 1


def test_a_change_is_drawn_though_blender_does_not_ask_for_it(lit):
    engine = Engine()
    shown = viewport.Viewport(engine)
    shown.update(SimpleNamespace(space_data=None), bpy.context.evaluated_depsgraph_get())
    assert engine.tags == 1 and not shown.failure
    shown.close()


def test_the_header_says_that_there_is_no_denoiser(job):
    job.settings.denoising = Denoising("NONE", "FAST", "FAST")
    shown = viewport.Viewport(engine := Engine())
    shown.refiner.denoiser = ()  # folders to look in
    shown.submit(job)
    wait_for(lambda: shown.refiner.picture and shown.refiner.picture.samples == 3)
    assert "No denoiser" in shown.status(shown.refiner.picture) and engine.tags
    shown.close()


@pytest.mark.parametrize("ends", ["camera", "close"])
def test_nothing_waits_for_the_denoiser(job, monkeypatch, ends):
    """A camera's move is shown while it is at work; of what is out of date, nothing is shown."""
    asked, found = [], np.full((200, 320, 4), 7, np.float32)

    def slow(pixels, guides, folders, quality, prefilter, stopped):
        asked.append(pixels.shape)
        end = time.monotonic() + 60
        while len(asked) == 1 and time.monotonic() < end:
            if stopped():
                raise refine.Stopped
            time.sleep(0.01)
        return found

    monkeypatch.setattr(refine, "denoise", slow)
    monkeypatch.setattr(refine, "load", lambda folders: True)
    job.settings.denoising = Denoising("NONE", "FAST", "FAST")
    refiner = Refiner(lambda: True)
    refiner.show(job)
    wait_for(lambda: asked and refiner.picture.samples == 3)
    assert not refiner.picture.clean
    if ends == "camera":
        moved = turned(job, 5)
        refiner.show(moved)
        wait_for(lambda: refiner.picture.job is moved and refiner.picture.clean)
        assert np.array_equal(refiner.picture.pixels, found) and asked[-1] == (200, 320, 4)
    refiner.close()
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("GI Engine")]


def test_the_same_job_is_not_begun_again(job):
    again = dataclasses.replace(job, camera=dataclasses.replace(job.camera, matrix=job.camera.matrix.copy()))
    assert viewport.same_job(again, job) and viewport.same_job(dataclasses.replace(again, paused=True), job)
    again.camera.matrix[0, 3] += 1
    assert not viewport.same_job(again, job) and not viewport.same_job(job, None)


# The add-on as a whole


def traces() -> tuple:
    handlers = [
        len(getattr(bpy.app.handlers, n))
        for n in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, n), list)
    ]
    ours = [name for name in dir(bpy.types) if name.startswith(("GI_", "GIEngine"))]
    joined = [n for n in dir(bpy.types) if "GI_ENGINE" in getattr(getattr(bpy.types, n), "COMPAT_ENGINES", ())]
    owners = [t.__name__ for t in (bpy.types.Scene, bpy.types.ViewLayer, bpy.types.Object) if hasattr(t, "gi_engine")]
    return handlers, ours, joined, owners, sorted(t.name for t in threading.enumerate())


def test_registering_twice_leaves_no_trace(job):
    """Handlers, classes, panels joined, properties, threads; a viewport that is open is closed."""
    registered = traces()
    gi_engine.unregister()
    try:
        without = traces()
        assert without[1:4] == ([], [], [])
        gi_engine.register()
        gi_engine.unregister()
        assert traces() == without
    finally:
        gi_engine.register()
    assert traces() == registered
