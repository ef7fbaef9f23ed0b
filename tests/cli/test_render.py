"""`gi-engine render`: what the options do, where files go, how it ends."""

import os
import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import OpenEXR
import pytest

from gi_engine import cli, control


def passes_in(done) -> int:
    return int(re.search(r"(\d+) passes", done.out + done.err)[1])


def channels(path) -> dict:
    """Every channel of every part of an EXR, by name."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {name: channel.pixels for part in file.parts for name, channel in part.channels.items()}


def combined(path) -> np.ndarray:
    found = channels(path)
    return np.stack([next(v for k, v in found.items() if k.endswith(f"Combined.{c}")) for c in "RGB"], axis=-1)


def png_size(path) -> tuple[int, int]:
    head = path.read_bytes()[:24]
    assert head[:8] == b"\x89PNG\r\n\x1a\n"
    return int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")


def test_a_picture(gi, stage, tmp_path):
    out = tmp_path / "out.png"
    done = gi("render", stage.save(), "-o", out)
    assert (done.code, done.err) == (cli.DONE, "")
    assert png_size(out) == (24, 16)
    assert passes_in(done) == 4  # the scene's Cycles samples
    assert sorted(os.listdir(tmp_path)) == ["out.png", "scene.blend"]


def test_radiance_of_a_lit_floor(gi, stage, tmp_path):
    """A point lamp of P watts at height h over a white diffuse floor: rho P / (4 pi^2 h^2) at its foot."""
    out = tmp_path / "out.exr"
    stage.lamp.data.shadow_soft_size = 0.0
    stage.camera.data.angle = 0.01
    stage.material.use_nodes = True
    nodes, links = stage.material.node_tree.nodes, stage.material.node_tree.links
    nodes.clear()
    diffuse, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    diffuse.inputs["Color"].default_value = (0.5, 0.5, 0.5, 1)
    links.new(diffuse.outputs[0], output.inputs[0])
    assert gi("render", stage.save(), "-o", out).code == cli.DONE
    assert combined(out) == pytest.approx(0.5 * 100 / (4 * np.pi**2 * 2**2), rel=2e-3)


def test_limits_resolution_integrator_and_parameters(gi, stage, tmp_path):
    file, out = stage.save(), tmp_path / "out.png"
    assert passes_in(gi("render", file, "-o", out, "--samples", 7, "--resolution", "31x9")) == 7
    assert png_size(out) == (31, 9)
    start = time.monotonic()
    assert passes_in(gi("render", file, "-o", out, "--time", 0.5)) > 7
    assert time.monotonic() - start > 0.5
    assert gi("render", file, "-o", out, "--integrator", "whitted", "--set", "max_bounces=0").code == cli.DONE


def test_a_noise_target_is_met(gi, stage, tmp_path):
    stage.lamp.data.shadow_soft_size = 1.0
    file, out = stage.save(), tmp_path / "out.png"
    loose = passes_in(gi("render", file, "-o", out, "--noise", 0.2))
    tight = passes_in(gi("render", file, "-o", out, "--noise", 0.02))
    assert 1 < loose < tight


def test_seed_and_threads(gi, stage, tmp_path):
    stage.lamp.data.shadow_soft_size = 1.0
    file = stage.save()

    def render(*options):
        assert gi("render", file, "-o", tmp_path / "out.exr", *options).code == cli.DONE
        return combined(tmp_path / "out.exr")

    first = render("--seed", 1, "--threads", 1)
    assert np.array_equal(first, render("--seed", 1, "--threads", 2))
    assert not np.array_equal(first, render("--seed", 2, "--threads", 2))


def test_frames_are_numbered(gi, stage, tmp_path):
    stage.lamp.data.energy = 10.0
    stage.lamp.data.keyframe_insert("energy", frame=2)
    stage.lamp.data.energy = 1000.0
    stage.lamp.data.keyframe_insert("energy", frame=3)
    file = stage.save()
    assert gi("render", file, "-o", tmp_path / "a.exr", "--frame", "2-3").code == cli.DONE
    assert gi("render", file, "-o", tmp_path / "b_##.exr", "--frame", "3").code == cli.DONE
    assert sorted(os.listdir(tmp_path)) == ["a0002.exr", "a0003.exr", "b_03.exr", "scene.blend"]
    assert combined(tmp_path / "a0003.exr").mean() > 20 * combined(tmp_path / "a0002.exr").mean()
    assert np.array_equal(combined(tmp_path / "a0003.exr"), combined(tmp_path / "b_03.exr"))


def test_exr_has_every_pass(gi, stage, tmp_path):
    layer = stage.scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = True
    out = tmp_path / "out.exr"
    assert gi("render", stage.save(), "-o", out).code == cli.DONE
    found = channels(out)
    depth = next(v for k, v in found.items() if "Depth" in k)
    assert depth == pytest.approx(3.0, rel=1e-4)
    assert sum("Normal" in name for name in found) == 3


def test_png_has_the_view_transform(gi, stage, tmp_path):
    import bpy

    stage.lamp.data.energy = 30.0
    files = {}
    for exposure in (0, -3):
        stage.scene.view_settings.exposure = exposure
        files[exposure] = stage.save(f"{-exposure}.blend")
    means = []
    for file in files.values():
        assert gi("render", file, "-o", tmp_path / "out.png").code == cli.DONE
        image = bpy.data.images.load(str(tmp_path / "out.png"))
        image.colorspace_settings.name = "Non-Color"
        encoded = np.reshape(image.pixels[:], (-1, 4))[:, :3]
        means.append(np.mean(((encoded + 0.055) / 1.055) ** 2.4))  # sRGB's curve, above its foot
    assert means[1] == pytest.approx(means[0] / 8, rel=0.03)


def test_without_o_the_scene_names_the_file(gi, stage, tmp_path):
    stage.scene.render.filepath = str(tmp_path / "own_###")
    stage.scene.render.image_settings.file_format = "JPEG"
    assert gi("render", stage.save(), "--frame", 5).code == cli.DONE
    assert sorted(os.listdir(tmp_path)) == ["own_005.jpg", "scene.blend"]


@pytest.mark.parametrize("folder", ["with {braces}", "with #hash", "with ünïcode"])
def test_unusual_folders(gi, stage, tmp_path, folder):
    (tmp_path / folder).mkdir()
    out = tmp_path / folder / "out.png"
    assert gi("render", stage.save(), "-o", out).code == cli.DONE
    assert out.is_file()


def test_an_old_picture_is_replaced_only_by_a_whole_one(gi, stage, tmp_path):
    out = tmp_path / "out.png"
    out.write_bytes(b"old")
    good = stage.save("good.blend")
    stage.scene.camera = None
    assert gi("render", stage.save("bad.blend"), "-o", out).code == cli.FAILED
    assert out.read_bytes() == b"old"
    assert gi("render", good, "-o", out).code == cli.DONE
    assert png_size(out) == (24, 16)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_keeps_what_is_there(gi, stage, tmp_path, number):
    out, file = tmp_path / "out.png", stage.save()
    handler = signal.getsignal(number)
    pressed = []

    def press():
        while not (control.current and control.current.last.passes):
            time.sleep(0.01)
        pressed.append(time.monotonic())
        os.kill(os.getpid(), number)

    threading.Thread(target=press, daemon=True).start()
    done = gi("render", file, "-o", out, "--samples", 9999999)
    assert done.code == cli.CANCELLED
    assert time.monotonic() - pressed[0] < 5.0  # a loaded machine included
    assert passes_in(done) > 0
    assert "cancelled" in done.err
    assert png_size(out) == (24, 16)
    assert signal.getsignal(number) is handler
    assert not list(tmp_path.glob(".gi-engine-*"))


# A program that gets Ctrl-C as soon as it has a pass.
IMPATIENT = """
import os, signal, threading, time
from gi_engine import control

