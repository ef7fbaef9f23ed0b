"""Lobes: what they sample is what they claim, they are reciprocal where the model is, and they neither make nor lose energy."""

import importlib.util
from pathlib import Path

import chi2
import numpy as np
import pytest
from gi_engine_native import _core

DIELECTRIC, SCHLICK, F82, CONDUCTOR = [1], [2], [3], [4]
GLASS = {"fresnel": DIELECTRIC, "ior": [1.5]}
INSIDE = {"fresnel": DIELECTRIC, "ior": [1 / 1.5]}

LOBES = {
    "lambert": ("lambert", {}),
    "ggx .05": ("ggx_reflection", {"alpha": [0.05]}),
    "ggx .3": ("ggx_reflection", {"alpha": [0.3]}),
    "ggx 1": ("ggx_reflection", {"alpha": [1.0]}),
    "ggx .5 .08": ("ggx_reflection", {"alpha_x": [0.5], "alpha_y": [0.08]}),
    "ggx schlick": ("ggx_reflection", {"alpha": [0.2], "fresnel": SCHLICK, "ior": [1.5], "f0": [0.1, 0.04, 0.02]}),
    "ggx f82": (
        "ggx_reflection",
        {"alpha": [0.2], "fresnel": F82, "f0": [0.9, 0.6, 0.3], "edge_tint": [0.5, 0.8, 1.0]},
    ),
    "ggx gold": (
        "ggx_reflection",
        {"alpha": [0.3], "fresnel": CONDUCTOR, "n": [0.18, 0.42, 1.37], "k": [3.4, 2.35, 1.77]},
    ),
    "ggx refraction": ("ggx_refraction", {"alpha": [0.2], "ior": [1.5]}),
    "ggx refraction inside": ("ggx_refraction", {"alpha": [0.2], "ior": [1 / 1.5]}),
    "ggx glass": ("ggx_glass", {"alpha": [0.3], **GLASS}),
    "ggx glass inside": ("ggx_glass", {"alpha": [0.3], **INSIDE}),
    "ggx rough glass": ("ggx_glass", {"alpha": [1.0], **GLASS}),
    "ggx diamond inside": ("ggx_glass", {"alpha": [0.1], "fresnel": DIELECTRIC, "ior": [1 / 2.4]}),
    "ggx tinted glass": (
        "ggx_glass",
        {"alpha": [0.3], "fresnel": SCHLICK, "ior": [1.3], "transmission_tint": [0.9, 0.5, 0.1]},
    ),
    "beckmann .05": ("beckmann_reflection", {"alpha": [0.05]}),
    "beckmann .3": ("beckmann_reflection", {"alpha": [0.3]}),
    "beckmann 1": ("beckmann_reflection", {"alpha": [1.0]}),
    "beckmann .5 .08": ("beckmann_reflection", {"alpha_x": [0.5], "alpha_y": [0.08]}),
    "beckmann refraction": ("beckmann_refraction", {"alpha": [0.2], "ior": [1.5]}),
    "beckmann glass": ("beckmann_glass", {"alpha": [0.3], **GLASS}),
    "beckmann glass inside": ("beckmann_glass", {"alpha": [0.3], **INSIDE}),
    "ashikhmin .3": ("ashikhmin_shirley", {"alpha_x": [0.3], "alpha_y": [0.3]}),
    "ashikhmin .5 .1": ("ashikhmin_shirley", {"alpha_x": [0.5], "alpha_y": [0.1]}),
    "ashikhmin 1 .2": ("ashikhmin_shirley", {"alpha_x": [1.0], "alpha_y": [0.2]}),
}
COSINES = [0.97, 0.6, 0.12]
CASES = [pytest.param(*LOBES[k], c, id=f"{k} at {c}") for k in LOBES for c in COSINES]
SMOOTH_GLASS = ("ggx_glass", {"alpha": [0.0], **GLASS})


