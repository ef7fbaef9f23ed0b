"""Seconds that light sampling takes: building, one sample, one density, for few and many lights.

uv run python bench/lights.py
"""

import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests/physics"))
from light_scenes import build, emission, lamp, matrix, triangle_scene, with_world

from gi_engine import scene_data as sd

COUNT = 50_000


def lamps(n, kind="POINT", **fields):
    rng = np.random.default_rng(1)
    return sd.Scene(lights=[lamp(kind, matrix=matrix(p), **fields) for p in rng.uniform(-5, 5, (n, 3))])


def triangles(n):
    rng = np.random.default_rng(2)
    return triangle_scene(rng.uniform(-5, 5, (n, 1, 3)) + rng.normal(0, 0.02, (n, 3, 3)))


SCENES = {
    "1 point": lambda: lamps(1),
    "1 sphere": lambda: lamps(1, radius=0.2, soft_falloff=False),
    "1 rectangle": lambda: lamps(1, "AREA"),
    "1 disk": lambda: lamps(1, "AREA", shape="ELLIPSE"),
    "1 sun": lambda: lamps(1, "SUN", angle=0.01),
    "uniform world": lambda: with_world(sd.Scene(), emission()),
    "2 triangles": lambda: triangles(2),
    "16 points": lambda: lamps(16),
    "16 rectangles": lambda: lamps(16, "AREA"),
    "1e3 triangles": lambda: triangles(1_000),
    "1e5 triangles": lambda: triangles(100_000),
    "1e6 triangles": lambda: triangles(1_000_000),
}

if __name__ == "__main__":
    rng = np.random.default_rng(3)
    position = rng.uniform(-5, 5, (4096, 3)).astype(np.float32)
    normal = rng.normal(size=(4096, 3))
    normal = (normal / np.linalg.norm(normal, axis=1, keepdims=True)).astype(np.float32)
    print(f"{'lights':16} {'build s':>8} {'ns/sample':>10} {'ns/choice density':>18}")
    for name, make in SCENES.items():
        lights = build(make(), threads=0)
        sample, density, _ = min(lights.time(position, normal, COUNT) for _ in range(7))
        print(f"{name:16} {lights.build_seconds:8.3f} {sample / COUNT * 1e9:10.0f} {density / COUNT * 1e9:18.0f}")
