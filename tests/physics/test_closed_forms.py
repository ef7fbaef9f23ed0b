"""Whole renders against closed forms: furnaces, enclosures, form factors, glass; and every way of estimating against them.

Straight through the native engine. A probe is an image whose pixels all look at one point, so that they are independent
samples of one radiance: their mean must lie within Z standard errors (and rounding) of the truth."""

import itertools
import math

import numpy as np
import pytest
from light_scenes import emission, lamp, matrix

from gi_engine import scene_data as sd
from gi_engine.nodes.program import ProgramBuilder
from gi_engine.session import Session

Z = 4.5  # standard errors; 1 false alarm in 150,000
BOUNCES = {f"{kind}_bounces": 200 for kind in ("max", "diffuse", "glossy", "transmission")}


# -------------------------------------------------------------------------------------------------- building


def surface(albedo=0.0, glow=0.0, name="surface"):
    b = ProgramBuilder()
    if albedo:
        b.op("diffuse", 1.0, (albedo,) * 3, 0.0, (0, 0, 0))
    b.op("emission", 1.0, (1, 1, 1), glow)
    return b.finish(name)


def shiny(roughness, name="shiny"):
    b = ProgramBuilder()
    b.op("glossy", 1.0, (1, 1, 1), roughness, 0.0, 0.0, (0, 0, 0), (0, 0, 0), imm=(0,))
    return b.finish(name)


def glass(ior=1.5, name="glass"):
    b = ProgramBuilder()
    b.op("glass", 1.0, (1, 1, 1), 0.0, ior, (0, 0, 0), 0.0, 1.33, imm=(0,))
    return b.finish(name)


def mesh(vertices, faces):
    """Triangles of any convex faces, flat."""
    triangles = np.array([(f[0], f[i], f[i + 1]) for f in faces for i in range(1, len(f) - 1)], np.int32)
    buffer = np.zeros(len(vertices) * 3 + 1, np.float32)  # the native side reads four floats at a time
    buffer[:-1] = np.asarray(vertices, np.float32).ravel()
    corners = np.ascontiguousarray(triangles.ravel())
    order = np.arange(len(corners), dtype=np.int32).reshape(-1, 3)
    return sd.Mesh("mesh", buffer[:-1].reshape(-1, 3), corners, order, None, None, "FACE", None)


def quad(*corners):
    return mesh(corners, [(0, 1, 2, 3)])


def cube(half=1.0):
    corners = [(x, y, z) for z in (-half, half) for y in (-half, half) for x in (-half, half)]
    return mesh(corners, [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)])


def sphere(radius=1.0, rings=128, top=math.pi):
    """The part of a sphere from the south pole up to the angle `top`."""
    n = 2 * rings
    angles = np.linspace(0, top, round(rings * top / math.pi) + 1)
    turns = np.arange(n) * (2 * math.pi / n)
    ring = np.stack([np.cos(turns), np.sin(turns)], -1)
    vertices = np.concatenate([np.column_stack([math.sin(a) * ring, np.full(n, -math.cos(a))]) for a in angles])
    faces = [
        (j * n + i, j * n + (i + 1) % n, (j + 1) * n + (i + 1) % n, (j + 1) * n + i)
        for j, i in itertools.product(range(len(angles) - 1), range(n))
    ]
    return mesh(radius * vertices, faces)


def scene_of(*parts, lights=(), world=None):
    """`parts`: (mesh, program) pairs."""
    scene = sd.Scene(lights=list(lights))
    for item, program in parts:
        scene.meshes.append(item)
        scene.programs.append(program)
        scene.instances.append(
            sd.Instance(f"part {len(scene.instances)}", len(scene.meshes) - 1, matrix(), [len(scene.programs) - 1])
        )
    if world is not None:
        scene.programs.append(emission(strength=world, name="world"))
        scene.world = sd.World(program=len(scene.programs) - 1)
    return scene


def looking(position, direction):
    """A camera's matrix: it looks along its -Z."""
    z = -np.asarray(direction, float) / np.linalg.norm(direction)
    x = np.cross((0, 1, 0) if abs(z[1]) < 0.9 else (1, 0, 0), z)
    x /= np.linalg.norm(x)
    return matrix(position, x, np.cross(z, x), z)


