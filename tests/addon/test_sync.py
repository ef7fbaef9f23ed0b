"""What a viewport takes over of a scene that changes: after every edit the same as a fresh export, and no more read than has changed."""

from __future__ import annotations

import random
from collections import Counter

import bpy
import pytest

from gi_engine import native
from gi_engine.export import export
from gi_engine.export.film import frame_size
from gi_engine.sameness import same
from gi_engine.sync import Sync

from .conftest import add, mesh
from .edits import EDITS, do, objects

PARTS = ("world", "lights", "attribute_names", "programs", "instances", "meshes", "images")


class Watched:
    """A Sync that hears of each change of the scene, as a viewport does."""

    handlers = (bpy.app.handlers.depsgraph_update_post, bpy.app.handlers.frame_change_post)

    def __init__(self):
        self.sync, self.restarts = Sync(), 0
        for handlers in self.handlers:
            handlers.append(self.changed)
        self.sync.update(bpy.context.evaluated_depsgraph_get())

    def changed(self, scene, depsgraph):
        self.restarts += self.sync.update(depsgraph)

    def settle(self):
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        if self.sync.is_stale(depsgraph):  # as drawing finds out
            self.restarts += self.sync.update(depsgraph)

    def reads(self) -> Counter:
        known = self.sync.known
        kinds = {"meshes": known.meshes, "images": known.images, "programs": known.programs}
        return Counter({"walks": self.sync.walks, "restarts": self.restarts} | {k: v.reads for k, v in kinds.items()})

    def read_by(self, change) -> dict:
        """How often what was read because of a change."""
        before = self.reads()
        change()
        self.settle()
        return dict(self.reads() - before)

    def close(self):
        for handlers in self.handlers:
            handlers.remove(self.changed)


@pytest.fixture
def watched(scene):
    add(scene, "Square", mesh(), location=(-2, -2, 0), scale=(4, 4, 4))
    add(scene, "Lamp", bpy.data.lights.new("Lamp", "POINT"), location=(0, 0, 2)).data.energy = 100
    scene.world = bpy.data.worlds.new("World")
    if bpy.app.version < (5, 0, 0):
        scene.world.use_nodes = True
    bpy.ops.ed.undo_push(message="Begin")
    made = Watched()
    yield made
    made.close()


def fresh():
    depsgraph = bpy.context.evaluated_depsgraph_get()
    size = frame_size(depsgraph.scene_eval.render)
    return export(depsgraph, native.integrators(), None, size, needs_camera=False)


