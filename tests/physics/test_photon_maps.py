"""What photon maps hold, and what they say at borders and under a lens: balances of energy, closed forms, light tracing."""

import math

import numpy as np
import pytest
from light_scenes import lamp, matrix
from test_closed_forms import BOUNCES, cube, glass, looking, quad, scene_of, shiny, sphere, surface

from gi_engine import scene_data as sd
from gi_engine.nodes.program import ProgramBuilder
from gi_engine.session import Session

POWERS = slice(7, 10)  # columns of a table of photons


def render(integrator, scene, position, direction, width, samples=4, pixels=16, seed=1, **parameters):
    """First channel, and the tables that are kept."""
    half = width / 2
    scene.camera = sd.Camera("camera", "ORTHO", looking(position, direction), (-half, half, -half, half), 0.0, 1e6)
    scene.film = sd.Film(pixels, pixels, filter="BOX", filter_width=1.0)
    settings = sd.Settings(integrator, samples, seed=seed, threads=2, parameters={**BOUNCES, **parameters})
    with Session(scene, settings) as session:
        while not session.wait():
            pass
        return session.read("Combined")[..., 0].astype(np.float64), session.native.kept()


def power_of(table):
    """Of all photons together, watts in one channel; the first row says how many paths were sent."""
    return table[1:, POWERS].sum(0, dtype=np.float64)[0] / table[0, 0]


@pytest.mark.parametrize("albedo", [0.3, 0.7])
def test_a_closed_box_holds_all_power(albedo):
    """Each bounce leaves what came, and sends on its share: P Σ ρⁱ. Of those, what has met no surface yet is direct."""
    scene = scene_of((cube(), surface(albedo)), lights=[lamp("POINT", (12.0,) * 3, matrix=matrix((0.2, 0.1, -0.3)))])
    bounces = {"max_bounces": 4, "diffuse_bounces": 4, "caustic_photons": 100}
    for way, first in (("GATHERED", 0), ("PHOTONS", 1)):
        photons = {"global_photons": 100_000, "global_light": way}
        _, kept = render("photon_map", scene, (0, 0, 0), (0, 0, -1), 0.1, **photons, **bounces)
        truth = 12 * sum(albedo**i for i in range(first, 5))
        assert power_of(kept["global"]) == pytest.approx(truth, rel=0.01, abs=1e-9)
        assert len(kept["caustic"]) == 1


def test_an_open_scene_holds_what_does_not_escape():
    """A square seen from the middle of a cube that it would be a face of: a sixth of the power."""
    square = quad((-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1))
    scene = scene_of((square, surface(0.5)), lights=[lamp("POINT", (6.0,) * 3, matrix=matrix())])
    _, kept = render("photon_map", scene, (0, 0, 0), (0, 0, -1), 1.9, global_photons=100_000, caustic_photons=100)
    assert power_of(kept["global"]) == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize("balls", [[(0.3, 1.5)], [(0.3, 1.5), (0.2, 1.33), (0.1, 0.8)]], ids=["one", "nested"])
def test_glass_takes_nothing_and_holds_no_photons(balls):
    """What falls on a clear ball of which the lamp sees the cone of sine 1/2 comes to the box around it, as caustics; balls in it, of other
    indices, change where it goes."""
    light = lamp("POINT", (1.0,) * 3, matrix=matrix((0.6, 0, 0)))
    bodies = [(sphere(radius), glass(ior)) for radius, ior in balls]
    scene = scene_of((cube(), surface(0.001)), *bodies, lights=[light])
    sent = {"global_photons": 100_000, "caustic_photons": 200_000}
    _, kept = render("photon_map", scene, (0, 0, -0.5), (0, 0, -1), 0.1, **sent)
    assert power_of(kept["global"]) == pytest.approx(1.001, rel=0.005)
    assert power_of(kept["caustic"]) == pytest.approx((1 - math.sqrt(3) / 2) / 2, rel=0.02)
    assert (np.abs(kept["caustic"][1:, :3]).max(1) > 0.99).all()


def test_caustic_photons_are_of_like_power():
    """Of walls that are half diffuse, and throw a tenth back as gloss, every photon is a caustic one in part: P Σ (1/10)ⁱ together. The many
    small parts are few photons of about the same power, so that as many neighbours count."""
    b = ProgramBuilder()
    b.op("diffuse", 0.5, (1, 1, 1), 0.0, (0, 0, 0))
    b.op("glossy", 0.1, (1, 1, 1), 0.5, 0.0, 0.0, (0, 0, 0), (0, 0, 0), imm=(1,))
    scene = scene_of((cube(), b.finish("walls")), lights=[lamp("POINT", (1.0,) * 3, matrix=matrix((0.2, 0.1, -0.3)))])
    sent = {"global_photons": 100, "caustic_photons": 200_000, "global_light": "PHOTONS"}
    _, kept = render("photon_map", scene, (0, 0, 0), (0, 0, -1), 1.0, **sent)
    assert power_of(kept["caustic"]) == pytest.approx(1 / 9, rel=0.02)
    powers = kept["caustic"][1:, POWERS].mean(1, dtype=np.float64)
    assert powers.sum() ** 2 / (powers**2).sum() > 0.5 * len(powers)


