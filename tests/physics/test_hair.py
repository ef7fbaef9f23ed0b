"""Lobes of fibres: they sample what they say, scatter what a fibre of glass does, and no more than they get. Their frame: x along the fibre."""

import chi2
import numpy as np
import pytest
from gi_engine_native import _core

STRANDS = {
    "reflection": ("hair_strand", {"along": [0.1], "around": [0.3]}),
    "wide reflection": ("hair_strand", {"along": [0.6], "around": [0.9], "offset": [0.2]}),
    "transmission": ("hair_strand_through", {"along": [0.2], "around": [0.5], "offset": [-0.1]}),
}
FIBRES = {
    "chiang": ("hair_chiang", {"h": [0.4]}),
    "chiang, smooth": ("hair_chiang", {"along": [0.12], "around": [0.15], "h": [-0.7], "offset": [0.1]}),
    "chiang, rough": ("hair_chiang", {"along": [0.9], "around": [0.8], "sigma": [0.2, 0.5, 1.0], "h": [0.95]}),
    "chiang, coat": ("hair_chiang", {"along": [0.5], "coat": [0.6], "h": [0.1], "sigma": [1.0]}),
    "huang": ("hair_huang", {"roughness": [0.3]}),
    "huang, smooth": ("hair_huang", {"roughness": [0.1], "offset": [0.1]}),
    "huang, elliptic": ("hair_huang", {"roughness": [0.5], "aspect": [0.6], "sigma": [0.2, 0.5, 1.0]}),
}
LOBES = STRANDS | FIBRES
ANGLES = [0.0, 0.5, -1.2]  # of the view to the fibre's cross section
CASES = [pytest.param(*LOBES[k], a, id=f"{k} at {a}") for k in LOBES for a in ANGLES]


def view(angle):
    """Across z: as the lobes that have a frame of their own want it."""
    return np.array([[np.sin(angle), -np.cos(angle), 0.0]], np.float32)


def drawn(name, parameters, wo, n=100_000):
    s = _core.lobe_sample(name, parameters, wo, np.random.default_rng(3).random((n, 3), np.float32))
    ok = s[:, 6] > 0
    weight = np.zeros((n, 3))
    weight[ok] = s[ok, 3:6].astype(float) / s[ok, 6:7]
    return s[ok], weight


def total(name, parameters, angle):
    """The whole of what is scattered, from samples: mean and its error."""
    _, weight = drawn(name, parameters, view(angle))
    return weight.mean(0), weight.std(0) / np.sqrt(len(weight))


@pytest.mark.parametrize(("name", "parameters", "angle"), CASES)
def test_samples_follow_the_density(name, parameters, angle):
    wo = view(angle)

    def sample(u):
        s = _core.lobe_sample(name, parameters, wo, u)
        return s[s[:, 6] > 0, :3]

    order = 8 if name == "hair_huang" else 24  # each evaluation of which is an integral
    density = lambda wi: _core.lobe_eval(name, parameters, wo, wi)[:, 3]  # noqa: E731
    chi2.assert_matches(sample, density, tests=len(CASES), order=order)


@pytest.mark.parametrize(("name", "parameters", "angle"), CASES)
def test_sampling_and_evaluating_agree(name, parameters, angle):
    wo = view(angle)
    s, _ = drawn(name, parameters, wo, 5000)
    assert len(s) > 4000 and np.isfinite(s).all() and (s[:, 3:7] >= 0).all()
    assert np.abs(np.linalg.norm(s[:, :3], axis=1) - 1).max() < 1e-5
    e = _core.lobe_eval(name, parameters, wo, np.ascontiguousarray(s[:, :3]))
    if parameters.get("around", [0])[0] > 0.5 and "strand" in name:
        e = e[:, 3:]  # what it throws over 90° aside is not evaluated
        s = s[:, :7]
        assert np.quantile(np.abs(e[:, 0] / s[:, 6] - 1), 0.99) < 1e-2
        return
    error = np.abs(e - s[:, 3:7]) / np.maximum(s[:, 3:7], 1e-4)
    assert np.quantile(error, 0.99) < 1e-2


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("key", [k for k in FIBRES if k.startswith("chiang")])
def test_white_furnace_of_a_clear_fibre(key, angle):
    name, parameters = FIBRES[key]
    mean, error = total(name, parameters | {"sigma": [0.0]}, angle)
    tilt = (
        0.01 if parameters.get("offset") else 0.0
    )  # scales turn the cosine by which scattering along the fibre is weighed
    assert np.abs(mean - 1).max() < 5 * error.max() + 2e-3 + tilt


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("key", [k for k in FIBRES if k.startswith("huang")])
def test_fibres_of_facets_make_no_energy(key, angle):
    name, parameters = FIBRES[key]
    mean, error = total(name, parameters | {"sigma": [0.0]}, angle)
    assert (mean < 1.08 + 5 * error).all() and (mean > 0.85).all()


