"""The page of a comparison in a browser without a window: what moves, moves, and what is shown, loads."""

import numpy as np
import pytest

from gi_engine.compare import pictures, report
from gi_engine.compare.plan import Plan
from gi_engine.compare.reference import Reference
from gi_engine.compare.runner import Comparison, Rendered, judge_one

SIZE = (48, 64)


@pytest.fixture(scope="module")
def comparison(tmp_path_factory):
    """Two engines, one of them biased, and one that failed."""
    folder = tmp_path_factory.mktemp("report")
    (folder / "images").mkdir()
    plan = Plan(folder / "room.blend", ["path", "cycles", "vcm"], folder, seconds=4.0)
    truth = np.broadcast_to(np.linspace(0.1, 0.9, SIZE[1])[None, :, None], (*SIZE, 3)).astype(np.float32)
    made = Comparison(plan, {"scene": "</script><b>Room", "frame": 1, "size": [64, 48], "blender": "5.2"})
    made.reference = Reference("Cycles", truth, 0.0, {}, {"samples": 4096, "seconds": 40.0})
    made.unsupported = ['"Hair" is left out']
    random = np.random.default_rng(1)
    for name, gain in (("path", 1.0), ("cycles", 1.3)):
        a, b = ((gain * truth * random.normal(1, 0.1, truth.shape)).astype(np.float32) for _ in range(2))
        steps = [
            {"sampling": s, "samples": int(16 * s), "rays": 1e6 * s if name == "path" else None, "relative_mse": 0.1 / s,
             "memory": 50.0, "export": 0.2, "note": "", "not_finite": 0, "file": f"{name}.exr"}
            for s in (0.25, 1.0, 4.0)
        ]  # fmt: skip
        rendered = Rendered(name, name.title(), startup=1.5, load=0.3, steps=steps, pixels=a, again=b)
        judge_one(rendered, made.reference, folder)
        made.engines.append(rendered)
        (folder / "images" / f"{name}.png").write_bytes(pictures.png(a))
    made.engines.append(Rendered("vcm", "Vertex Connection", error="crashed (SIGSEGV)"))
    (folder / "images/reference.png").write_bytes(pictures.png(truth))
    return made, report.write(made)


def test_figures_are_in_every_file(comparison):
    made, page = comparison
    facts = page.with_suffix(".json").read_text()
    assert "crashed (SIGSEGV)" in facts and "NaN" not in facts
    lines = page.with_suffix(".csv").read_text().splitlines()
    assert len(lines) == 4 and lines[0].startswith("engine,seconds [s],samples,relative_mse")
    assert "</script><b>" not in page.read_text()
    path, cycles, _ = made.engines
    assert path.figures["blocks_beyond_noise"] == 0 and cycles.figures["blocks_beyond_noise"] > 40


@pytest.fixture
def page(open_page, comparison):
    return open_page(comparison[1])


def test_pictures_load_and_the_bar_moves(page):
    sizes = page.evaluate("[...document.images].map(i => [i.complete, i.naturalWidth, i.naturalHeight])")
    assert len(sizes) >= 2 + 2 * 2 and all(size == [True, 64, 48] for size in sizes)
    bar, stage = page.locator("#bar"), page.locator("#stage").bounding_box()
    assert bar.get_attribute("aria-valuenow") == "50"
    page.mouse.move(stage["x"] + stage["width"] / 2, stage["y"] + 40)
    page.mouse.down()
    page.mouse.move(stage["x"] + stage["width"] / 4, stage["y"] + 40, steps=4)
    page.mouse.up()
    assert bar.get_attribute("aria-valuenow") == "25"
    clip = page.evaluate("document.querySelector('#imageA').parentElement.style.clipPath")
    assert clip.startswith("inset(0") and "75" in clip


def test_the_keyboard_does_it_all(page):
    visible = "getComputedStyle(document.querySelector('#imageA')).visibility"
    page.focus("#bar")
    page.keyboard.press("ArrowRight")
    assert page.locator("#bar").get_attribute("aria-valuenow") == "52"
    page.keyboard.press("b")
    assert page.evaluate(visible) == "hidden"
    page.keyboard.press("f")
    assert page.evaluate(visible) == "visible"
    page.keyboard.press("w")
    before = page.evaluate("document.querySelector('#imageA').style.transform")
    page.keyboard.press("+")
    transforms = page.evaluate("[...document.images].map(i => i.style.transform)")
    assert transforms[0] != before and transforms[0] == transforms[1]
    page.keyboard.press("0")
    assert page.evaluate("document.querySelector('#imageA').style.transform") == before


def test_any_two_can_be_chosen(page):
    page.select_option("#pickB", "cycles")
    assert page.evaluate("document.querySelector('#imageB').alt") == "Cycles"
    assert page.evaluate("document.querySelector('#imageB').src === DATA.images.cycles.picture")


def test_it_says_what_failed_and_what_differs(page):
    text = page.inner_text("main")
    for words in ("crashed (SIGSEGV)", '"Hair" is left out', "agree within noise", "differ by more than noise", "Room"):
        assert words in text
    light = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (light == "rgb(245, 245, 242)") == (page.scheme == "light")
    page.click("text=Theme")
    assert page.evaluate("getComputedStyle(document.body).backgroundColor") != light