def load_tool(name):
    path = Path(__file__).parents[2] / "native/tools" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def view(cos_o, phi=0.7):
    return chi2.directions(np.array([cos_o]), np.array([phi]))


def numbers(n, seed=3):
    return np.random.default_rng(seed).random((n, 3), np.float32)


def draw(name, parameters, wo, n=100_000, seed=3):
    """Samples and what each estimates: (rows that hold a sample, value / pdf of every row)."""
    s = _core.lobe_sample(name, parameters, wo, numbers(n, seed))
    ok = s[:, 6] > 0
    weight = np.zeros((n, 3))
    weight[ok] = s[ok, 3:6].astype(float) / s[ok, 6:7]
    return s[ok], weight


@pytest.mark.parametrize(("name", "parameters", "cos_o"), CASES)
def test_samples_follow_the_density(name, parameters, cos_o):
    wo = view(cos_o)

    def sample(u):
        s = _core.lobe_sample(name, parameters, wo, u)
        return s[s[:, 6] > 0, :3]

    chi2.assert_matches(sample, lambda wi: _core.lobe_eval(name, parameters, wo, wi)[:, 3], tests=len(CASES))


@pytest.mark.parametrize(("name", "parameters", "cos_o"), CASES)
def test_sampling_and_evaluating_agree(name, parameters, cos_o):
    wo = view(cos_o)
    s, _ = draw(name, parameters, wo, 20_000)
    assert len(s) > 500  # a refracting lobe cannot sample where it reflects totally
    assert np.isfinite(s).all()
    assert (s[:, 3:7] >= 0).all()
    assert np.abs(np.linalg.norm(s[:, :3], axis=1) - 1).max() < 1e-5
    e = _core.lobe_eval(name, parameters, wo, np.ascontiguousarray(s[:, :3]))
    # The evaluation finds the half vector again from rounded directions: a few samples at the horizon may differ.
    error = np.abs(e - s[:, 3:7]) / np.maximum(s[:, 3:7], 1e-6)
    assert np.quantile(error, 0.999) < 5e-3
    transmitted = s[:, 2] < 0
    assert ((s[:, 7].astype(int) & 2) > 0).tolist() == transmitted.tolist()


@pytest.mark.parametrize(("name", "parameters", "cos_o"), CASES)
def test_no_lobe_makes_energy(name, parameters, cos_o):
    _, weight = draw(name, parameters, view(cos_o))
    mean, error = weight.mean(0), weight.std(0) / np.sqrt(len(weight))
    assert (mean <= 1 + 4 * error + 1e-5).all()
    assert (mean > 0.01).any()


@pytest.mark.parametrize("key", [k for k in LOBES if "glass" not in k and "refraction" not in k and "inside" not in k])
def test_reflection_is_reciprocal(key):
    name, parameters = LOBES[key]
    rng = np.random.default_rng(5)
    a, b = (chi2.directions(rng.uniform(0.05, 1, 2000), rng.uniform(0, 2 * np.pi, 2000)) for _ in range(2))
    forth = _core.lobe_eval(name, parameters, a, b)[:, :3] / b[:, 2:]
    back = _core.lobe_eval(name, parameters, b, a)[:, :3] / a[:, 2:]
    np.testing.assert_allclose(forth, back, rtol=2e-4, atol=1e-6)


