"""Closures: the lobes of diffuse, cloth and cartoon shading, and the layers of the Principled BSDF, against physics and closed forms."""

import chi2
import fibre_layer
import numpy as np
import pytest
from gi_engine_native import _core

from gi_engine.nodes.program import ProgramBuilder

LOBES = {
    "oren-nayar .3": ("oren_nayar", {"roughness": [0.3]}),
    "oren-nayar 1": ("oren_nayar", {"roughness": [1.0]}),
    "oren-nayar through": ("oren_nayar", {"roughness": [1.0], "transmits": [1.0]}),
    "translucent": ("translucent", {}),
    "thin .05": ("thin_transmission", {"alpha": [0.05]}),
    "thin .4": ("thin_transmission", {"alpha": [0.4]}),
    "sheen .15": ("sheen", {"roughness": [0.15]}),
    "sheen .5": ("sheen", {"roughness": [0.5]}),
    "sheen 1": ("sheen", {"roughness": [1.0]}),
    "velvet .1": ("velvet", {"sigma": [0.1]}),
    "velvet 1": ("velvet", {"sigma": [1.0]}),
    "toon": ("toon", {"size": [0.4], "smooth": [0.2]}),
    "toon wide": ("toon", {"size": [0.9], "smooth": [0.9]}),
    "toon glossy": ("toon", {"size": [0.3], "smooth": [0.1], "glossy": [1.0]}),
}
COSINES = [0.97, 0.6, 0.12]
CASES = [pytest.param(*LOBES[k], c, id=f"{k} at {c}") for k in LOBES for c in COSINES]
PRESERVING = ["oren_nayar", "translucent", "thin_transmission"]


def view(cos_o, phi=0.7):
    return chi2.directions(np.array([cos_o]), np.array([phi]))


def numbers(n, seed=3):
    return np.random.default_rng(seed).random((n, 3), np.float32)


def weights(s):
    """value / pdf of the rows of samples; 0 where there is no sample."""
    ok = s[:, 6] > 0
    w = np.zeros((len(s), 3))
    w[ok] = s[ok, 3:6].astype(float) / s[ok, 6:7]
    return w


@pytest.mark.parametrize(("name", "parameters", "cos_o"), CASES)
def test_samples_follow_the_density(name, parameters, cos_o):
    wo, parameters = view(cos_o), {**parameters, "cos_o": [cos_o]}

    def sample(u):
        s = _core.lobe_sample(name, parameters, wo, u)
        return s[s[:, 6] > 0, :3]

    # A cone's edge crosses bins: many points for the integral to see it.
    order = 96 if name == "toon" else 24
    chi2.assert_matches(
        sample, lambda wi: _core.lobe_eval(name, parameters, wo, wi)[:, 3], tests=len(CASES), order=order
    )


@pytest.mark.parametrize(("name", "parameters", "cos_o"), CASES)
def test_sampling_and_evaluating_agree(name, parameters, cos_o):
    wo, parameters = view(cos_o), {**parameters, "cos_o": [cos_o]}
    s = _core.lobe_sample(name, parameters, wo, numbers(20_000))
    s = s[s[:, 6] > 0]
    assert len(s) > 5_000
    assert np.isfinite(s).all()
    e = _core.lobe_eval(name, parameters, wo, np.ascontiguousarray(s[:, :3]))
    error = np.abs(e - s[:, 3:7]) / np.maximum(s[:, 3:7], 1e-4)
    assert np.quantile(error, 0.999) < 2e-3
    assert ((s[:, 7].astype(int) & 2) > 0).tolist() == (s[:, 2] < 0).tolist()


@pytest.mark.parametrize(("name", "parameters", "cos_o"), CASES)
def test_energy(name, parameters, cos_o):
    """No lobe makes energy; those that preserve it lose none; an albedo that is claimed is the true one."""
    wo, parameters = view(cos_o), {**parameters, "cos_o": [cos_o]}
    w = weights(_core.lobe_sample(name, {**parameters, "color": [1.0]}, wo, numbers(100_000)))
    mean, error = w.mean(0), w.std(0) / np.sqrt(len(w))
    assert (mean <= 1 + 4 * error + 3e-3).all()
    if name in PRESERVING:
        assert mean == pytest.approx(1, abs=0.01)
    if name in (*PRESERVING, "sheen"):
        claimed = _core.lobe_albedo(name, {**parameters, "color": [1.0]}, wo)[0]
        assert (np.abs(claimed - mean) < 4 * error + 3e-3).all()


