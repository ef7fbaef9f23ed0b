"""What the table of many comparisons says of each, and its page in a browser."""

import csv

import numpy as np
import pytest

from gi_engine.compare import parity, pictures, summary
from gi_engine.compare.plan import PlanError

GOOD = {
    "mean_ratio": 1.001, "mean_ratio_error": 0.001, "blocks": 100, "blocks_beyond_noise": 0, "worst_block": 2.5,
    "largest_beyond_noise": 0.0, "not_finite": 0, "flip": 0.01,
}  # fmt: skip


@pytest.mark.parametrize(
    ("change", "kind", "says"),
    [
        ({}, summary.AGREES, "agrees"),
        ({"unsupported": ["node 'Hair' is diffuse"]}, summary.AGREES, "agrees"),
        ({"blocks_beyond_noise": 3, "largest_beyond_noise": -0.2}, summary.DIFFERS, "3 of 100 blocks differ, by -20.0 %"),
        ({"blocks_beyond_noise": 3, "unsupported": ["x"]}, summary.UNSUPPORTED, "3 of 100"),
        ({"mean_ratio": 1.02}, summary.DIFFERS, "no block differs, but the mean does by +2.0 %, 20 standard errors"),
        ({"mean_ratio": 1.02, "mean_ratio_error": 0.01}, summary.AGREES, "agrees"),
        ({"not_finite": 2}, summary.DIFFERS, "2 values are not finite"),
        ({"mean_ratio": None}, summary.BLACK, "nothing is compared"),
        ({"mean_ratio": None, "blocks_beyond_noise": 1}, summary.DIFFERS, "1 of 100 blocks differ"),
        ({"error": "crashed (SIGSEGV)"}, summary.FAILED, "crashed"),
    ],
)  # fmt: skip
def test_verdicts(change, kind, says):
    found, words = summary.verdict(GOOD | change)
    assert found == kind and says in words


@pytest.fixture
def rows(tmp_path):
    folder = tmp_path / "scenes" / "room"
    (folder / "images").mkdir(parents=True)
    (folder / "report.html").write_text("<!doctype html><title>Room</title>")
    for name in ("path", "reference"):
        (folder / "images" / f"{name}.png").write_bytes(pictures.png(np.full((6, 8, 3), 0.5)))
    said = [f"material '{c}': node 'x' (Hair): hair is diffuse" for c in "abc"] + ["an image is missing"]
    return [
        GOOD | {"name": "a|b", "folder": "scenes/room", "engine": "path", "unsupported": said},
        {"name": "</table><b>gone", "folder": "scenes/gone", "engine": "path", "error": "not done after 5 s"},
        GOOD | {"name": "off", "folder": "scenes/off", "mean_ratio": 1.5, "note": "why it is so"},
    ]


def test_the_table_has_every_scene(rows):
    text = summary.markdown(rows, ["Words."])
    assert "Of 3 scenes, 1 agree within noise, 1 differ, 1 failed." in text
    assert (
        "| a\\|b | 1.0010 ± 0.0010 | 2.5 | 0.010 | agrees. Said: material 'a': node 'x' (Hair): hair is diffuse (3 times); an"
        in text
    )
    assert "| </table><b>gone | – | – | – | **not done after 5 s** |" in text
    assert "standard errors**: why it is so |" in text
    found = list(csv.DictReader(summary.table(rows).splitlines()))
    assert [row["verdict"] for row in found] == ["agrees", "failed", "differs"]
    assert found[1]["error"] == "not done after 5 s" and found[0]["unsupported"].count(" / ") == 3


def test_the_page_shows_every_scene(rows, open_page, tmp_path):
    path = tmp_path / "parity.html"
    path.write_text(summary.page(rows, ["Words."], tmp_path), encoding="utf-8")
    page = open_page(path)
    assert page.evaluate("[...document.images].map(i => [i.naturalWidth, i.alt])") == [
        [8, "a|b, ours"],
        [8, "a|b, Cycles’"],
    ]
    assert page.locator("tbody tr").count() == 3
    assert page.locator("tbody th").all_inner_texts() == ["a|b", "</table><b>gone", "off"]
    light = page.evaluate("getComputedStyle(document.body).backgroundColor")
    assert (light == "rgb(245, 245, 242)") == (page.scheme == "light")
    page.click("text=4 warnings")
    assert page.locator("li").count() == 4 and page.locator("li").first.is_visible()
    page.click("text=a|b")
    assert page.title() == "Room"


def test_scenes_are_named_by_where_they_lie(tmp_path):
    for name in ("one/a.blend", "one/deep/b.blend", "two/a.blend"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    found = parity.find_scenes([tmp_path / "one", tmp_path / "two", tmp_path / "one" / "a.blend"])
    assert list(found) == ["a", "deep/b", "two/a"]
    (tmp_path / "three").mkdir()
    with pytest.raises(PlanError, match="no .blend file in"):
        parity.find_scenes([tmp_path / "three"])
    with pytest.raises(PlanError, match="is not there"):
        parity.find_scenes([tmp_path / "four"])