@pytest.mark.parametrize("kind", ["ggx", "beckmann"])
def test_refraction_is_reciprocal_up_to_the_squared_index(kind):
    """Radiance is not scaled by η² (as in Blender), so the two ways differ by just that. [Walter 2007, §4.2; Veach 1997, eq. 5.14]"""
    rng = np.random.default_rng(6)
    a, _ = (chi2.directions(rng.uniform(0.2, 1, 5000), rng.uniform(0, 2 * np.pi, 5000)) for _ in range(2))
    s = _core.lobe_sample(kind + "_glass", {"alpha": [0.3], **GLASS}, a, numbers(5000))
    ok = (s[:, 6] > 0) & (s[:, 2] < -0.05)
    a, b = np.ascontiguousarray(a[ok]), np.ascontiguousarray(s[ok, :3])
    assert ok.sum() > 2000
    forth = _core.lobe_eval(kind + "_glass", {"alpha": [0.3], **GLASS}, a, b)[:, 0] / -b[:, 2]
    back = _core.lobe_eval(kind + "_glass", {"alpha": [0.3], **INSIDE}, -b, -a)[:, 0] / a[:, 2]
    np.testing.assert_allclose(forth, 1.5**2 * back, rtol=5e-3)


@pytest.mark.parametrize("alpha", [0.01, 0.1, 0.36, 1.0])
@pytest.mark.parametrize("cos_o", [0.15, 0.5, 0.95])
def test_white_furnace_of_preserved_reflection(alpha, cos_o):
    wo, preserved = view(cos_o), {"alpha": [alpha], "preserve_energy_at": [cos_o]}
    _, weight = draw("ggx_reflection", preserved, wo)
    assert weight.mean(0) == pytest.approx(1, abs=0.01)
    grey = draw("ggx_reflection", {**preserved, "mean": [0.5]}, wo)[1].mean()
    single = draw("ggx_reflection", {"alpha": [alpha]}, wo)[1].mean()
    assert single - 0.01 <= grey <= 1.001  # coloured facets absorb part of what bounces between them


@pytest.mark.parametrize("alpha", [0.01, 0.1, 0.36, 1.0])
@pytest.mark.parametrize("cos_o", [0.15, 0.5, 0.95])
def test_white_furnace_of_preserved_glass(alpha, cos_o):
    wo = view(cos_o)
    entering = draw("ggx_glass", {"alpha": [alpha], **GLASS, "preserve_energy_at": [cos_o]}, wo)[1].mean()
    assert entering == pytest.approx(1, abs=0.015)
    # From inside, light that rough facets bend to the wrong side stays lost (see make_ggx_tables.py).
    leaving = draw("ggx_glass", {"alpha": [alpha], **INSIDE, "preserve_energy_at": [cos_o]}, wo)[1].mean()
    lost = draw("ggx_glass", {"alpha": [alpha], **INSIDE}, wo)[1].mean()
    assert lost - 0.005 <= leaving <= 1.015


@pytest.mark.parametrize("key", ["ggx .05", "ggx schlick", "ggx f82", "ggx gold", "ggx glass", "beckmann .05"])
def test_albedo_is_close_to_the_truth_where_facets_lose_little(key):
    name, parameters = LOBES[key]
    parameters, wo = {**parameters, "alpha": [0.05]}, view(0.8)
    estimate = _core.lobe_albedo(name, parameters, wo)[0]
    _, weight = draw(name, parameters, wo)
    assert estimate == pytest.approx(weight.mean(0), rel=0.03)


def dielectric(cos_i, eta):
    """Fresnel's own formulas, complex so that total reflection needs no case."""
    c = cos_i + 0j
    t = np.sqrt(1 - (1 - c**2) / eta**2 + 0j)
    s, p = (c - eta * t) / (c + eta * t), (t - eta * c) / (t + eta * c)
    return 0.5 * (abs(s) ** 2 + abs(p) ** 2)


