"""Every node of Blender's RNA that gives values, in every mode, agrees with Cycles pixel by pixel. The closures are in node_report."""

import numpy as np
import pytest

from . import node_rows, node_suite
from .known_nodes import KNOWN


@pytest.fixture(scope="module")
def results():
    rows = [row for kind in node_rows.kinds() for row in node_rows.rows_of(kind)]
    return node_suite.results([row for row in rows if not row.closure and row.idname not in node_suite.RANDOM])


def test_there_are_rows_for_every_node_that_gives_values(results):
    assert len({result.idname for result in results}) > 60


def test_values_agree_but_for_what_is_known(results):
    wrong = {result.idname for result in results if result.state in ("differs", "fallback")}
    new = sorted(
        f"{r.idname}: {r.name} ({r.state})" for r in results if r.idname in wrong - set(KNOWN) and r.state != "agrees"
    )
    assert not new, "\n".join(new)


def test_what_is_known_to_differ_still_does(results):
    """So that the list does not outlive its reasons."""
    wrong = {result.idname for result in results if result.state in ("differs", "fallback")}
    present = {result.idname for result in results}
    assert not (set(KNOWN) & present) - wrong


def pictures(exponent: float, engine: int, seeds: int) -> np.ndarray:
    """A power of the distance from every third column of pixels, a cusp, as rays with an engine's jitter see it."""
    jitter = np.random.default_rng(engine).uniform(-0.005, 0.005, (seeds, 24, 24))
    distance = np.abs((np.arange(24) + jitter + 1.5) % 3 - 1.5)
    return np.repeat((40 + 20 * (2 * distance) ** exponent)[..., None], 3, -1)


@pytest.mark.parametrize(
    ("exponent", "seeds", "state"), [(0.25, 1, "differs"), (0.25, 8, "agrees"), (0.26, 8, "differs")]
)
def test_several_seeds_tell_cusps_from_differences(exponent, seeds, state):
    theirs, ours = pictures(0.25, 1, seeds), pictures(exponent, 2, seeds)
    assert node_suite.pixels_of(node_rows.Row("", ""), theirs, ours, []).state == state
