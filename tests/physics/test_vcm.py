"""Vertex connection and merging: one file that is bidirectional path tracing and progressive photon mapping, and agrees with both."""

import math

import numpy as np
import pytest
from agreement_scenes import CAUSTICS, SCENES, STRANDS
from light_scenes import lamp, matrix
from test_closed_forms import glass, quad, scene_of, shiny, sphere, surface
from test_photons import ALIKE, SEEDS, blocks_of, shoot

ALL = SCENES | CAUSTICS
SOME = ["area lamp", "gloss", "rough glass", "transparent shadows", "mirror and diffuse", "clear glass in the sun"]


def assert_agree(truth, found, blur):
    """Block by block, and as a whole: `blur` is the share that discs which are cut at edges may take."""
    error = np.sqrt((truth.var(0, ddof=1) + found.var(0, ddof=1)) / SEEDS) + 1e-6
    off = np.abs(truth.mean(0) - found.mean(0))
    assert (off < 9 * error + 2 * blur * truth.mean(0)).all()
    whole = np.sqrt((truth.mean(1).var(0, ddof=1) + found.mean(1).var(0, ddof=1)) / SEEDS)
    off = np.abs(truth.mean((0, 1)) - found.mean((0, 1)))
    assert (off < 5 * whole + blur * truth.mean((0, 1))).all()


@pytest.mark.parametrize("name", SOME)
def test_without_merging_it_is_bidirectional_path_tracing(name):
    """Number for number."""
    found = blocks_of(ALL[name], "vcm", 2, terms="CONNECT")
    assert np.array_equal(blocks_of(ALL[name], "bdpt", 2), found)


# Photons that meet the narrow lobes of rough glass are rare and bright: few seeds do not tell how noisy they are.
@pytest.mark.parametrize("name", [name for name in SOME if name != "rough glass"])
def test_without_connections_it_is_progressive_photon_mapping(name):
    truth = blocks_of(ALL[name], "sppm", 64, photons=1000, radius=1)
    assert_agree(truth, blocks_of(ALL[name], "vcm", 64, terms="MERGE", radius=0.5), 0.01)


@pytest.mark.parametrize("name", [name for name in ALL if name not in ALIKE])
def test_all_terms_agree_with_bidirectional_path_tracing(name):
    """Pixels of 1/32 of the picture: discs of one pixel are cut at every edge."""
    assert_agree(blocks_of(ALL[name], "bdpt", 16), blocks_of(ALL[name], "vcm", 16, radius=1), 0.003)


@pytest.mark.parametrize("name", STRANDS)
def test_strands_that_no_photon_lies_on_agree_too(name):
    """Discs of a tenth of a pixel: on the surfaces beside fibres they are cut nearly everywhere."""
    assert_agree(blocks_of(STRANDS[name], "path", 64), blocks_of(STRANDS[name], "vcm", 16, radius=0.1), 0.003)


def test_it_sees_in_a_mirror_what_a_mirror_throws():
    """Point light of 10 W/sr 2 m above the floor, 1 m from an upright mirror in which the eye sees the floor: L S D S E."""
    floor = quad((0, -8, 0), (16, -8, 0), (16, 8, 0), (0, 8, 0))
    mirror = quad((0, -16, 0), (0, 16, 0), (0, 16, 16), (0, -16, 16))
    light = lamp("POINT", (40 * math.pi,) * 3, matrix=matrix((1, 0, 2)))

    def seen(way, runs=6, **options):
        scene = scene_of((floor, surface(1.0)), (mirror, shiny(0.0)), lights=[light])
        return math.pi * np.array(
            [
                shoot(way, scene, (1.5, 0, 1), (-3, 0, -1), samples=24, pixels=64, width=0.1, seed=k + 1, **options)[
                    0
                ].mean()
                for k in range(runs)
            ]
        )

    found = seen("vcm", radius=4)
    error = found.std(ddof=1) / math.sqrt(len(found))
    assert error < 0.06
    assert abs(found.mean() - 2.892147) < 4 * error + 0.01
    assert seen("bdpt").mean() < 2.4  # and without merging it does not


@pytest.mark.parametrize("way", ["bdpt", "vcm"])
def test_later_passes_aim_at_caustics(way):
    """A small glass ball in a wide scene: what pass by pass is learnt lowers the noise faster than the number of passes does."""
    floor = quad((-10, -10, -0.5), (10, -10, -0.5), (10, 10, -0.5), (-10, 10, -0.5))
    light = lamp("SPOT", (1000.0,) * 3, matrix=matrix((0.5, 0, 6)), radius=0.1, spot_size=1.8)
    scene = scene_of((floor, surface(0.8)), (sphere(0.3, 32), glass(1.5)), lights=[light])

    def variance(samples):
        images = [
            shoot(way, scene, (0, 0, -0.4), (0, 0, -1), samples=samples, pixels=24, width=0.5, seed=k + 1)[0]
            for k in range(6)
        ]
        return np.var(images, axis=0, ddof=1).mean()

    assert variance(64) < variance(1) / 64 / 1.7