@pytest.mark.parametrize("eta", [1.5, 1 / 1.5, 2.4])
@pytest.mark.parametrize("cos_i", [1.0, 0.8, 0.5547, 0.2])
def test_smooth_glass_is_fresnel_and_snell(eta, cos_i):
    wo = view(cos_i)
    parameters = {"alpha": [0.0], "fresnel": DIELECTRIC, "ior": [eta]}
    s = _core.lobe_sample("ggx_glass", parameters, wo, numbers(1000))
    up = s[:, 2] > 0
    f = dielectric(cos_i, eta)
    assert s[up, 3] == pytest.approx(f, abs=1e-5)
    assert s[up, 6] == pytest.approx(f, abs=1e-5)
    assert s[~up, 3] == pytest.approx(1 - f, abs=1e-5)
    assert abs(up.mean() - f) < 4 * np.sqrt(f * (1 - f) / 1000) + 1e-6
    assert s[up, :2] == pytest.approx(np.broadcast_to(-wo[:, :2], (up.sum(), 2)), abs=1e-5)
    assert s[~up, :2] == pytest.approx(np.broadcast_to(-wo[:, :2] / eta, ((~up).sum(), 2)), abs=1e-5)
    assert not _core.lobe_eval("ggx_glass", parameters, wo, view(0.5)).any()


@pytest.mark.parametrize("cos_i", [1.0, 0.6, 1 / 7, 0.05])
def test_fresnel_of_metals(cos_i):
    def mirror(**parameters):
        return _core.lobe_sample("ggx_reflection", {"alpha": [0.0], **parameters}, view(cos_i), numbers(1))[0, 3:6]

    n, k = 0.2, 3.4
    eta = n + 1j * k
    t = np.sqrt(1 - (1 - cos_i**2) / eta**2)
    s, p = (cos_i - eta * t) / (cos_i + eta * t), (t - eta * cos_i) / (t + eta * cos_i)
    assert mirror(fresnel=CONDUCTOR, n=[n], k=[k]) == pytest.approx(0.5 * (abs(s) ** 2 + abs(p) ** 2), abs=1e-4)
    assert mirror(fresnel=CONDUCTOR, n=[1.5], k=[0.0]) == pytest.approx(dielectric(cos_i, 1.5), abs=1e-4)
    f0 = 0.6
    schlick = f0 + (1 - f0) * (1 - cos_i) ** 5
    assert mirror(fresnel=F82, f0=[f0], edge_tint=[1.0]) == pytest.approx(schlick, abs=1e-5)
    assert mirror(fresnel=SCHLICK, f0=[f0], exponent=[5.0]) == pytest.approx(schlick, abs=1e-5)
    if cos_i == 1 / 7:
        assert mirror(fresnel=F82, f0=[f0], edge_tint=[0.4]) == pytest.approx(0.4 * schlick, abs=1e-5)


@pytest.mark.parametrize(
    "name", ["ggx_reflection", "ggx_glass", "beckmann_reflection", "beckmann_glass", "ashikhmin_shirley"]
)
def test_extremes_stay_finite(name):
    rng = np.random.default_rng(8)
    cosines = np.concatenate([10.0 ** rng.uniform(-6, 0, 500), 1 - 10.0 ** rng.uniform(-7, 0, 500)])
    wo = chi2.directions(cosines, rng.uniform(0, 2 * np.pi, 1000))
    wi = chi2.directions(rng.uniform(-1, 1, 1000), rng.uniform(0, 2 * np.pi, 1000))
    corners = numbers(1000)
    corners[:8] = [[x, y, z] for x in (0, 0.99999994) for y in (0, 0.99999994) for z in (0, 0.99999994)]
    for alpha in (0.0, 1e-5, 1.5e-5, 1e-4, 1e-2, 1.0):
        for ior in (1.0, 1.00005, 1.001, 1.5, 0.999, 0.4, 50.0):
            parameters = {"alpha": [alpha], "alpha_x": [alpha], "alpha_y": [alpha], "ior": [ior], "fresnel": DIELECTRIC}
            for out in (_core.lobe_sample(name, parameters, wo, corners), _core.lobe_eval(name, parameters, wo, wi)):
                assert np.isfinite(out).all()
                assert (out[:, 3:7] >= 0).all()