def tinted(color):
    """Clear glass that does not refract."""
    b = ProgramBuilder()
    b.op("glass", 1.0, (color,) * 3, 0.0, 1.0, (0, 0, 0), 0.0, 1.33, imm=(0,))
    return b.finish("tinted")


def test_coloured_glass_takes_its_part_at_each_surface():
    """A ball that does not refract, of colour .5: a quarter of what falls on it is left behind it."""
    light = lamp("POINT", (1.0,) * 3, matrix=matrix((0.6, 0, 0)))
    scene = scene_of((cube(), surface(0.001)), (sphere(0.3, 96), tinted(0.5)), lights=[light])
    sent = {"global_photons": 1000, "caustic_photons": 200_000}
    found = [
        power_of(render("photon_map", scene, (0, 0, -0.5), (0, 0, -1), 0.1, seed=seed, **sent)[1]["caustic"])
        for seed in range(1, 7)
    ]
    expected, error = (1 - math.sqrt(3) / 2) / 2 / 4, np.std(found, ddof=1) / math.sqrt(len(found))
    assert error < 0.02 * expected
    assert abs(np.mean(found) - expected) < 4 * error


@pytest.mark.parametrize("kind, radius", [("POINT", 0.2), ("POINT", 0.0375), ("SUN", 0.2)])
def test_photons_are_sent_to_the_glass(kind, radius):
    """A glass ball that one light path of 225, 6,400 or 5,000 meets, on a floor that is all in view: light that comes to the floor by
    itself shows where the view is, no more."""
    floor = quad((-10, -10, -1), (10, -10, -1), (10, 10, -1), (-10, 10, -1))
    light = lamp(kind, (1.0,) * 3, matrix=matrix((0, 0, 1.5)))
    scene = scene_of((floor, surface(0.5)), (sphere(radius, 32), glass(1.5)), lights=[light])
    _, kept = render("photon_map", scene, (0, 0, 7), (0, 0, -1), 18, global_photons=1000, caustic_photons=200_000)
    assert len(kept["caustic"]) > 5_000
    meets = math.pi * radius**2 * (1.0 if kind == "SUN" else 1 / (4 * math.pi * 1.5**2))
    # Wherever it is and however it was found, the floor gets the same share of it: all but some of the twelfth that is reflected.
    assert power_of(kept["caustic"]) == pytest.approx(0.9 * meets, rel=0.02)


def test_a_photon_takes_48_bytes_at_most():
    scene = scene_of((cube(), surface(0.5)), lights=[lamp("POINT", (1.0,) * 3, matrix=matrix())])
    scene.camera = sd.Camera("camera", "ORTHO", looking((0, 0, 0), (0, 0, -1)), (-0.1, 0.1, -0.1, 0.1), 0.0, 1e6)
    scene.film = sd.Film(4, 4)
    photons = {"global_photons": 50_000, "caustic_photons": 10, "global_light": "GATHERED"}
    with Session(scene, sd.Settings("photon_map", 1, threads=2, parameters={**BOUNCES, **photons})) as session:
        while not session.wait():
            pass
        figures = session.native.figures()
    assert figures["global photons"] > 50_000
    assert figures["photon bytes"] <= 48 * figures["global photons"]


@pytest.mark.parametrize("filter", ["DISC", "CONE", "GAUSS"])
def test_filters_keep_the_whole(filter):
    """The floor beside a mirror: what it throws is as bright by every filter."""
    floor = quad((0, -8, 0), (16, -8, 0), (16, 8, 0), (0, 8, 0))
    mirror = quad((0, -16, 0), (0, 16, 0), (0, 16, 16), (0, -16, 16))
    light = lamp("POINT", (40 * math.pi,) * 3, matrix=matrix((1, 0, 2)))
    scene = scene_of((floor, surface(1.0)), (mirror, shiny(0.0)), lights=[light])
    photons = {"caustic_photons": 100_000, "caustic_count": 2000, "global_light": "NONE", "radius": 1000}
    found = [
        render("photon_map", scene, (1.5, 0, 1), (0, 0, -1), 0.1, seed=seed, caustic_filter=filter, **photons)[0].mean()
        for seed in range(1, 7)
    ]
    error = np.std(found, ddof=1) / math.sqrt(len(found))
    assert error < 0.02
    assert abs(math.pi * np.mean(found) - 2.892147) < 4 * math.pi * error + 0.01


