"""The add-on's preferences: their real effects, the defaults where the add-on is not in Blender's list, and caches that stay within a limit."""

from __future__ import annotations

import os

import bpy
import pytest

from gi_engine import caches, engine, kept_file, log, machine, preferences
from gi_engine.compare import job

from .conftest import add, mesh


@pytest.fixture
def entry(scene):
    """The add-on's entry in Blender's list, as an enabled one has it."""
    made = bpy.context.preferences.addons.new()
    made.module = preferences.GI_Preferences.bl_idname
    yield made.preferences
    for left in [a for a in bpy.context.preferences.addons if a.module == preferences.GI_Preferences.bl_idname]:
        bpy.context.preferences.addons.remove(left)
    preferences.take()


@pytest.fixture
def folder(entry, tmp_path):
    entry.cache_folder = str(tmp_path / "cache")
    return tmp_path / "cache"


def used(path, size: int, age: float):
    """A cache of `size` bytes that was used `age` seconds ago: a reference, or a file of light."""
    if path.suffix:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(kept_file.MAGIC + bytes(size - len(kept_file.MAGIC)))
    else:
        path.mkdir(parents=True)
        (path / "piece_000.exr").write_bytes(bytes(size))
    time = path.stat().st_mtime - age
    os.utime(path, (time, time))
    return path


def test_without_an_entry_the_defaults_hold(scene):
    preferences.take()
    assert machine.current == machine.Machine()
    assert caches.folder(caches.LIGHT) == caches.system_folder() / "light"


def test_defaults_are_the_same_with_an_entry(entry):
    preferences.take()
    assert machine.current == machine.Machine()


def test_factory_settings_forget_the_preferences(entry):
    entry.threads = 1
    assert machine.current.threads == 1
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert machine.current.threads == 0


def test_every_preference_is_explained():
    for prop in preferences.GI_Preferences.bl_rna.properties:
        if prop.identifier in preferences.GI_Preferences.__annotations__:
            assert len(prop.description) > 20, prop.identifier


def test_threads_are_those_that_work(scene, entry, render_export):
    add(scene, "Square", mesh())
    entry.threads = 1
    assert render_export().settings.threads == 1
    scene.render.threads_mode, scene.render.threads = "FIXED", 3
    assert render_export().settings.threads == 3


def test_the_oldest_goes_where_there_is_too_much(folder, entry):
    old = used(folder / "references" / ("a" * 24), 600, 300)
    middle = used(folder / "light" / "room.cache", 600, 200)
    new = used(folder / "references" / ("b" * 24), 600, 100)
    entry.cache_limit = 1300 / machine.GIB
    assert [path.exists() for path in (old, middle, new)] == [False, True, True]
    caches.mark_used(middle)
    entry.cache_limit = 100 / machine.GIB
    assert [path.exists() for path in (old, middle, new)] == [False, True, False]  # the last used one stays


def test_no_limit_drops_nothing(folder, entry):
    made = [used(folder / "light" / f"{k}.cache", 10_000, k) for k in range(3)]
    entry.cache_limit = 0
    assert all(path.exists() for path in made)


def test_what_is_not_ours_stays(folder, entry):
    """Somebody may choose their home folder."""
    theirs = [folder / "letter.txt", folder / "light" / "photo.jpg", folder / "references" / "books" / "thesis.pdf"]
    for path in theirs:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(bytes(5000))
    used(folder / "light" / "x.cache", 100, 50), used(folder / "light" / "y.cache", 100, 0)
    entry.cache_limit = 1 / machine.GIB
    assert bpy.ops.gi_engine.clear_cache() == {"FINISHED"}
    assert not caches.entries() and all(path.exists() for path in theirs)


def test_a_cache_file_without_a_folder_lies_in_the_cache_folder(scene, folder, entry, tmp_path):
    """And a render that keeps one stays within the limit."""
    add(scene, "Square", mesh())
    add(scene, "Lamp", bpy.data.lights.new("Lamp", "POINT"), location=(0.5, 0.5, 2)).data.energy = 100
    scene.gi_engine.integrator, scene.gi_engine.irradiance_cache.record_samples = "irradiance_cache", 16
    old = used(folder / "light" / "old.cache", 100_000, 1000)
    entry.cache_limit = 100_001 / machine.GIB
    assert old.exists()
    scene.gi_engine.kept_file = "room.cache"
    bpy.ops.render.render()
    assert caches.is_ours(folder / "light" / "room.cache") and not old.exists()
    assert engine.kept_path(str(tmp_path / "x.cache")) == tmp_path / "x.cache" and engine.kept_path("") is None


def test_comparisons_keep_their_references_there(scene, folder, entry, monkeypatch):
    entry.threads = 1
    plans = []
    monkeypatch.setattr(job.Job, "run", lambda self, plan: plans.append(plan))
    made = job.Job(scene)
    made.done(None)
    made.cancel()
    assert plans[0]["cache"] == str(folder / "references") and plans[0]["threads"] == 1


def test_the_log_says_as_much_as_is_wanted(scene, entry, capsys):
    add(scene, "Square", mesh())
    said = {}
    for level in log.LEVELS:
        entry.log_level = level
        bpy.ops.render.render()
        said[level] = [line for line in capsys.readouterr().err.splitlines() if "GI Engine: " in line]
    assert said["WARNING"] == []
    (line,) = said["INFO"]
    assert "path, all threads: done: 1 samples" in line
    assert any("Embree 4.4.0" in line for line in said["DEBUG"]) and len(said["DEBUG"]) > len(said["INFO"])