def film_by_spectrum(cos_i, film_ior, thickness, substrate):
    """Airy's formula at every wavelength, then the channels' sensitivities: what the Fourier sum stands for."""
    wavelength, rgb = load_tool("make_thin_film_table").sensitivities()
    cos_film = np.sqrt(1 - (1 - cos_i**2) / film_ior**2)
    cos_t = np.sqrt(1 - (1 - cos_i**2) / (substrate + 0j) ** 2)
    delay = np.exp(4j * np.pi * film_ior * thickness * cos_film / wavelength)
    total = 0
    for a, b, c in (
        (cos_i, film_ior * cos_film, substrate * cos_t),
        (-1 / cos_i, -film_ior / cos_film, -substrate / cos_t),
    ):
        r12, r23 = (a - b) / (a + b), (b - c) / (b + c)
        total = total + 0.5 * abs((r12 + r23 * delay) / (1 + r12 * r23 * delay)) ** 2
    return total @ rgb


@pytest.mark.parametrize("cos_i", [1.0, 0.7, 0.3])
@pytest.mark.parametrize("thickness", [100, 400, 1000])
@pytest.mark.parametrize(
    ("substrate", "parameters"),
    [
        (1.5, {"fresnel": SCHLICK, "ior": [1.5]}),
        (0.2 + 3.4j, {"fresnel": CONDUCTOR, "n": [0.2], "k": [3.4]}),
    ],
    ids=["glass", "metal"],
)
def test_thin_films_are_airy_sums_over_the_spectrum(cos_i, thickness, substrate, parameters):
    film = {"alpha": [0.0], "film_thickness": [thickness], "film_ior": [1.33]}
    s = _core.lobe_sample("ggx_reflection", {**parameters, **film}, view(cos_i), numbers(1))[0, 3:6]
    assert s == pytest.approx(film_by_spectrum(cos_i, 1.33, thickness, substrate), abs=0.01)


def test_a_film_that_vanishes_leaves_the_bare_surface():
    bare = {"alpha": [0.0], "fresnel": SCHLICK, "ior": [1.5]}
    thin = {**bare, "film_thickness": [0.11], "film_ior": [1.33]}
    a, b = (_core.lobe_sample("ggx_reflection", p, view(0.6), numbers(1))[0, 3:6] for p in (bare, thin))
    assert a == pytest.approx(b, abs=1e-3)


MIX = [
    ("lambert", {}, [0.4, 0.3, 0.2], [0, 0, 1]),
    ("ggx_reflection", {"alpha": [0.2], "fresnel": SCHLICK, "ior": [1.5]}, [1, 1, 1], [0, 0, 1]),
    ("beckmann_glass", {"alpha": [0.3], **GLASS}, [0.1, 0.2, 0.3], [0, 0, 1]),
]


def mix(lobes=MIX, ng=(0, 0, 1), ns=(0, 0, 1), transparency=(0, 0, 0)):
    bsdf = _core.TestBsdf()
    bsdf.begin(list(ng), list(ns), list(transparency))
    for name, parameters, weight, normal in lobes:
        bsdf.add(name, parameters, list(weight), [float(x) for x in normal])
    return bsdf


@pytest.mark.parametrize("cos_o", COSINES)
def test_mixes_follow_the_density(cos_o):
    bsdf, wo = mix(), view(cos_o)[0].tolist()

    def sample(u):
        s = bsdf.sample(wo, u)
        return s[s[:, 6] > 0, :3]

    chi2.assert_matches(sample, lambda wi: bsdf.eval(wo, wi)[:, 3], tests=len(COSINES))
    s = bsdf.sample(wo, numbers(5000))
    s = s[s[:, 6] > 0]
    e = bsdf.eval(wo, np.ascontiguousarray(s[:, :3]))
    assert np.quantile(np.abs(e / s[:, 3:7] - 1), 0.999) < 5e-3


