"""Names of files and their appearing whole or not at all."""

import os
from pathlib import Path

import pytest

from gi_engine.output import OutputError, Target, check_suffix, numbered


@pytest.mark.parametrize(
    ("name", "frame", "always", "expected"),
    [
        ("a.png", 7, False, "a.png"),
        ("a.png", 7, True, "a0007.png"),
        ("a_###.png", 7, False, "a_007.png"),
        ("a_##.exr", 12345, True, "a_12345.exr"),
        ("a#b##.png", 3, True, "a#b03.png"),
        ("a.png", -3, True, "a-0003.png"),
    ],
)
def test_frame_numbers(name, frame, always, expected):
    assert numbered(Path("dir") / name, frame, always) == Path("dir") / expected


@pytest.mark.parametrize("name", ["a.jpg", "a", "a.blend", ".png"])
def test_other_suffixes_are_refused(name):
    with pytest.raises(OutputError, match=r"\.png or \.exr"):
        check_suffix(Path(name))


def test_nothing_is_there_until_it_is_published(tmp_path):
    path = tmp_path / "a.png"
    path.write_text("old")
    with Target(path) as target:
        (target.folder / "picture.png").write_text("new")
        assert path.read_text() == "old"
        assert target.publish(path, "picture") == [path]
    assert path.read_text() == "new"
    assert os.listdir(tmp_path) == ["a.png"]


def test_a_failed_render_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "a.png"
    path.write_text("old")
    with pytest.raises(RuntimeError, match="boom"), Target(path) as target:
        (target.folder / "picture.png").write_text("half")
        raise RuntimeError("boom")
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["a.png"]


def test_views_keep_their_suffixes(tmp_path):
    with Target(tmp_path / "a.png") as target:
        for side in ("_L", "_R"):
            (target.folder / f"picture{side}.png").write_text(side)
        target.publish(tmp_path / "a.png", "picture")
    assert sorted(os.listdir(tmp_path)) == ["a_L.png", "a_R.png"]