def wait():
    while not (control.current and control.current.last.passes):
        time.sleep(0.01)
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=wait, daemon=True).start()
"""


def program(*argv, prepare="") -> subprocess.CompletedProcess:
    code = f"{prepare}\nfrom gi_engine import cli; cli.main()"
    command = [sys.executable, "-c", code, *map(str, argv)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def test_the_program_ends_with_its_exit_codes(stage, tmp_path):
    file, out = stage.save(), tmp_path / "out.png"
    good = program("render", file, "-o", out)
    assert (good.returncode, good.stderr) == (cli.DONE, "")
    assert good.stdout.startswith(f"{out}: 4 passes in ")
    bad = program("render", file, "-o", tmp_path / "missing" / "out.png")
    assert (bad.returncode, "missing" in bad.stderr) == (cli.BAD_ARGUMENTS, True)
    stopped = program("render", file, "-o", out, "--samples", 9999999, prepare=IMPATIENT)
    assert stopped.returncode == cli.CANCELLED
    assert "cancelled; the picture has" in stopped.stderr


def test_ctrl_c_before_rendering(stage, tmp_path):
    file, out = stage.save(), tmp_path / "out.png"
    early = "from gi_engine import cli, control\nold = cli.open_scene\n"
    early += "def open_scene(a): control.current.cancelled = True; return old(a)\ncli.open_scene = open_scene"
    done = program("render", file, "-o", out, prepare=early)
    assert (done.returncode, done.stdout) == (cli.CANCELLED, "")
    assert "nothing is written" in done.stderr
    assert not out.exists()


def test_ctrl_c_where_the_program_has_a_handler_of_its_own(monkeypatch):
    """As Blender has: Python knows it as None, and refuses to put it back."""
    handlers = []
    real = signal.signal
    monkeypatch.setattr(cli.signal, "signal", lambda number, handler: handlers.append(real(number, handler)))
    before = signal.getsignal(signal.SIGINT)
    try:
        with cli.interruptible(control.Control()):
            pass
        assert handlers[0] is before and len(handlers) == 4
        assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL
    finally:
        real(signal.SIGINT, before)