def test_lobes_with_a_poor_estimate_of_albedo_are_sampled_too():
    """Past the critical angle a smooth surface lets nothing through, but a rough one does."""
    rough = ("ggx_refraction", {"alpha": [0.5], "ior": [1 / 1.5]})
    wo = view(0.3)
    assert not _core.lobe_albedo(*rough, wo).any()
    s = mix([("lambert", {}, [0.2] * 3, [0, 0, 1]), (*rough, [1.0] * 3, [0, 0, 1])]).sample(
        wo[0].tolist(), numbers(200_000)
    )
    through = s[(s[:, 6] > 0) & (s[:, 2] < 0)]
    alone = draw(*rough, wo)[1].mean()
    assert (through[:, 3] / through[:, 6]).sum() / len(s) == pytest.approx(alone, rel=0.1)


def test_delta_lobes_and_transparency_are_picked_by_their_share():
    lobes = [("lambert", {}, [0.2] * 3, [0, 0, 1]), ("ggx_reflection", {"alpha": [0.0]}, [0.5] * 3, [0, 0, 1])]
    bsdf, wo = mix(lobes, transparency=[0.3] * 3), view(0.7)[0].tolist()
    s = bsdf.sample(wo, numbers(50_000))
    flags = s[:, 7].astype(int)
    diffuse, specular, through = flags & 4 > 0, flags & 16 > 0, flags == 32
    assert (diffuse | specular | through).all()
    for chosen, share in ((diffuse, 0.2), (specular, 0.5), (through, 0.3)):
        assert chosen.mean() == pytest.approx(share, abs=0.01)
    assert s[specular, 3] / s[specular, 6] == pytest.approx(1.0, rel=1e-5)
    assert s[through, 3] / s[through, 6] == pytest.approx(1.0, rel=1e-5)
    assert s[through, :3] == pytest.approx(np.broadcast_to(-np.array(wo), (through.sum(), 3)), abs=1e-6)
    assert bsdf.albedo(wo) == pytest.approx([0.7] * 3)


def test_light_passes_add_up():
    bsdf, wo = mix(), view(0.6)[0].tolist()
    wi = chi2.directions(np.linspace(-0.95, 0.95, 200), np.linspace(0, 20, 200))
    parts = [bsdf.eval(wo, wi, flags)[:, :3] for flags in (1 | 4, 1 | 8, 2 | 4, 2 | 8)]
    np.testing.assert_allclose(sum(parts), bsdf.eval(wo, wi)[:, :3], rtol=1e-5, atol=1e-7)
    assert all(p.any() for i, p in enumerate(parts) if i != 2)


def test_bumped_normals_leak_no_light():
    """From beyond the horizon of the unbumped normal nothing may come, and no sample leaves through the surface."""
    bumped = (np.array([0.8, 0, 0.6])).tolist()
    bsdf = mix([("lambert", {}, [1, 1, 1], bumped), ("ggx_reflection", {"alpha": [0.5]}, [1, 1, 1], bumped)])
    wo = view(0.9, 0.0)[0].tolist()
    below = chi2.directions(np.full(200, -0.1), np.linspace(-1, 1, 200))
    assert not bsdf.eval(wo, below).any()
    s = bsdf.sample(wo, numbers(20_000))
    assert (s[s[:, 6] > 0, 2] >= 0).all()
    plain = mix([("lambert", {}, [1, 1, 1], bumped)], ns=bumped)
    above = chi2.directions(np.full(50, 0.1), np.linspace(-1, 1, 50))
    one = mix([("lambert", {}, [1, 1, 1], bumped)])
    assert (one.eval(wo, above)[:, 0] < plain.eval(wo, above)[:, 0]).all()  # bumps shadow the terminator


def test_weights_that_are_nothing_are_dropped():
    bsdf = mix([("lambert", {}, w, [0, 0, 1]) for w in ([0, 0, 0], [float("nan")] * 3, [-1, -1, -1], [1e-7] * 3)])
    assert not bsdf.sample(view(0.5)[0].tolist(), numbers(10)).any()
