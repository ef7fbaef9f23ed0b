"""What a viewport relies on: scenes made of parts of an earlier one show the same as fresh ones, and what a session that was stopped has
worked out of a scene's light serves the next, without a bias."""

import dataclasses
import time

import numpy as np
import pytest
from light_scenes import lamp, matrix
from test_closed_forms import cube, quad
from test_irradiance_keeping import PIXELS, eye, room, surface

from gi_engine import native
from gi_engine import scene_data as sd
from gi_engine.session import RenderFailed, Session

FILM = sd.Film(PIXELS, PIXELS, filter="BOX", filter_width=1.0)
PHOTONS = {"global_photons": 40_000, "caustic_photons": 20_000}
WAYS = {"irradiance_cache": {"record_samples": 512}, "photon_map": PHOTONS}


def run(scene, settings, built, earlier=None, camera=0, stop_after=None):
    """A session that has ended, or was cancelled so many seconds after its start."""
    scene = dataclasses.replace(scene, camera=eye(camera), film=FILM)
    session = Session(scene, settings, built=built, earlier=earlier)
    with session:
        end = time.monotonic() + (stop_after if stop_after is not None else 600)
        while not session.native.wait(0.002) and time.monotonic() < end:
            pass
    return session


def picture(scene, built, samples=4):
    session = run(scene, sd.Settings("path", samples, seed=1, threads=2), built)
    return session.read("Combined")


def edited():
    """A room with a board in it, of which the board is turned, then painted, then bent."""
    first = room((quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)), surface(0.5)))
    turned = dataclasses.replace(first, instances=list(first.instances))
    tilt = matrix((0.1, 0.3, 0.2)) @ np.diag([1, 1.5, 1, 1]).astype(np.float32)
    turned.instances[1] = dataclasses.replace(first.instances[1], matrix=tilt)
    painted = dataclasses.replace(
        turned, programs=[surface(0.2), *turned.programs[1:]], lights=[lamp("SUN", (3.0,) * 3)]
    )
    mesh = painted.meshes[1]
    bent = dataclasses.replace(
        mesh, positions=mesh.positions + np.float32([[0, 0, 0.3], [0, 0, 0], [0, 0, 0], [0, 0, 0]])
    )
    return [first, turned, painted, dataclasses.replace(painted, meshes=[painted.meshes[0], bent])]


def test_a_scene_made_of_an_earlier_one_shows_what_a_fresh_one_does():
    before = None
    for scene in edited():
        before = native.build_scene(scene, 2, movable=True, before=before)
        fresh = native.build_scene(scene, 2, movable=True)
        np.testing.assert_array_equal(picture(scene, before), picture(scene, fresh))
        # One that does not move has its vertices elsewhere in the last digit.
        still = picture(scene, native.build_scene(scene, 2), 64)
        np.testing.assert_allclose(picture(scene, before, 64), still, rtol=0.05, atol=0.05 * still.mean())


def test_what_is_flat_by_its_matrix_is_shown_and_can_be_raised():
    def flat(z):
        scene = room((cube(0.3), surface(0.5)))
        scene.instances[1].matrix = np.diag([1, 1, z, 1]).astype(np.float32)
        return scene

    first = flat(0)
    before = native.build_scene(first, 2, movable=True)
    np.testing.assert_allclose(picture(first, before), picture(first, native.build_scene(first, 2)), rtol=1e-3)
    raised = dataclasses.replace(first, instances=[first.instances[0], flat(1).instances[1]])
    after = native.build_scene(raised, 2, movable=True, before=before)
    np.testing.assert_array_equal(picture(raised, after), picture(raised, native.build_scene(raised, 2, movable=True)))