# -------------------------------------------------------------------------------------------------- measuring


def probe(
    scene, position, direction, samples=64, pixels=32, width=1e-4, integrator="path", seed=1, threads=2, **parameters
):
    """(pixels, pixels) first channel of the radiance that arrives at `position` against `direction`."""
    half = width / 2
    scene.camera = sd.Camera("camera", "ORTHO", looking(position, direction), (-half, half, -half, half), 0.0, 1e6)
    scene.film = sd.Film(pixels, pixels, filter="BOX", filter_width=1.0)
    limits = BOUNCES if integrator == "path" else {}
    settings = sd.Settings(integrator, samples, seed=seed, threads=threads, parameters={**limits, **parameters})
    with Session(scene, settings) as session:
        while not session.wait():
            pass
        assert session.progress()["bad_samples"] == 0
        return session.read("Combined")[..., 0].astype(np.float64)


def check(image, truth, rounding=1e-3):
    error = image.std(ddof=1) / math.sqrt(image.size)
    assert abs(image.mean() - truth) < Z * error + rounding * abs(truth), (
        f"{image.mean():.6f} ± {error:.6f} instead of {truth:.6f}"
    )
    assert error < 0.02 * abs(truth), "too noisy to mean anything"


# -------------------------------------------------------------------------------------------------- enclosures

WAYS = list(
    itertools.product(("OFF", "ON", "MIS"), ("UNIFORM", "COSINE", "BSDF"), ("ALBEDO", "THROUGHPUT", "CONSTANT"))
)


@pytest.mark.parametrize(("light", "direction", "continuation"), WAYS)
@pytest.mark.parametrize("albedo", [0.5, 0.8])
def test_closed_furnace(albedo, light, direction, continuation):
    """A box that glows and reflects: 1 / (1 - albedo), whichever way it is estimated."""
    scene = scene_of((cube(), surface(albedo, 1.0)))
    ways = {"light_sampling": light, "direction_sampling": direction, "continuation": continuation}
    # With a smaller constant the variance would be infinite: 4/3 albedo^2 / constant must stay below 1.
    found = probe(scene, (0.1, 0.2, -0.1), (0.3, 0.5, 0.8), samples=128, pixels=20, continuation_constant=0.95, **ways)
    check(found, 1 / (1 - albedo))


@pytest.mark.parametrize(("light", "direction", "continuation"), WAYS)
def test_ways_agree_on_an_open_scene(light, direction, continuation):
    """A glossy floor beside a glowing wall has no closed form: every way against one long render of another kind."""
    floor = quad((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0))
    wall = quad((-1, 1, 0.2), (1, 1, 0.2), (1, 1, 1.5), (-1, 1, 1.5))
    side = quad((-1, -1, 0), (-1, 1, 0), (-1, 1, 1), (-1, -1, 1))
    scene = scene_of((floor, shiny(0.5)), (wall, surface(0.3, 2.0)), (side, surface(0.7)), world=0.2)
    at, towards = (0.0, -1.0, 1.0), (0.05, 0.6, -1.0)
    truth = probe(scene, at, towards, samples=512, seed=99)
    found = probe(scene, at, towards, light_sampling=light, direction_sampling=direction, continuation=continuation)
    error = math.hypot(found.std(ddof=1), truth.std(ddof=1)) / math.sqrt(found.size)
    assert abs(found.mean() - truth.mean()) < Z * error, f"{found.mean():.5f}, {truth.mean():.5f} ± {error:.5f}"


@pytest.mark.parametrize("bounces", [0, 1, 7, 200])
@pytest.mark.parametrize("count", [1, 4])
def test_integrating_sphere(bounces, count):
    """Unit sphere of albedo .5, intensity pi at its centre: radiance 1; n bounces leave 1 - 2^-(n+1) [pbrt-v4]."""
    power = 4 * math.pi * math.pi / count
    lamps = [lamp("POINT", (power,) * 3, matrix=matrix((0, 0, 0))) for _ in range(count)]
    scene = scene_of((sphere(), surface(0.5)), lights=lamps)
    limits = {"max_bounces": bounces, "diffuse_bounces": bounces}
    check(probe(scene, (0.2, 0.1, 0.0), (0.5, 0.3, 0.7), **limits), 1 - 0.5 ** (bounces + 1), rounding=2e-3)


