"""Integrators that claim to be unbiased agree: block by block of the picture, on scenes that strain one way of walking or the other."""

import functools

import numpy as np
import pytest
from agreement_scenes import CAMERAS, CAUSTICS, SCENES, STRANDS, WIDE
from light_scenes import lamp, matrix

from gi_engine import scene_data as sd
from gi_engine.session import Session

SEEDS, BLOCKS = 10, 4  # renders that differences are judged by; blocks across the picture
Z_MEAN, Z_BLOCK = 5.0, 9.0  # standard errors; blocks have tails, their errors are estimates from few renders
LIMITS = {f"{kind}_bounces": 5 for kind in ("max", "diffuse", "glossy", "transmission")}
MIRRORS = "it sees nothing in mirrors and through clear glass"


def render(scene, integrator, samples, seed, pixels=32, threads=2, **parameters):
    scene.film = sd.Film(pixels, pixels)
    settings = sd.Settings(integrator, samples, seed=seed, threads=threads, parameters={**LIMITS, **parameters})
    with Session(scene, settings) as session:
        while not session.wait():
            pass
        assert session.progress()["bad_samples"] == 0
        return session.read("Combined")[..., :3].astype(np.float64)


@functools.cache
def measured(integrator, name, camera, samples, **parameters):
    """Means of blocks, and of the picture: (SEEDS, BLOCKS² · 3), (SEEDS,)."""
    found = []
    for seed in range(SEEDS):
        scene = {**SCENES, **CAUSTICS, **WIDE, **STRANDS}[name]()
        scene.camera = CAMERAS[camera]()
        image = render(scene, integrator, samples, seed + 1, **parameters)
        size = len(image) // BLOCKS
        found.append(image.reshape(BLOCKS, size, BLOCKS, size, 3).mean((1, 3)).ravel())
    return np.array(found)


def assert_agree(a, b):
    # A block that a way hardly ever lights says nothing of its own error.
    lit = ((a > 0).mean(0) > 0.5) & ((b > 0).mean(0) > 0.5) | ((a == 0).all(0) & (b == 0).all(0))
    assert lit.mean() > 0.5
    for x, y, most in ((a.mean(1)[:, None], b.mean(1)[:, None], Z_MEAN), (a[:, lit], b[:, lit], Z_BLOCK)):
        error = np.sqrt((x.var(0, ddof=1) + y.var(0, ddof=1)) / SEEDS) + 5e-4 * np.abs(x.mean(0)) + 1e-7
        z = np.abs(x.mean(0) - y.mean(0)) / error
        k = z.argmax()
        assert z[k] < most, f"{y.mean(0)[k]:.5f} instead of {x.mean(0)[k]:.5f} ± {error[k]:.5f}"


@pytest.mark.parametrize("name", [*SCENES, *CAUSTICS])
def test_bidirectional_agrees_with_path_tracing(name):
    assert_agree(measured("path", name, "perspective", 16), measured("bdpt", name, "perspective", 8))


@pytest.mark.parametrize("name", STRANDS)
def test_light_bounces_off_strands_as_in_path_tracing(name):
    assert_agree(measured("path", name, "perspective", 32), measured("bdpt", name, "perspective", 16))


@pytest.mark.parametrize("connections", [1, 40])
@pytest.mark.parametrize("name", ["rough glass", "transparent shadows"])
def test_the_number_of_connections_does_not_change_the_mean(name, connections):
    found = measured("bdpt", name, "perspective", 8, connections=connections)
    assert_agree(measured("path", name, "perspective", 16), found)


@pytest.mark.parametrize("name", SCENES)  # not CAUSTICS: see MIRRORS
def test_light_tracing_agrees_with_path_tracing(name):
    assert_agree(measured("path", name, "perspective", 16), measured("light", name, "perspective", 32))


@pytest.mark.parametrize("camera", list(CAMERAS)[1:])
@pytest.mark.parametrize("integrator", ["light", "bdpt"])
def test_every_camera_sees_the_same(integrator, camera):
    assert_agree(measured("path", "area lamp", camera, 16), measured(integrator, "area lamp", camera, 16))