def textured(name: str):
    """A square whose material shows an image."""
    item = add(bpy.context.scene, name, mesh())
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.new(name, 4, 4)
    tree.links.new(texture.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    item.data.materials.append(material)
    return material


def set_value(owner, name, value):
    return lambda: setattr(owner, name, value)


def test_only_what_changed_is_read(watched):
    material = textured("Textured")
    textured("Other")
    watched.settle()
    scene, item, lamp = bpy.context.scene, objects("MESH")[0], objects("LIGHT")[0]
    shader, background = material.node_tree.nodes["Principled BSDF"], scene.world.node_tree.nodes["Background"]
    assert watched.read_by(set_value(scene.camera.location, "x", 1.0)) == {}
    assert watched.read_by(set_value(item.location, "x", 1.0)) == {"restarts": 1}
    assert watched.read_by(set_value(lamp.location, "x", 1.0)) == {"restarts": 1}
    from_5 = {"programs": 1} if bpy.app.version >= (5, 0, 0) else {}  # every lamp has nodes there
    assert watched.read_by(set_value(lamp.data, "energy", 5.0)) == {"restarts": 1} | from_5
    roughness, strength = shader.inputs["Roughness"], background.inputs["Strength"]
    assert watched.read_by(set_value(roughness, "default_value", 0.1)) == {"restarts": 1, "programs": 1}
    assert watched.read_by(set_value(strength, "default_value", 0.1)) == {"restarts": 1, "programs": 1}

    def bend():
        item.data.vertices[0].co.z += 1
        item.data.update()

    assert watched.read_by(bend) == {"restarts": 1, "meshes": 1}
    image = bpy.data.images["Other"]

    def draw():
        image.pixels.foreach_set([0.5] * 64)
        image.update_tag()

    assert watched.read_by(draw)["images"] == 1


def test_settings_alone_are_read_alone(watched):
    scene = bpy.context.scene

    def change():
        scene.gi_engine.is_own = True
        scene.gi_engine.clamp_direct = 3
        scene.render.film_transparent = True  # of which every version tells

    assert watched.read_by(change) == {"restarts": 1}
    assert watched.sync.exported.settings.parameters["clamp_direct"] == 3


def test_what_is_as_before_does_not_begin_anew(watched):
    item = objects("MESH")[0]
    assert "restarts" not in watched.read_by(item.update_tag)
    before = watched.sync.exported.scene
    again = watched.read_by(item.data.update)
    assert "restarts" not in again and watched.sync.exported.scene is before


def test_objects_stay_in_blenders_order(watched):
    """Which a parent changes, though it says of the child alone that it changed."""
    add(bpy.context.scene, "Late", mesh())
    later = add(bpy.context.scene, "Later", mesh())
    watched.settle()
    objects("LIGHT")[0].parent = later
    watched.settle()
    compare(watched.sync.exported, fresh(), "a lamp with a parent")


def test_a_mesh_is_shared_again_after_edit_mode(watched):
    """While one of two objects is edited, it has a mesh of its own."""
    first = objects("MESH")[0]
    add(bpy.context.scene, "Twin", first.data)
    watched.settle()
    bpy.context.view_layer.objects.active = first
    for mode in ("EDIT", "OBJECT"):
        bpy.ops.object.mode_set(mode=mode)
        watched.settle()
        bpy.context.view_layer.update()
        compare(watched.sync.exported, fresh(), mode)
    assert len(watched.sync.exported.scene.meshes) == 1


def test_what_is_hidden_goes_and_comes_back(watched):
    """Of which Blender says no more than that something of the scene has changed."""
    item = objects("MESH")[0]
    add(bpy.context.scene, "Other", mesh())
    watched.settle()
    for hidden, count in ((True, 1), (False, 2)):
        item.hide_set(hidden)
        watched.settle()
        compare(watched.sync.exported, fresh(), f"hidden: {hidden}")
        assert len(watched.sync.exported.scene.instances) == count


def drive(watched, seed: int, rounds: int) -> int:
    """Every kind of edit once a round, in any order, now and then three at a time. How many that were."""
    rng, number = random.Random(seed), 0
    for _ in range(rounds):
        left = rng.sample(EDITS, len(EDITS))
        while left:
            done = [left.pop() for _ in range(min(rng.choice((1, 1, 1, 3)), len(left)))]
            for edit in done:
                do(edit, rng)
            watched.settle()
            number += len(done)
            where = f"seed {seed}, edit {number}: {', '.join(edit.__name__ for edit in done)}"
            compare(watched.sync.exported, fresh(), where)
    return number


def compare(synced, wanted, where: str) -> None:
    for part in PARTS:
        found, right = getattr(synced.scene, part), getattr(wanted.scene, part)
        if not same(found, right):
            pairs = [p for p in zip(found, right, strict=False) if not same(*p)] if isinstance(right, list) else []
            first = "\n".join(map(str, pairs[0] if pairs else (found, right)))
            pytest.fail(f"{where}: {part} differ\n{first}")
    assert synced.settings == wanted.settings, where
    assert sorted(synced.warnings) == sorted(wanted.warnings), where


@pytest.mark.parametrize("seed", range(3))
def test_random_edits_leave_what_a_fresh_export_has(watched, seed):
    drive(watched, seed, 1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 120))
def test_thousands_of_random_edits(watched, seed):
    assert drive(watched, seed, 10) > 400