def test_meshes_that_are_the_same_are_not_built_again():
    rng = np.random.default_rng(1)
    n = 200_000
    positions = rng.random((3 * n, 3), np.float32)
    corners = np.arange(3 * n, dtype=np.int32)
    big = sd.Mesh("big", positions, corners, None, None, None, "FACE", None)
    scene = room()
    scene.meshes.append(big)
    scene.instances.append(sd.Instance("big", 1, matrix((0, 0, -0.5)), [0]))

    def seconds(before):
        start = time.process_time()
        built = native.build_scene(scene, 1, movable=True, before=before)
        return time.process_time() - start, built

    first, built = seconds(None)
    again = min(seconds(built)[0] for _ in range(3))
    assert again < 0.1 * first


@pytest.mark.parametrize("way", WAYS)
def test_work_that_was_stopped_serves_on(way):
    """Stopped again and again, each time a little later, and seen from elsewhere: it comes to an end, and to the same picture."""
    scene = room()
    built = native.build_scene(scene, 2, movable=True)
    settings = sd.Settings(way, 16, seed=1, threads=2, parameters=WAYS[way])
    last = None
    for k in range(12):
        last = run(scene, settings, built, last, camera=k % 5, stop_after=0.01 * k)
    found = run(scene, settings, built, last).read("Combined")[..., 0]
    truth = run(scene, sd.Settings("path", 512, seed=2, threads=2), built).read("Combined")[..., 0]
    assert found.mean() == pytest.approx(truth.mean(), rel=0.02)
    blocks = [p.reshape(4, PIXELS // 4, 4, PIXELS // 4).mean((1, 3)) for p in (found, truth)]
    np.testing.assert_allclose(*blocks, rtol=0.08)


def test_no_photon_is_kept_twice():
    """Where sending is stopped, what was under way is either kept and counted or neither: as many a path as when it is not stopped. The
    moment in which that can go wrong is short: of 20 renders, each stopped 20 times, one or so met it."""
    scene = dataclasses.replace(room(), camera=eye(0), film=FILM)
    built = native.build_scene(scene, 2, movable=True)
    settings = sd.Settings("photon_map", 1, seed=1, threads=2, parameters=PHOTONS)
    sent = run(scene, settings, built).native.kept()["global"].shape[0]
    moments = np.random.default_rng(3)
    for _ in range(20):
        last = None
        for stop_after in moments.uniform(0, 0.06, 20):
            session = Session(scene, settings, built=built, earlier=last)
            with session:
                end = time.monotonic() + stop_after
                while time.monotonic() < end:
                    session.native.wait(0)
            last = session
        kept = run(scene, settings, built, last).native.kept()["global"]
        assert kept[0, 0] == PHOTONS["global_photons"]
        assert kept.shape[0] == pytest.approx(sent, rel=0.02)  # a batch more: 6 %


@pytest.mark.parametrize("way", WAYS)
def test_what_is_known_makes_the_next_picture_quick(way):
    scene = room()
    built = native.build_scene(scene, 2, movable=True)
    settings = sd.Settings(way, 1, seed=1, threads=2, parameters=WAYS[way])
    first = run(scene, settings, built)
    rays = first.progress()["rays"]  # of all sessions of the scene
    second = run(scene, dataclasses.replace(settings, time_limit=0.2), built, first, camera=1)
    assert second.progress()["rays"] - rays < 0.3 * rays
    if way == "photon_map":
        kept = second.native.kept()
        assert kept["global"][0, 0] == PHOTONS["global_photons"] and kept["caustic"][0, 0] == PHOTONS["caustic_photons"]


def test_only_what_is_alike_goes_on():
    scene = room()
    built, other = native.build_scene(scene, 2), native.build_scene(scene, 2)
    settings = sd.Settings("irradiance_cache", 1, seed=1, threads=2, parameters=WAYS["irradiance_cache"])
    first = run(scene, settings, built)
    for wrong in (
        {"built": other, "settings": settings},
        {"built": built, "settings": dataclasses.replace(settings, integrator="path", parameters={})},
        {"built": built, "settings": dataclasses.replace(settings, parameters={"error": 0.3})},
    ):
        with pytest.raises(RenderFailed, match="another scene, integrator or parameters"):
            run(scene, wrong["settings"], wrong["built"], first)