@pytest.mark.parametrize("roughness", [0.2, 1.0])
def test_oren_nayar_is_reciprocal_and_tends_to_lambert(roughness):
    rng = np.random.default_rng(5)
    a, b = (chi2.directions(rng.uniform(0.02, 1, 2000), rng.uniform(0, 2 * np.pi, 2000)) for _ in range(2))
    rough = {"roughness": [roughness], "color": [0.9, 0.5, 0.1]}
    forth = _core.lobe_eval("oren_nayar", rough, a, b)[:, :3] / b[:, 2:]
    back = _core.lobe_eval("oren_nayar", rough, b, a)[:, :3] / a[:, 2:]
    np.testing.assert_allclose(forth, back, rtol=2e-4)
    smooth = _core.lobe_eval("oren_nayar", {"roughness": [1e-6]}, a, b)[:, :3] / b[:, 2:]
    np.testing.assert_allclose(smooth, 1 / np.pi, rtol=1e-4)


def test_diffuse_lobes_see_light_where_a_bumped_normal_turns_from_the_viewer():
    """The cosine of the viewer counts as 0 then; what it multiplies elsewhere stays."""
    rng = np.random.default_rng(4)
    wo = chi2.directions(-rng.uniform(0.05, 0.9, 500), rng.uniform(0, 2 * np.pi, 500))
    wi = chi2.directions(rng.uniform(0.05, 1, 500), rng.uniform(0, 2 * np.pi, 500))
    a = 1 / (np.pi + np.pi / 2 - 2 / 3)
    s = (wo * wi).sum(1)
    expected = a * wi[:, 2] * (1 + np.where(s > 0, s / wi[:, 2], s))  # black: no light scattered more than once
    black = _core.lobe_eval("oren_nayar", {"roughness": [1.0], "color": [0.0]}, wo, wi)[:, 0]
    np.testing.assert_allclose(black, expected, rtol=1e-4, atol=1e-5)
    toon = {"size": [0.6], "smooth": [0.1]}
    np.testing.assert_array_equal(_core.lobe_eval("toon", toon, wo, wi), _core.lobe_eval("toon", toon, view(0.5), wi))


@pytest.mark.parametrize(("cos_o", "roughness"), [(0.95, 1.0), (0.37, 0.52), (0.2, 0.31), (0.09, 0.24)])
def test_sheen_reflects_what_a_layer_of_fibres_does(cos_o, roughness):
    """Off the table's grid, against a random walk through the fibres."""
    w = fibre_layer.reflected(cos_o, roughness**2, np.random.default_rng(9))
    truth, error = len(w) / fibre_layer.WALKS, np.sqrt(len(w)) / fibre_layer.WALKS
    claimed = _core.lobe_albedo("sheen", {"roughness": [roughness], "cos_o": [cos_o]}, view(cos_o))[0, 0]
    assert abs(claimed - truth) < 4 * error + 0.015 * truth + 0.002
    # Light leaves towards the viewer's side, as far as the walk says.
    s = _core.lobe_sample("sheen", {"roughness": [roughness], "cos_o": [cos_o]}, view(cos_o, 0.0), numbers(50_000))
    assert s[:, 0].mean() == pytest.approx(w[:, 0].mean(), abs=0.05)


# -------------------------------------------------------------------- Principled

PLAIN = {
    "coat": 0.0, "coat_roughness": 0.03, "coat_ior": 1.5, "coat_tint": (1, 1, 1),
    "sheen": 0.0, "sheen_roughness": 0.5, "sheen_tint": (1, 1, 1),
    "base_color": (1, 1, 1), "metallic": 0.0, "roughness": 0.5, "ior": 1.5, "thin_wall": 0.0,
    "diffuse_roughness": 0.0, "subsurface": 0.0, "subsurface_anisotropy": 0.0, "specular": 0.5, "specular_tint": (1, 1, 1),
    "anisotropic": 0.0, "rotation": 0.0, "tangent": (0, 0, 0), "transmission": 0.0, "film": 0.0, "film_ior": 1.33,
}  # fmt: skip
MULTISCATTER = 3
WHITE = {
    "plain": {},
    "smooth": {"roughness": 0.0},
    "metal": {"metallic": 1.0},
    "half metal": {"metallic": 0.5},
    "coat": {"coat": 1.0},
    "rough coat": {"coat": 1.0, "coat_roughness": 0.7},
    "sheen": {"sheen": 1.0},
    "glass": {"transmission": 1.0, "roughness": 0.2},
    "thin glass": {"transmission": 1.0, "thin_wall": 1.0, "roughness": 0.4},
    "leaf": {"subsurface": 1.0, "thin_wall": 1.0, "subsurface_anisotropy": 0.3, "diffuse_roughness": 0.6},
    "diamond": {"ior": 2.4, "roughness": 1.0},
    "soap": {"transmission": 1.0, "roughness": 0.1, "film": 420.0},
    "soap bubble": {"transmission": 1.0, "roughness": 0.0, "thin_wall": 1.0, "film": 420.0},
    "everything": {
        "coat": 0.6,
        "sheen": 0.7,
        "metallic": 0.3,
        "transmission": 0.4,
        "diffuse_roughness": 1.0,
        "roughness": 0.8,
    },
}


