"""Presets: what they name exists, and they make the scene's settings its own."""

from __future__ import annotations

import bpy
import pytest

from gi_engine import native
from gi_engine.presets import PRESETS


@pytest.mark.parametrize("name", sorted(PRESETS))
def test_a_preset_sets_what_it_says_and_renders(scene, name):
    preset = PRESETS[name]
    assert bpy.ops.gi_engine.preset(preset=name) == {"FINISHED"}
    own = scene.gi_engine
    assert own.is_own and own.integrator == preset.integrator
    chosen = next(d for d in native.integrators() if d["id"] == preset.integrator)
    known = {p["name"] for p in chosen["parameters"]}
    for key, value in preset.settings.items():
        assert getattr(own, key) == pytest.approx(value), key
        limits = ("samples", "noise_target", "use_denoising", "denoising_quality")
        assert key in known or key in limits, f"{preset.integrator} has no {key}"
    assert set(preset.parameters) <= known
    own.samples = 1
    assert bpy.ops.render.render() == {"FINISHED"}