def bowl(top):
    return scene_of(
        (sphere(1.0, 48, top), surface(0.5)), lights=[lamp("POINT", (4 * math.pi**2,) * 3, matrix=matrix())]
    )


NEAR = 0.025  # to a border, m; pictures are a little smaller, discs of progressive ways four times as wide
WAYS = {
    "gathered": ("photon_map", 8, 16, {"global_photons": 50_000, "global_light": "GATHERED"}),
    "cached": ("photon_map", 8, 16, {"global_photons": 50_000, "global_light": "CACHED"}),
    "read directly": ("photon_map", 8, 16, {"global_photons": 50_000, "global_light": "PHOTONS"}),
    "progressive": ("sppm", 8, 16, {"photons": 50_000, "radius": 40, "alpha": 1}),
    "merged": ("vcm", 64, 64, {"radius": 160, "alpha": 1, "terms": "MERGE"}),
}


def seen(way, scene, place, direction, seeds=8):
    """Mean of a picture of .04 m, and its standard error."""
    integrator, samples, pixels, parameters = WAYS[way]
    runs = [
        render(integrator, scene, place, direction, 0.04, samples, pixels, seed, **parameters)[0].mean()
        for seed in range(1, 1 + seeds)
    ]
    return np.mean(runs), np.std(runs, ddof=1) / math.sqrt(seeds)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("away", [0.5, NEAR])
def test_borders_are_as_bright_as_the_middle(away, way):
    """A bowl cut from a sphere with a lamp in its middle is lit evenly up to its rim: each of its points sees all others alike."""
    top = 0.75 * math.pi
    truth = 0.5 / (1 - 0.5 * (1 - math.cos(top)) / 2)
    angle = top - away
    place = np.array([math.sin(angle), 0, -math.cos(angle)])
    found, error = seen(way, bowl(top), 0.5 * place, place)
    assert error < 0.02 * truth
    assert abs(found - truth) < 4 * error + 0.03 * truth


@pytest.mark.parametrize("way", ["progressive", "merged"])
def test_beside_a_wall_only_photons_before_it_count(way):
    """A sheet parts a box in two, one side lit a hundred times as bright: little of that shines through it to the floor beside it."""
    lights = [lamp("POINT", (power,) * 3, matrix=matrix((x, 0, 0))) for power, x in ((100.0, 0.5), (1.0, -0.5))]
    sheet = quad((0, -1, -1), (0, 1, -1), (0, 1, 1), (0, -1, 1))
    scene = scene_of((cube(), surface(0.5)), (sheet, surface(0.5)), lights=lights)
    places = [(x, 0.1, 0) for x in (NEAR, -NEAR)]
    bright, dark = (render("path", scene, place, (0, 0, -1), 0.04, 512, 16)[0].mean() for place in places)
    (found_bright, error_bright), (found_dark, error_dark) = (seen(way, scene, place, (0, 0, -1)) for place in places)
    assert error_bright < 0.02 * bright and error_dark < 0.003 * bright
    assert abs(found_bright - bright) < 4 * error_bright + 0.03 * bright
    assert abs(found_dark - dark) < 4 * error_dark + 0.02 * bright


def test_what_is_behind_a_wall_is_left_out_and_not_taken_away():
    """No pixel of a first pass on the dark side is below 0."""
    sheet = quad((0, -1, -1), (0, 1, -1), (0, 1, 1), (0, -1, 1))
    light = lamp("POINT", (100.0,) * 3, matrix=matrix((0.5, 0, 0)))
    scene = scene_of((cube(), surface(0.5)), (sheet, surface(0.5)), lights=[light])
    image = render("vcm", scene, (-0.05, 0.1, 0), (0, 0, -1), 0.2, 1, 64, radius=20)[0]
    assert image.min() >= 0
    assert image.max() > 0  # a little comes through all the same