def shaded(op, *inputs, imm=(), cos_o=1.0, backfacing=False):
    b = ProgramBuilder()
    b.op(op, *inputs, imm=imm)
    return shaded_by(b, cos_o, backfacing)


def shaded_by(b, cos_o, backfacing):
    p = b.finish("test")
    wo = tuple(float(x) for x in view(cos_o)[0])
    return _core.ShadedPoint(p.code.tolist(), p.constants.tolist(), p.register_count, p.tables.tolist(), wo, backfacing)


def principled(cos_o=1.0, backfacing=False, **changes):
    b = ProgramBuilder()
    stack_layers(b, **changes)
    return shaded_by(b, cos_o, backfacing)


def stack_layers(b, **changes):
    """All layers of the Principled BSDF, as its rule stacks them."""
    unknown = set(changes) - set(PLAIN)
    assert not unknown
    p = {**PLAIN, **changes}
    unlinked, film, imm = (0, 0, 0), (p["film"], p["film_ior"]), (MULTISCATTER,)
    brushed = p["anisotropic"], p["rotation"], p["tangent"]
    below = b.op("sheen_layer", 1.0, unlinked, unlinked, p["coat"], p["sheen"], p["sheen_roughness"], p["sheen_tint"])
    below = b.op("coat_layer", below, unlinked, p["coat"], p["coat_roughness"], p["coat_ior"], p["coat_tint"])
    metal = p["metallic"], p["base_color"], p["specular_tint"], p["roughness"]
    below = b.op("metal_layer", below, unlinked, *metal, *brushed, *film, imm=imm)
    glass = p["transmission"], p["base_color"], p["specular_tint"], p["roughness"], p["ior"], p["thin_wall"]
    below = b.op("glass_layer", below, unlinked, *glass, *film, imm=imm)
    specular = p["roughness"], p["ior"], p["specular"], p["specular_tint"]
    below = b.op("specular_layer", below, unlinked, *specular, *brushed, *film, imm=imm)
    base = p["base_color"], p["diffuse_roughness"], p["subsurface"], p["subsurface_anisotropy"], p["thin_wall"]
    below_skin = (1, 1, 1), 0.0, p["roughness"], p["ior"], p["specular"], 1.4
    b.op("base_layer", below, unlinked, *base, *below_skin, imm=(0,))


@pytest.mark.parametrize("cos_o", [1.0, 0.6, 0.15])
@pytest.mark.parametrize("key", WHITE)
def test_white_principled_in_a_furnace(key, cos_o):
    """All white: nothing is made, and next to nothing lost (Schlick albedos of layers are estimates)."""
    w = weights(principled(cos_o, **WHITE[key]).sample(numbers(60_000)))
    mean, error = w.mean(0), w.std(0) / np.sqrt(len(w))
    assert (mean <= 1 + 4 * error + 0.006).all()
    assert (mean >= 0.97 - 4 * error).all()


@pytest.mark.parametrize("cos_o", [1.0, 0.6, 0.15])
def test_brushed_metal_in_a_furnace(cos_o):
    """Brushed metal gets its energy back from the table of isotropic facets, as in Cycles: a few per cent off."""
    brushed = principled(cos_o, metallic=1.0, anisotropic=0.8, tangent=(1, 0, 0), rotation=0.1)
    mean = weights(brushed.sample(numbers(60_000))).mean()
    assert 0.9 < mean < 1.04


@pytest.mark.parametrize("key", ["plain", "everything", "rough coat", "leaf"])
def test_principled_samples_follow_the_density(key):
    p = principled(0.6, **{**WHITE[key], "coat_roughness": 0.5})

    def sample(u):
        s = p.sample(u)
        return s[s[:, 6] > 0, :3]

    chi2.assert_matches(sample, lambda wi: p.eval(wi)[:, 3], tests=4)


def test_layers_of_the_principled_bsdf_take_from_those_below():
    def diffuse_left(**changes):
        """What the base sends straight back, seen from above, with the specular level at 0."""
        straight = view(1.0)
        return principled(0.5, specular=0.0, base_color=(0.5, 0.5, 0.5), **changes).eval(straight)[0, 0]

    base = diffuse_left()
    assert base == pytest.approx(0.5 / np.pi, rel=1e-4)
    assert diffuse_left(metallic=0.25, roughness=0.0) == pytest.approx(0.75 * base, rel=1e-4)
    assert diffuse_left(transmission=0.25, roughness=0.0) == pytest.approx(0.75 * base, rel=1e-4)
    # A smooth coat takes its Fresnel reflectance at this angle; the tint absorbs along the refracted ray. [Beer's law]
    cos_t = np.sqrt(1 - (1 - 0.25) / 1.5**2)
    s, p = (0.5 - 1.5 * cos_t) / (0.5 + 1.5 * cos_t), (cos_t - 1.5 * 0.5) / (cos_t + 1.5 * 0.5)
    through = 1 - 0.5 * (s * s + p * p)
    assert diffuse_left(coat=1.0, coat_roughness=0.0) == pytest.approx(through * base, rel=0.01)
    tinted = diffuse_left(coat=1.0, coat_roughness=0.0, coat_tint=(0.3, 0.3, 0.3))
    assert tinted == pytest.approx(through * 0.3 ** (1 / cos_t) * base, rel=0.01)