@pytest.mark.parametrize("integrator", ["light", "bdpt"])
def test_any_number_of_threads_makes_the_same_image(integrator):
    def image(threads):
        scene = SCENES["area lamp"]()
        scene.camera = CAMERAS["perspective"]()
        return render(scene, integrator, 4, 1, pixels=65, threads=threads)

    images = [image(n) for n in (1, 2, 3)]
    assert images[0].std() > 0
    assert np.array_equal(images[0], images[1])
    assert np.array_equal(images[0], images[2])


def test_a_region_shows_what_the_whole_picture_would():
    """Light subpaths of a region are its own, but their light is the whole picture's."""
    whole, part = [], []
    for seed in range(SEEDS):
        for found, region in ((whole, None), (part, (8, 4, 24, 28))):
            scene = SCENES["area lamp"]()
            scene.camera = CAMERAS["perspective"]()
            scene.film = sd.Film(32, 32, region=region) if region else sd.Film(32, 32)
            with Session(scene, sd.Settings("bdpt", 16, seed=seed + 1, threads=2, parameters=LIMITS)) as session:
                while not session.wait():
                    pass
                image = session.read("Combined")[..., :3].astype(np.float64)
            found.append((image if region else image[4:28, 8:24]).reshape(3, 8, 2, 8, 3).mean((1, 3)).ravel())
    assert_agree(np.array(whole), np.array(part))


# ------------------------------------------------------------------------------------------------ strategies

# (s, t): vertices from the light, vertices from the eye. Paths of three vertices: direct light.
DIRECT = [(0, 3), (1, 2), (2, 1)]
# And of four: once reflected.
INDIRECT = [(0, 4), (1, 3), (2, 2), (3, 1)]


@pytest.mark.parametrize("name", WIDE)
@pytest.mark.parametrize("ways", [DIRECT, INDIRECT])
def test_every_strategy_alone_has_the_mean_of_the_others(name, ways):
    alone = {
        way: measured("bdpt", name, "perspective", 16, only_s=way[0], only_t=way[1], weighted="false") for way in ways
    }
    together = sum(measured("bdpt", name, "perspective", 12, only_s=s, only_t=t) for s, t in ways)
    for way in ways:
        assert alone[way].mean() > 0
        assert_agree(alone[way], together)


@pytest.mark.parametrize("heuristic", ["POWER", "BALANCE"])
def test_weights_add_up_to_one(heuristic):
    """Every path counts once: in a closed furnace of radiance 1 / (1 - albedo) all ways together give just that."""
    from test_closed_forms import check, cube, probe, scene_of, surface

    scene = scene_of((cube(), surface(0.5, 1.0)))
    check(
        probe(
            scene,
            (0.1, 0.2, -0.1),
            (0.3, 0.5, 0.8),
            integrator="bdpt",
            heuristic=heuristic,
            samples=128,
            max_bounces=60,
            diffuse_bounces=60,
        ),
        2.0,
    )


@pytest.mark.parametrize("bounces", [0, 1, 7])
def test_bidirectional_in_an_integrating_sphere(bounces):
    """Unit sphere of albedo .5, intensity pi at its centre: n bounces leave 1 - 2^-(n+1) [pbrt-v4]."""
    from test_closed_forms import check, probe, scene_of, sphere, surface

    bulb = lamp("POINT", (4 * np.pi * np.pi,) * 3, matrix=matrix((0, 0, 0)))
    limits = {"max_bounces": bounces, "diffuse_bounces": bounces, "samples": 64}
    found = probe(
        scene_of((sphere(), surface(0.5)), lights=[bulb]),
        (0.2, 0.1, 0.0),
        (0.5, 0.3, 0.7),
        integrator="bdpt",
        **limits,
    )
    check(found, 1 - 0.5 ** (bounces + 1), rounding=2e-3)
