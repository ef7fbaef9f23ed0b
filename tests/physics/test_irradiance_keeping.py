"""What irradiance caching keeps from frame to frame: no flicker of still things, no trace of moved ones; time limits of the overture."""

import dataclasses
import math

import numpy as np
import pytest
from light_scenes import lamp, matrix
from test_closed_forms import cube, quad, scene_of

from gi_engine import content
from gi_engine import scene_data as sd
from gi_engine.nodes.program import ProgramBuilder
from gi_engine.session import Session

PIXELS = 32
SIZE = 3.0  # metres across the picture


def surface(albedo):
    b = ProgramBuilder()
    b.op("diffuse", 1.0, (albedo,) * 3, 0.0, (0, 0, 0))
    return b.finish("surface")


def eye(x):
    """Looks down on a floor; `x` in pixels."""
    h = SIZE / 2
    return sd.Camera("camera", "ORTHO", matrix((x * SIZE / PIXELS, 0, 1.9)), (-h, h, -h, h), 0.0, 100.0)


def room(*more):
    """4 m wide, lit by a point near a wall: direct light has no noise."""
    bulb = lamp("POINT", (60.0,) * 3, matrix=matrix((-1.5, 1.2, -1.0)), radius=0.0)
    return scene_of((cube(2.0), surface(0.7)), *more, lights=[bulb])


def finish(session):
    with session:
        while not session.wait():
            pass
    return session


def render(scene, camera, kept=None, path=(), samples=64, time_limit=0.0, pixels=PIXELS, **parameters):
    scene = dataclasses.replace(scene, camera=camera, film=sd.Film(pixels, pixels, filter="BOX", filter_width=1.0))
    settings = sd.Settings("irradiance_cache", samples, time_limit=time_limit, seed=1, threads=2, parameters=parameters)
    session = finish(Session(scene, settings, kept=kept, path=path, steady=kept is not None))
    return session.read("Combined")[..., 0].astype(np.float64), session.native.kept(), session


def flicker(pictures, step):
    """Relative variance over frames of each place that all of them see; the camera moves by `step` pixels a frame."""
    count = len(pictures)
    seen = PIXELS - step * (count - 1)
    places = np.array([p[:, step * (count - 1 - k) :][:, :seen] for k, p in enumerate(pictures)])
    return float((places.var(0, ddof=1) / places.mean(0) ** 2).mean())


def test_a_still_floor_does_not_flicker():
    frames, step, settings = 5, 2, {"record_samples": 64}
    eyes = [eye(step * k - 4) for k in range(frames)]
    scene = room()
    alone = [render(scene, e, **settings)[0] for e in eyes]
    kept, along, one_by_one = None, [], []
    for e in eyes:
        picture, kept, _ = render(scene, e, kept, () if along else eyes, **settings)
        along.append(picture)
    kept = None
    for e in eyes:
        picture, kept, _ = render(scene, e, kept, **settings)
        one_by_one.append(picture)
    # Pictures move by whole pixels: the same light, the same places.
    assert np.mean(along) == pytest.approx(np.mean(alone), rel=0.02)
    before, filled, grown = (flicker(pictures, step) for pictures in (alone, along, one_by_one))
    assert before > 1e-4  # or there is nothing to prove
    assert filled < 0.02 * before, f"{filled:.2e}, without {before:.2e}"
    assert grown < 0.1 * before, f"{grown:.2e}, without {before:.2e}"


def block(x):
    """A dark little wall that stands on the floor."""
    return quad((x, -0.15, -2), (x, 0.15, -2), (x, 0.15, -1.7), (x, -0.15, -1.7)), surface(0.05)


def test_records_near_moved_objects_are_dropped():
    settings = sd.Settings("irradiance_cache")
    before, after = room(block(0.6)), room(block(0.9))
    change = content.compare(content.content_of(before, settings), content.content_of(after, settings))
    assert change.reason == ""
    assert change.names
    options = {"record_samples": 4096, "samples": 32}
    _, kept, _ = render(before, eye(0), **options)
    truth, _, _ = render(after, eye(0), **options)
    stale, _, _ = render(after, eye(0), kept, **options)
    left = {name: t[content.far_from(change.boxes, t[:, :3], t[:, 3:6])] for name, t in kept.items()}
    assert 0.05 < len(left["bounce 1"]) / len(kept["bounce 1"]) < 0.95
    renewed, _, _ = render(after, eye(0), left, **options)

    def off(picture):
        near = np.s_[11:21, 19:29]  # the floor between the two places and around them
        return float(np.sqrt(((picture - truth)[near] ** 2).mean() / (truth[near] ** 2).mean()))

    assert off(stale) > 2 * off(renewed), (off(stale), off(renewed))
    assert off(renewed) < 0.05


def test_tables_of_something_else_are_refused():
    _, kept, _ = render(room(), eye(0), samples=1)
    for name, table, message in (
        ("photons", np.zeros((2, 38), np.float32), "is no table of irradiance records"),
        ("bounce 1", np.zeros((2, 37), np.float32), "is no table of irradiance records"),
        ("bounce 1", np.full((2, 38), np.nan, np.float32), "row 0: no irradiance record"),
    ):
        with pytest.raises(RuntimeError, match=message):
            render(room(), eye(0), {**kept, name: table})


def test_the_overture_takes_its_share_of_the_time_and_no_more():
    limit = 1.0
    long = {"record_samples": 1024, "error": 0.05, "min_spacing": 0.5}  # far more than there is time for
    picture, kept, session = render(room(), eye(0), samples=0, time_limit=limit, pixels=256, **long)
    progress, figures = session.progress(), session.native.figures()
    assert 0.3 * limit < figures["cache overture seconds"] < 0.7 * limit
    assert progress["seconds"] > limit
    assert progress["passes"] > 0
    assert len(kept["bounce 1"]) > 10
    assert math.isfinite(picture.mean())
    _, _, unlimited = render(room(), eye(0), samples=1, pixels=64, record_samples=64)
    assert f"{unlimited.native.figures()['cache records']:.0f} records" in unlimited.progress()["note"]


@pytest.mark.parametrize("moments", [(0.0, 0.002, 0.01, 0.05), (0.02,) * 8, (0.3, 0.3)])
def test_what_was_stopped_anywhere_serves_on(moments):
    """As often as a camera moves: the light is that of a render which nobody stopped, and nothing that is known is worked out again."""
    truth, _, whole = render(room(), eye(0), samples=32)
    scene = dataclasses.replace(room(), camera=eye(0), film=sd.Film(PIXELS, PIXELS, filter="BOX", filter_width=1.0))
    settings = sd.Settings("irradiance_cache", 32, seed=1, threads=2)
    session = None
    for moment in moments:
        session = Session(scene, settings, built=session and session.native_scene, earlier=session)
        session.native.start()
        session.native.wait(moment)
        session.native.cancel()
        while not session.native.wait(0.05):
            pass
    last = finish(Session(scene, settings, built=session.native_scene, earlier=session))
    figures = last.native.figures()
    # Of 25 such renders the mean's standard deviation is .4 %, and pixels are off by 1.2 % on average.
    picture = last.read("Combined")[..., 0]
    assert picture.mean() == pytest.approx(truth.mean(), rel=0.02)
    assert np.abs(picture / truth - 1).mean() < 0.04
    assert 0.9 < figures["cache records"] / whole.native.figures()["cache records"] < 1.15
    again = finish(Session(scene, settings, built=session.native_scene, earlier=last)).native.figures()
    assert again["cache records taken over"] >= figures["cache records"] and again["cache records worked out"] < 20