def test_bowl_under_the_sky():
    """Spherical cavity, half open: rho f / (1 - rho (1 - f)) of the sky's radiance, the same everywhere inside."""
    scene = scene_of((sphere(top=math.pi / 2), surface(0.8)), world=1.0)
    for towards in ((0, 0, -1), (0.9, 0, -0.3)):
        check(probe(scene, (0, 0, -0.2), towards), 0.8 * 0.5 / (1 - 0.8 * 0.5), rounding=2e-3)


def test_convex_things_under_the_sky():
    """A diffuse ball shows its albedo, a perfect mirror and clear glass the sky itself."""
    for program, truth in ((surface(0.7), 0.7), (shiny(0.0), 1.0), (glass(), 1.0)):
        scene = scene_of((sphere(rings=64), program), world=1.0)
        check(probe(scene, (0.3, 0.2, 3), (0, 0, -1)), truth, rounding=1e-4)


def test_two_squares():
    """Unit squares face to face, 1 m apart, emittance 1 below, albedos .5 and .8: radiosity in the middles."""
    low = quad((-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0))
    high = quad((-0.5, -0.5, 1), (-0.5, 0.5, 1), (0.5, 0.5, 1), (0.5, -0.5, 1))
    scene = scene_of((low, surface(0.5, 1 / math.pi)), (high, surface(0.8)))
    check(math.pi * probe(scene, (0, 0, 0.5), (0, 0, -1), samples=256), 1.0198462, rounding=2e-4)
    check(math.pi * probe(scene, (0, 0, 0.5), (0, 0, 1), samples=256), 0.1947815)


# -------------------------------------------------------------------------------------------------- direct light


@pytest.mark.parametrize(
    ("distance", "factor"), [(0.1, 0.42254486), (0.25, 0.31754961), (0.5, 0.19013588), (0.75, 0.11449568)]
)
def test_wall_onto_floor(distance, factor):
    """Perpendicular unit squares with a common edge: irradiance on the floor's middle line over the wall's emittance."""
    floor = quad((-0.5, 0, 0), (0.5, 0, 0), (0.5, 1, 0), (-0.5, 1, 0))
    wall = quad((-0.5, 0, 0), (-0.5, 0, 1), (0.5, 0, 1), (0.5, 0, 0))
    scene = scene_of((floor, surface(1.0)), (wall, surface(0.0, 1.0)))
    check(probe(scene, (0, distance, 0.5), (0, 0, -1)), factor)


def lambert(corners, point, normal):
    """Configuration factor of a polygon above the horizon [Lambert 1760]."""
    v = [(np.asarray(c, float) - point) / np.linalg.norm(np.asarray(c, float) - point) for c in corners]
    total = 0.0
    for a, b in zip(v, v[1:] + v[:1], strict=True):
        cross = np.cross(a, b)
        total += math.acos(np.clip(a @ b, -1, 1)) * (cross @ normal) / np.linalg.norm(cross)
    return abs(total) / (2 * math.pi)


@pytest.mark.parametrize(
    "corners",
    [
        ((-20, 40, 20), (-40, 10, 60), (30, -20, 40)),
        ((1, 1, 0.3), (2, 1, 0.3), (1, 2, 2.0)),
        ((-0.2, 0.1, 0.1), (0.3, 0.1, 0.2), (0.0, -0.3, 0.15)),
    ],
)
@pytest.mark.parametrize("way", ["OFF", "ON", "MIS"])
def test_triangle_of_light(corners, way):
    floor = quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    scene = scene_of((floor, surface(0.5)), (mesh(corners, [(0, 1, 2)]), surface(0.0, 1.0)))
    truth = 0.5 * lambert(corners, np.zeros(3), np.array((0, 0, 1.0)))
    samples = 1024 if way == "OFF" else 64
    # From below the lamp, which stands in the way of a camera further up.
    check(probe(scene, (0.0, 0.0, 0.05), (0, 0, -1), samples=samples, light_sampling=way), truth)


