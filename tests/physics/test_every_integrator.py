"""What every integrator must do, those to come included: they are taken from the registry."""

import math
import os
import time
from pathlib import Path

import numpy as np
import pytest
from light_scenes import lamp, matrix
from test_closed_forms import BOUNCES, cube, looking, probe, quad, scene_of, shiny, sphere, surface

from gi_engine import native
from gi_engine import scene_data as sd
from gi_engine.session import Session

DESCRIPTORS = {descriptor["id"]: descriptor for descriptor in native.integrators()}
every = pytest.mark.parametrize("integrator", DESCRIPTORS)
# What leaves light between diffuse surfaces out, by intention.
WITHOUT_INTERREFLECTION = {"whitted", "distributed"}


def room():
    floor = quad((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0))
    bulb = lamp("POINT", (50.0,) * 3, matrix=matrix((0, 0, 1.5)), radius=0.2)
    return scene_of((floor, surface(0.5)), (sphere(0.5, 16), shiny(0.3)), (cube(3.0), surface(0.7)), lights=[bulb])


FEW = {"photons": 20_000, "global_photons": 20_000, "caustic_photons": 20_000, "particles": 20_000}


def parameters(integrator: str, wishes: dict) -> dict:
    known = {parameter["name"] for parameter in DESCRIPTORS[integrator]["parameters"]}
    return {name: value for name, value in wishes.items() if name in known}


@every
def test_any_number_of_threads_makes_the_same_image(integrator):
    few = parameters(integrator, FEW)
    images = [
        probe(room(), (0, 0, 2), (0, 0.1, -1), samples=3, pixels=65, width=3.0, integrator=integrator, threads=n, **few)
        for n in (1, 2, 3)
    ]
    assert images[0].std() > 0
    assert np.array_equal(images[0], images[1])
    assert np.array_equal(images[0], images[2])


@pytest.mark.parametrize("integrator", [i for i in DESCRIPTORS if i not in WITHOUT_INTERREFLECTION])
def test_closed_furnace(integrator):
    """A box that glows and reflects half: radiance 2 everywhere. Seen away from the edges, where discs of photons are cut."""
    scene = scene_of((cube(), surface(0.5, 1.0)))
    at = {"samples": 32, "pixels": 16, "width": 0.5, **parameters(integrator, BOUNCES | FEW)}
    runs = [
        probe(scene, (0.1, 0.2, -0.1), (0.1, 0, 0.8), integrator=integrator, seed=seed, **at).mean()
        for seed in range(1, 6)
    ]
    error = np.std(runs, ddof=1) / math.sqrt(len(runs))
    assert abs(np.mean(runs) - 2) < 6 * error + 0.01, f"{np.mean(runs):.4f} ± {error:.4f}"
    assert error < 0.05


@pytest.mark.parametrize("integrator", [i for i in DESCRIPTORS if i not in WITHOUT_INTERREFLECTION])
def test_integrating_sphere(integrator):
    """A point of light in a sphere of albedo .5: the same radiance everywhere, power ρ / (π surface (1 − ρ))."""
    ball = scene_of((sphere(rings=32), surface(0.5)), lights=[lamp("POINT", (4 * math.pi**2,) * 3, matrix=matrix())])
    at = {"samples": 32, "pixels": 16, "width": 0.5, **parameters(integrator, BOUNCES | FEW)}
    runs = [
        probe(ball, (0.2, 0.1, 0), (0.5, 0.3, 0.7), integrator=integrator, seed=seed, **at).mean()
        for seed in range(1, 6)
    ]
    error = np.std(runs, ddof=1) / math.sqrt(len(runs))
    assert abs(np.mean(runs) - 1) < 6 * error + 0.012, f"{np.mean(runs):.4f} ± {error:.4f}"
    assert error < 0.03


def session_of(integrator: str, samples: int, pixels: int, passes=("Combined",), threads=2, **wishes):
    scene = room()
    scene.camera = sd.Camera("camera", "ORTHO", looking((0, 0, 2), (0, 0.1, -1)), (-1.5, 1.5, -1.5, 1.5), 0.0, 1e6)
    scene.film = sd.Film(pixels, pixels, filter="BOX", filter_width=1.0, passes=list(passes))
    return Session(scene, sd.Settings(integrator, samples, threads=threads, parameters=parameters(integrator, wishes)))


@every
def test_it_counts_its_passes(integrator):
    seen = []
    with session_of(integrator, 5, 16, **FEW) as session:
        while not session.wait():
            seen.append(session.progress())
        seen.append(session.progress())
    assert seen[-1]["passes"] == 5 and seen[-1]["rays"] > 0 and not seen[-1].get("error")
    for before, after in zip(seen, seen[1:], strict=False):
        assert before["passes"] <= after["passes"] and before["rays"] <= after["rays"]


@every
def test_sessions_leave_no_memory_behind(integrator):
    def resident():
        pages = Path("/proc/self/statm").read_text().split()[1]
        return int(pages) * os.sysconf("SC_PAGE_SIZE") / 1e6

    found = []
    for _ in range(12):
        with session_of(integrator, 1, 32, **FEW) as session:
            while not session.wait():
                pass
        found.append(resident())
    assert found[-1] - found[5] < 20, found


def test_no_thread_works_on_after_a_render_by_one():
    """TBB, limited to one thread, leaves one that asks for work for ever."""
    for _ in range(3):
        with session_of("path", 1, 8, threads=1) as session:
            while not session.wait():
                pass
    before = time.process_time()
    time.sleep(0.5)
    assert time.process_time() - before < 0.1


@every
@pytest.mark.parametrize("after", [0.05, 1.0])
def test_cancel_is_heard(integrator, after):
    """While it prepares and while it renders, within half a second (and what a loaded machine adds)."""
    with session_of(integrator, 1_000_000, 512) as session:
        time.sleep(after)
        start = time.perf_counter()
        session.native.cancel()
        while not session.wait():
            pass
        assert time.perf_counter() - start < 1.0


@every
def test_data_passes_are_path_tracings(integrator):
    names = ["Combined", "Depth", "Normal", "Position", "Denoising Albedo", "Object Index"]

    def data(which):
        with session_of(which, 8, 32, names, **FEW) as session:
            while not session.wait():
                pass
            return {name: session.read(name) for name in names[1:]}

    ours, theirs = data(integrator), data("path")
    for name in names[1:]:
        # Their camera rays are the same, so only where they end at glossy surfaces' edges could they differ.
        np.testing.assert_allclose(ours[name], theirs[name], rtol=1e-4, atol=1e-4, err_msg=name)