def fresnel(cos_i, eta):
    g = np.sqrt(eta**2 - 1 + cos_i**2)
    s, p = (cos_i - g) / (cos_i + g), (g - eta**2 * cos_i) / (g + eta**2 * cos_i)
    return 0.5 * (s**2 + p**2)


@pytest.mark.parametrize("angle", [0.0, 0.6])
def test_a_smooth_fibre_of_facets_is_a_cylinder_of_glass(angle):
    """R, TT and TRT, each alone, against ray optics over the width of a circular cylinder. [Marschner et al. 2003, eq. 10]"""
    eta, sigma = 1.55, 0.3
    h = np.linspace(-1, 1, 20001)[1:-1]
    cos_o = np.cos(angle)
    f = fresnel(cos_o * np.sqrt(1 - h**2), eta)
    gamma_t = np.arcsin(h * cos_o / np.sqrt(eta**2 - np.sin(angle) ** 2))
    passed = np.exp(-2 * sigma * np.cos(gamma_t) / np.sqrt(1 - (np.sin(angle) / eta) ** 2))
    truth = {"r": f.mean(), "tt": ((1 - f) ** 2 * passed).mean(), "trt": ((1 - f) ** 2 * f * passed**2).mean()}
    smooth = {"roughness": [0.08], "offset": [0.0], "sigma": [sigma], "ior": [eta]}
    for part in ("r", "tt"):
        alone = {name: [float(name == part)] for name in truth}
        mean, error = total("hair_huang", smooth | alone, angle)
        assert abs(mean[0] - truth[part]) < 0.15 * truth[part] + 4 * error[0], part


def test_aspect_of_one_is_a_circle():
    wo, wi = view(0.3), chi2.directions(np.linspace(-0.9, 0.9, 4000), np.linspace(0, 40, 4000))
    one, nearly = (_core.lobe_eval("hair_huang", {"aspect": [a]}, wo, wi)[:, :3].mean() for a in (1.0, 0.9999))
    assert one == pytest.approx(nearly, rel=0.02)


@pytest.mark.parametrize("name", ["hair_chiang", "hair_huang"])
def test_pigment_takes_what_it_takes(name):
    """Darker by channel as absorption grows; what is reflected first stays."""
    totals = [total(name, {"sigma": [s, 2 * s, 4 * s]}, 0.3)[0] for s in (0.1, 0.5, 5.0)]
    assert (np.diff(totals, axis=0) < 0).all() and (np.diff(totals, axis=1)[:2] < 0).all()
    assert totals[-1].min() > 0.03


@pytest.mark.parametrize("name", ["hair_chiang", "hair_huang", "hair_strand", "hair_strand_through"])
def test_extremes_stay_finite(name):
    for parameters in (
        {"along": [0.0], "around": [0.0], "roughness": [0.02], "ior": [1.0], "h": [1.0]},
        {
            "along": [2.0],
            "around": [2.0],
            "roughness": [2.0],
            "sigma": [1e8],
            "h": [-1.0],
            "aspect": [2.0],
            "ior": [3.0],
        },
        {"offset": [1.5], "ior": [0.7], "aspect": [0.05]},
    ):
        for angle in (0.0, 1.57, -1.5708):
            s = _core.lobe_sample(name, parameters, view(angle), np.random.default_rng(1).random((300, 3), np.float32))
            e = _core.lobe_eval(
                name, parameters, view(angle), chi2.directions(np.linspace(-1, 1, 300), np.linspace(0, 9, 300))
            )
            assert np.isfinite(s).all() and np.isfinite(e).all()