@pytest.mark.parametrize("x", [0.0, 0.2, 0.26])
@pytest.mark.parametrize("way", ["OFF", "ON", "MIS"])
def test_luminaire_close_to_the_ceiling(x, way):
    """Two centimetres below: the shadow ray must not meet the luminaire that it goes to."""
    corners = [(-0.24, -0.16, 1.98), (0.23, -0.16, 1.98), (0.23, 0.22, 1.98), (-0.24, 0.22, 1.98)]
    ceiling = quad((-1, -1, 2), (-1, 1, 2), (1, 1, 2), (1, -1, 2))
    scene = scene_of((ceiling, surface(1.0)), (quad(*corners), surface(0.0, 1.0)))
    truth = lambert(corners, np.array((x, 0.1, 2.0)), np.array((0, 0, -1.0)))
    check(probe(scene, (x, 0.1, 1.99), (0, 0, 1), samples=256, light_sampling=way, max_bounces=0), truth, rounding=2e-3)


@pytest.mark.parametrize(
    ("y", "lux"), [(0.25, 61.424), (0.75, 79.255), (1.25, 95.667), (1.75, 105.778), (2.25, 105.778), (3.75, 61.424)]
)
def test_area_lamp_in_a_black_room(y, lux):
    """CIE 171:2006, 5.3: 1 m square of 1000 cd/m2 in the ceiling (y = 2, 3 m up), floor at x = 2 m; exact values."""
    floor = quad((0, 0, 0), (4, 0, 0), (4, 4, 0), (0, 4, 0))
    ceiling = lamp("AREA", (1000 * math.pi,) * 3, matrix=matrix((2, 2, 3)), size=(1.0, 1.0))
    scene = scene_of((floor, surface(1.0)), lights=[ceiling])
    check(math.pi * probe(scene, (2, y, 1), (0, 0, -1), diffuse_bounces=0), lux, rounding=2e-4)


@pytest.mark.parametrize("x", [0.0, 1.0, 3.0])
@pytest.mark.parametrize("radius", [0.0, 0.1, 0.8])
def test_ball_of_light(x, radius):
    """A sphere fully above the horizon lights like its own point: E = P cos / (4 pi d^2)."""
    floor = quad((-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0))
    bulb = lamp("POINT", (50.0,) * 3, matrix=matrix((0, 0, 1.5)), radius=radius, soft_falloff=False)
    squared = x * x + 1.5 * 1.5
    truth = 50 / (4 * math.pi * squared) * 1.5 / math.sqrt(squared)
    check(math.pi * probe(scene_of((floor, surface(1.0)), lights=[bulb]), (x, 0, 0.1), (0, 0, -1)), truth)


def test_sun_and_sky():
    """E = W/m2 times the cosine, whatever the sun's angle; the sky gives pi L."""
    floor = quad((-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0))
    tilt = math.radians(35)
    place = matrix((0, 0, 0), (1, 0, 0), (0, math.cos(tilt), math.sin(tilt)), (0, -math.sin(tilt), math.cos(tilt)))
    for angle in (0.0, 0.2):
        scene = scene_of((floor, surface(0.6)), lights=[lamp("SUN", (3.0,) * 3, matrix=place, angle=angle)], world=0.25)
        truth = 0.6 * (3.0 * math.cos(tilt) / math.pi + 0.25)
        # A wide sun's mean cosine is a little smaller.
        check(probe(scene, (0, 0, 1), (0, 0, -1)), truth, rounding=3e-3)


# -------------------------------------------------------------------------------------------------- glass and gloss


def fresnel(degrees, ior=1.5):
    """Reflectance of a smooth surface for light that is unpolarised each time, as renderers without polarisation have it."""
    cos_i = math.cos(math.radians(degrees))
    cos_t = math.sqrt(1 - (1 - cos_i**2) / ior**2)
    s, p = (cos_i - ior * cos_t) / (cos_i + ior * cos_t), (ior * cos_i - cos_t) / (ior * cos_i + cos_t)
    return (s * s + p * p) / 2


