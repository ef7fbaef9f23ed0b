"""Scenes for the command line: made by bpy in this process, saved, and rendered by the commands."""

from dataclasses import dataclass

import pytest

from gi_engine import cli


@dataclass
class Done:
    code: int
    out: str
    err: str


@pytest.fixture
def gi(capfd):
    """Runs a command in this process: gi("render", path, "-o", out) → exit code and what was printed."""

    def command(*argv) -> Done:
        capfd.readouterr()
        code = cli.run([str(word) for word in argv])
        return Done(code, *capfd.readouterr())

    return command


@dataclass
class Stage:
    """A floor under a lamp and a camera, to be spoilt by a test and saved."""

    scene: object
    floor: object
    lamp: object
    camera: object
    material: object
    folder: object

    def save(self, name="scene.blend"):
        import bpy

        path = self.folder / name
        bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
        return path

    def add(self, name, data):
        import bpy

        thing = bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(thing)
        return thing


def plane(name, corners=((-5, -5, 0), (5, -5, 0), (5, 5, 0), (-5, 5, 0))):
    import bpy

    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], [tuple(range(len(corners)))] if corners else [])
    return mesh


@pytest.fixture
def stage(tmp_path):
    import bpy

    from gi_engine import headless

    headless.register_once()
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "GI_ENGINE"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 24, 16, 100
    scene.view_settings.view_transform = "Standard"
    scene.cycles.samples = 4
    made = Stage(scene, None, None, None, bpy.data.materials.new("grey"), tmp_path)
    made.floor = made.add("floor", plane("floor"))
    made.floor.data.materials.append(made.material)
    made.lamp = made.add("lamp", bpy.data.lights.new("lamp", "POINT"))
    made.lamp.location, made.lamp.data.energy = (0, 0, 2), 100
    made.camera = made.add("camera", bpy.data.cameras.new("camera"))
    made.camera.location = (0, 0, 3)
    scene.camera = made.camera
    return made