def test_the_caustic_of_a_lens_is_that_of_light_tracing():
    """Under a glass ball, in rings about the focus: light tracing needs no density estimate."""
    floor = quad((-2, -2, -1), (2, -2, -1), (2, 2, -1), (-2, 2, -1))
    light = lamp("SPOT", (30.0,) * 3, matrix=matrix((0, 0, 3)), radius=0.1, spot_size=0.35, spot_blend=0.1)
    scene = scene_of((floor, surface(0.8)), (sphere(0.4, 64), glass(1.5)), lights=[light])
    view = ((0, 0, -0.7), (0, 0, -1), 1.2)  # from below the ball
    pixels = 48
    at = (np.arange(pixels) + 0.5) / pixels - 0.5
    ring = (np.hypot(*np.meshgrid(at, at)) * 20).astype(int)

    def rings(integrator, samples, **parameters):
        seeds = [render(integrator, scene, *view, samples, pixels, s, **parameters)[0] for s in range(1, 5)]
        found = np.array([[image[ring == r].mean() for r in range(10)] for image in seeds])
        return found.mean(0), found.std(0, ddof=1) / 2

    truth, error = rings("light", 64)
    for way, parameters in (("photon_map", {"caustic_photons": 200_000}), ("sppm", {"photons": 100_000, "radius": 2})):
        found, own = rings(way, 8, **parameters)
        assert truth.max() > 5 * np.median(truth)
        np.testing.assert_array_less(np.abs(found - truth), 5 * np.hypot(error, own) + 0.03 * truth)


@pytest.mark.parametrize(
    ("way", "parameters"),
    [
        ("photon_map", {"caustic_photons": 200_000}),
        ("sppm", {"photons": 100_000, "radius": 1}),
        ("vcm", {"photons": 100_000, "radius": 1}),
    ],
)
def test_a_caustic_seen_through_glass_is_that_of_long_path_tracing(way, parameters):
    """A lamp large enough to be met by chance, a glass ball, and a pane on the floor, so that all light there has passed glass twice."""
    floor = quad((-3, -3, -1), (3, -3, -1), (3, 3, -1), (-3, 3, -1))
    top = quad((-6, -6, -0.8), (6, -6, -0.8), (6, 6, -0.8), (-6, 6, -0.8))
    bottom = quad((-6, -6, -0.9), (-6, 6, -0.9), (6, 6, -0.9), (6, -6, -0.9))
    light = lamp("POINT", (300.0,) * 3, matrix=matrix((0, 0, 2)), radius=0.5)
    bodies = [(sphere(0.4, 64), glass(1.5)), (top, glass(1.5)), (bottom, glass(1.5))]
    scene = scene_of((floor, surface(0.5)), *bodies, lights=[light])

    def blocks(integrator, samples, **parameters):
        view = ((0, 0, -0.7), (0, 0, -1), 1.6)
        images = [render(integrator, scene, *view, samples, 16, s, **parameters)[0] for s in range(1, 5)]
        found = np.array([image.reshape(4, 4, 4, 4).mean((1, 3)) for image in images])
        return found.mean(0), found.std(0, ddof=1) / 2

    truth, error = blocks("path", 4096)
    assert (error < 0.05 * truth).all()
    found, own = blocks(way, 16, **parameters)
    np.testing.assert_array_less(np.abs(found - truth), 5 * np.hypot(error, own) + 0.03 * truth)


def test_a_still_caustic_does_not_flicker():
    """A camera that moves by whole pixels from frame to frame sees the same photons at the same places, whatever the seed."""
    pixels, width, step, frames = 24, 1.2, 2, 4
    floor = quad((-2, -2, -1), (2, -2, -1), (2, 2, -1), (-2, 2, -1))
    light = lamp("SPOT", (30.0,) * 3, matrix=matrix((0, 0, 3)), radius=0.0, spot_size=0.35, spot_blend=0.1)
    scene = scene_of((floor, surface(0.8)), (sphere(0.4, 64), glass(1.5)), lights=[light])

    def flicker(keeps):
        kept, places = None, []
        half = width / 2
        for frame in range(frames):
            x = frame * step * width / pixels
            scene.camera = sd.Camera(
                "camera", "ORTHO", looking((x, 0, -0.7), (0, 0, -1)), (-half, half, -half, half), 0.0, 1e6
            )
            scene.film = sd.Film(pixels, pixels, filter="BOX", filter_width=1.0, passes=["Combined", "Caustic"])
            parameters = {**BOUNCES, "caustic_photons": 20_000, "global_photons": 100}
            settings = sd.Settings("photon_map", 64, seed=frame, threads=2, parameters=parameters)
            with Session(scene, settings, kept=kept, steady=kept is not None) as session:
                while not session.wait():
                    pass
                image = session.read("Caustic")[..., 0].astype(np.float64)
                kept = session.native.kept() if keeps else None
            seen = pixels - step * (frames - 1)
            first = step * (frames - 1 - frame)
            places.append(image[:, first:][:, :seen])
        bright = np.mean(places, 0) > 0.2 * np.max(places)
        return (np.var(places, 0, ddof=1) / np.mean(places, 0) ** 2)[bright].mean()

    alone, kept = flicker(False), flicker(True)
    assert alone > 1e-4
    assert kept < 0.05 * alone, f"{kept:.2e}, without {alone:.2e}"
