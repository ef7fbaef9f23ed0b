"""Small scenes of lights for the tests of light sampling, and the surfaces they are seen on."""

import numpy as np

from gi_engine import native
from gi_engine import scene_data as sd
from gi_engine.nodes.program import ProgramBuilder

ORIGIN = np.zeros((1, 3), np.float32)
UP = np.array([[0, 0, 1]], np.float32)
NO_NORMAL = ORIGIN


def f32(*rows):
    return np.ascontiguousarray(np.array(rows, np.float32))


def matrix(position=(0, 0, 0), x=(1, 0, 0), y=(0, 1, 0), z=(0, 0, 1)):
    m = np.eye(4, dtype=np.float32)
    m[:3, 0], m[:3, 1], m[:3, 2], m[:3, 3] = x, y, z, position
    return m


def lamp(kind, color=(1, 1, 1), **fields):
    fields.setdefault("matrix", matrix((0, 0, 2)))
    return sd.Light(name=kind.lower(), kind=kind, color=color, **fields)


def emission(color=(1, 1, 1), strength=1.0, name="emitter"):
    builder = ProgramBuilder()
    builder.op("emission", 1.0, color, strength)
    return builder.finish(name)


def mesh_of(triangles):
    """(n, 3, 3) corners as a mesh of loose triangles."""
    triangles = np.asarray(triangles, np.float32)
    n = len(triangles)
    # One float more than is used: the native side reads four at a time.
    buffer = np.zeros(n * 9 + 1, np.float32)
    buffer[:-1] = triangles.ravel()
    corners = np.arange(n * 3, dtype=np.int32)
    return sd.Mesh("mesh", buffer[:-1].reshape(-1, 3), corners, corners.reshape(-1, 3), None, None, "FACE", None)


def triangle_scene(triangles, program=None, world=None):
    programs = [program or emission()]
    scene = sd.Scene(
        meshes=[mesh_of(triangles)], instances=[sd.Instance("triangles", 0, matrix(), [0])], programs=programs
    )
    return with_world(scene, world)


def with_world(scene, program, **fields):
    if program is not None:
        scene.programs.append(program)
        scene.world = sd.World(program=len(scene.programs) - 1, **fields)
    return scene


def build(scene, threads=1):
    return native.module().TestLights(scene, native.embree_path(), threads)


def uniforms(n, seed=1):
    return np.random.default_rng(seed).random((n, 3), np.float32)


class Samples:
    """Columns of TestLights.sample, those that are lights alone."""

    def __init__(self, table):
        self.total = len(table)
        self.valid = table[:, 9] >= 0
        t = table[self.valid]
        self.wi, self.distance, self.radiance = np.ascontiguousarray(t[:, :3]), t[:, 3], t[:, 4:7]
        self.pdf, self.delta, self.light = t[:, 7], t[:, 8] > 0, t[:, 9].astype(int)

    def irradiance(self, normal):
        """Estimate and its standard error, first channel."""
        x = np.zeros(self.total)
        x[self.valid] = np.maximum(self.wi @ np.asarray(normal, np.float64).ravel(), 0) * self.radiance[:, 0] / self.pdf
        return x.mean(), x.std() / np.sqrt(self.total)


def image_sky(resolution=64, sun=2000.0, **fields):
    """A gradient with one bright pixel."""
    height, width = resolution // 2, resolution
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] *= np.linspace(0.0, 1.0, height, dtype=np.float32)[:, None, None]
    pixels[height * 3 // 4, width // 3, :3] = sun
    builder = ProgramBuilder()
    color, _ = builder.op("environment", builder.op("object_position"), imm=(0, 0, 0))
    builder.op("emission", 1.0, color, 1.0)
    scene = sd.Scene(images=[[sd.Image("sky", pixels)]])
    return with_world(scene, builder.finish("sky"), **fields)