@pytest.mark.parametrize("degrees", [0, 30, 60, 75])
def test_slab_of_glass(degrees):
    """All reflections inside a plane slab, seen against a glowing wall, the other side being black: (1 - R) / (1 + R)."""
    transmitted = (1 - fresnel(degrees)) / (1 + fresnel(degrees))
    slab = mesh(
        [(x, y, z) for z in (0.0, 0.01) for y in (-50, 50) for x in (-50, 50)],
        [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)],
    )
    wall = quad((-200, -200, -1), (200, -200, -1), (200, 200, -1), (-200, 200, -1))
    scene = scene_of((slab, glass()), (wall, surface(0.0, 1.0)))
    tilt = math.radians(degrees)
    check(probe(scene, (0, 0, 1), (math.sin(tilt), 0, -math.cos(tilt)), samples=256), transmitted, rounding=5e-4)


def gloss_scene(roughness, size):
    """A glossy plate that mirrors a lamp of the given size and equal power [Veach 1997, fig. 9.2]."""
    plate = quad((-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0))
    shining = quad((-size, 2 - size, 2), (-size, 2 + size, 2), (size, 2 + size, 2), (size, 2 - size, 2))
    return scene_of((plate, shiny(roughness)), (shining, surface(0.0, 1 / size**2)))


@pytest.mark.parametrize(("roughness", "size", "bad_way"), [(0.15, 1.0, "ON"), (0.9, 0.05, "OFF")])
def test_multiple_importance_beats_the_wrong_single_way(roughness, size, bad_way):
    scene = gloss_scene(roughness, size)
    found = {way: probe(scene, (0, -2, 2), (0, 1, -1), samples=256, light_sampling=way) for way in ("OFF", "ON", "MIS")}
    best = min(found["OFF"].std(), found["ON"].std())
    assert found["MIS"].std() < 0.3 * found[bad_way].std()
    assert found["MIS"].std() < 2.5 * best  # it pays for both ways
    for way in ("OFF", "ON"):
        error = math.hypot(found[way].std(), found["MIS"].std()) / math.sqrt(found[way].size)
        assert abs(found[way].mean() - found["MIS"].mean()) < Z * error


# -------------------------------------------------------------------------------------------------- bad samples


def test_samples_that_are_not_numbers_are_left_out():
    """Half of every pixel is too bright for a float: what is left is the other half, not half as much."""
    bright = quad((-1, -1, 0), (0, -1, 0), (0, 1, 0), (-1, 1, 0))
    dim = quad((0, -1, 0), (1, -1, 0), (1, 1, 0), (0, 1, 0))
    scene = scene_of((bright, surface(glow=3e38)), (dim, surface(glow=0.5)))
    scene.camera = sd.Camera("camera", "ORTHO", looking((0, 0, 1), (0, 0, -1)), (-0.5, 0.5, -0.01, 0.01), 0.0, 1e6)
    passes = ["Combined", "Emission", "Normal", "Debug Sample Count"]
    scene.film = sd.Film(1, 4, filter="BOX", filter_width=1.0, exposure=2.0, passes=passes)
    with Session(scene, sd.Settings("path", 64)) as session:
        while not session.wait():
            pass
        assert 4 * 16 < session.progress()["bad_samples"] < 4 * 48
        np.testing.assert_allclose(session.read("Combined"), np.broadcast_to([1, 1, 1, 1], (4, 1, 4)), rtol=1e-6)
        np.testing.assert_allclose(session.read("Emission"), np.ones((4, 1, 3)), rtol=1e-6)
        np.testing.assert_allclose(session.read("Normal"), np.broadcast_to([0, 0, 1], (4, 1, 3)), atol=1e-6)
        assert (session.read("Debug Sample Count") == 64).all()


def test_surfaces_in_the_same_place_do_not_shadow_one_another():
    """Nor do rays that leave the one meet the other: the sky lights both as it lights one."""
    corners = ((-1, -1, 0.3), (1, -1, -0.2), (1.3, 1.5, 0.1), (-0.7, 1, 0.6))
    one = mesh(corners, [(0, 1, 2), (0, 2, 3)])
    scene = scene_of((one, surface(0.6)), (mesh(corners, [(0, 1, 2), (0, 2, 3)]), surface(0.6)), world=1.0)
    check(probe(scene, (0.1, 0.1, 2), (0, 0, -1)), 0.6)