def test_thin_glass_is_the_series_of_its_reflections():
    """R = F + (1−F)² F c² / (1 − F² c²), T = (1−F)² c / (1 − F² c²), with c the absorption along the refracted ray."""
    cos_o, ior, color = 0.6, 1.5, 0.7
    cos_t = np.sqrt(1 - (1 - cos_o**2) / ior**2)
    s, p = (cos_o - ior * cos_t) / (cos_o + ior * cos_t), (cos_t - ior * cos_o) / (cos_t + ior * cos_o)
    f, c = 0.5 * (s * s + p * p), color ** (1 / cos_t)
    sample = principled(cos_o, transmission=1.0, thin_wall=1.0, roughness=0.0, base_color=(color,) * 3).sample(
        numbers(1000)
    )
    up = sample[:, 2] > 0
    through = (1 - f) ** 2 * c / (1 - (f * c) ** 2)
    assert sample[up, 3] == pytest.approx(f + through * f * c, rel=1e-3)
    assert sample[~up, 3] == pytest.approx(through, rel=1e-3)
    assert sample[~up, :3] == pytest.approx(np.broadcast_to(-view(cos_o), ((~up).sum(), 3)), abs=1e-5)


def test_emission_lies_under_the_coat():
    b = ProgramBuilder()
    below = b.op("coat_layer", 0.5, (0, 0, 0), 1.0, 0.0, 1.5, (1, 1, 1))
    b.op("emission", 1.0, b.op("vector_multiply", (1.0, 2.0, 3.0), below), 2.0)
    emitted = shaded_by(b, 1.0, False).emission
    assert emitted == pytest.approx(np.array([1.0, 2.0, 3.0]) * 0.96, rel=0.01)  # 4 % reflected at normal incidence


def test_mix_and_alpha():
    assert shaded("alpha", 0.8, 0.25).transparency == pytest.approx((0.6, 0.6, 0.6))
    assert shaded("transparent", 0.5, (0.2, 0.4, 0.6)).transparency == pytest.approx((0.1, 0.2, 0.3))
    assert shaded("emission", 0.5, (1.0, 2.0, 3.0), 4.0).emission == pytest.approx((2.0, 4.0, 6.0))
    b = ProgramBuilder()
    first, second = b.op("mix_weights", 0.5, 1.5)  # the factor is clamped
    b.op("emission", first, (1.0, 0.0, 0.0), 1.0)
    b.op("emission", second, (0.0, 1.0, 0.0), 1.0)
    p = b.finish("test")
    point = _core.ShadedPoint(
        p.code.tolist(), p.constants.tolist(), p.register_count, p.tables.tolist(), (0.0, 0.0, 1.0)
    )
    assert point.emission == pytest.approx((0.0, 0.5, 0.0))


def test_odd_input_is_harmless():
    """Negative and infinite weights, roughness beyond its range, normals of length 0."""
    for op, inputs, imm in (
        ("diffuse", (-1.0, (0.5, 0.5, 0.5), 0.0, (0, 0, 0)), ()),
        ("diffuse", (float("inf"), (0.5, 0.5, 0.5), 0.0, (0, 0, 0)), ()),
        ("glossy", (1.0, (0.5, -1.0, 0.5), 7.0, 3.0, 0.0, (0, 0, 0), (1, 0, 0)), (0,)),
        ("glass", (1.0, (0.5, 0.5, 0.5), -2.0, 0.0, (0, 0, 0), -3.0, 0.0), (3,)),
        ("metallic", (1.0, (2.0, 0.5, -0.5), (3.0, 0, 0), 9.0, 5.0, 0.1, (0, 0, 0), (0, 0, 1), 0.0, 0.0), (3, 0)),
        ("toon", (1.0, (0.5, 0.5, 0.5), -1.0, 5.0, (0, 0, 0)), (1,)),
        ("sheen", (1.0, (0.5, 0.5, 0.5), 40.0, (0, 0, 0)), ()),
    ):
        point = shaded(op, *inputs, imm=imm, cos_o=0.4)
        s = point.sample(numbers(2000))
        assert np.isfinite(s).all(), op
        assert (s[:, 3:7] >= 0).all(), op
        assert np.isfinite(point.eval(np.ascontiguousarray(s[:, :3]))).all(), op
