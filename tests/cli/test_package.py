"""Making the extension's package: wheels with other tags, the platform each is for, and what the command refuses. Compiling and the
finished zip are CI's last step, in the real Blender."""

from __future__ import annotations

import csv
import hashlib
import io
import tomllib
import zipfile
from base64 import urlsafe_b64encode

import pytest

from gi_engine import cli
from gi_engine.arguments import parser
from gi_engine.package import assemble, build, wheels
from gi_engine.package.wheels import Name, WheelError

LIBRARY = b"\x7fELF GLIBC_2.2.5\0GLIBC_2.14\0GLIBC_2.28\0GLIBCXX_3.4.30\0"
SO = "gi_engine_native/_core.abi3.so"


@pytest.fixture
def stable(tmp_path):
    """A stable-ABI wheel as it leaves the compiler."""
    name = Name("gi_engine_native", "0.1.0", "cp312", "abi3", "linux_x86_64")
    return wheels.write(tmp_path / "made", name, {SO: LIBRARY, "gi_engine_native/__init__.py": b""})


def test_a_stable_wheel_names_every_python_exactly(stable, tmp_path):
    """An abi3 tag would not be taken beside exact ones, and the version has to change with the content."""
    made = wheels.tagged(stable, tmp_path, ["cp313", "cp314"])
    mark = hashlib.sha256(LIBRARY).hexdigest()[:8]
    assert made.name == f"gi_engine_native-0.1.0+{mark}-cp313.cp314-none-manylinux_2_28_x86_64.whl"
    files = wheels.read(made)
    info = f"gi_engine_native-0.1.0+{mark}.dist-info/"
    assert files[SO] == LIBRARY
    assert files[info + "WHEEL"].decode().splitlines()[3:] == [
        "Tag: cp313-none-manylinux_2_28_x86_64",
        "Tag: cp314-none-manylinux_2_28_x86_64",
    ]
    for name, digest, _ in csv.reader(io.StringIO(files[info + "RECORD"].decode())):
        if digest:
            wanted = urlsafe_b64encode(hashlib.sha256(files[name]).digest()).rstrip(b"=").decode()
            assert digest == f"sha256={wanted}"


def test_the_same_content_makes_the_same_wheel(stable, tmp_path):
    first, second = (wheels.tagged(stable, tmp_path / k, ["cp313"]) for k in "ab")
    assert first.read_bytes() == second.read_bytes()


def test_of_embreex_only_the_library_is_taken(tmp_path):
    name = Name("embreex", "4.4.0.post1", "cp313", "cp313", "manylinux_2_28_x86_64")
    library = "embreex.libs/libembree4-abc.so.4"
    files = {library: b"embree", "embreex/__init__.py": b"import rtcore", "embreex/rtcore.so": b"x"}
    made = wheels.libraries_only(wheels.write(tmp_path, name, files), tmp_path / "out")
    assert made.name == "embreex-4.4.0.post1-py3-none-manylinux_2_28_x86_64.whl"
    assert sorted(wheels.payload(wheels.read(made))) == [library, "embreex/__init__.py"]


@pytest.mark.parametrize(
    ("tag", "platform"),
    [
        ("linux_x86_64", "linux-x64"),
        ("manylinux_2_17_x86_64.manylinux2014_x86_64", "linux-x64"),
        ("win_amd64", "windows-x64"),
        ("macosx_11_0_arm64", "macos-arm64"),
    ],
)
def test_platforms_have_blenders_names(tag, platform):
    assert assemble.platform_of(tag) == platform


@pytest.mark.parametrize("tag", ["macosx_11_0_x86_64", "win_arm64", "any", "linux_aarch64"])
def test_other_platforms_are_named(tag):
    with pytest.raises(WheelError, match=tag):
        assemble.platform_of(tag)


def test_a_stable_wheel_serves_no_older_python(tmp_path):
    """What it calls is not there; Blender would install it and fail to render."""
    of = lambda python, abi: tmp_path / str(Name("gi_engine_native", "0.1.0", python, abi, "linux_x86_64"))  # noqa: E731
    stable, exact = of("cp312", "abi3"), of("cp311", "cp311")
    assert assemble.sorted_pythons(stable, [stable]) == ["cp313", "cp314"]
    assert assemble.sorted_pythons(stable, [stable, exact]) == ["cp313", "cp314"]
    assert assemble.not_served([of("cp313.cp314", "none")]) == {"linux-x64": ["cp311"]}
    assert assemble.not_served([of("cp313.cp314", "none"), exact]) == {}


def test_zig_finds_the_headers_of_debians_pythons(tmp_path):
    """/usr/include/python3.11/pyconfig.h includes <x86_64-linux-gnu/python3.11/pyconfig.h>: whether a build failed hung on which Python was found."""
    system = tmp_path / "x86_64-linux-gnu"
    (system / "python3.11").mkdir(parents=True)
    (system / "python3.11" / "pyconfig.h").touch()
    (system / "features.h").touch()  # of the C library: not to be found
    for _ in range(2):
        flag, folder = build.debian_headers(tmp_path / "made", system)
    assert flag == "-idirafter"
    found = [str(path.relative_to(folder)) for path in (tmp_path / "made").rglob("*")]
    assert sorted(found) == ["x86_64-linux-gnu", "x86_64-linux-gnu/python3.11"]
    assert (tmp_path / "made/x86_64-linux-gnu/python3.11/pyconfig.h").is_file()
    assert build.debian_headers(tmp_path / "none", tmp_path / "elsewhere") == []


def test_wrong_wheels_are_named(tmp_path):
    with pytest.raises(WheelError, match="nonsense"):
        Name.of(tmp_path / "nonsense.whl")
    name = Name("gi_engine_native", "0.1.0", "cp310", "cp310", "linux_x86_64")
    old = wheels.write(tmp_path, name, {"gi_engine_native/_core.so": LIBRARY})
    with pytest.raises(WheelError, match="cp310"):
        wheels.tagged(old, tmp_path / "out", assemble.PYTHONS)


def test_the_manifest_names_the_wheels_and_is_valid(stable, tmp_path):
    source = tmp_path / "source"
    wheels.tagged(stable, source / "wheels", ["cp313"])
    assemble.write_manifest(source, ["linux-x64"])
    manifest = tomllib.loads((source / "blender_manifest.toml").read_text())
    (path,) = (source / "wheels").iterdir()
    assert manifest["wheels"] == [f"./wheels/{path.name}"] and manifest["platforms"] == ["linux-x64"]
    assert list(manifest["permissions"]) == ["files"]  # and no network
    (source / "__init__.py").write_text('"""Nothing."""\n')
    (made,) = assemble.pack(source, tmp_path / "dist", ["linux-x64"])
    with zipfile.ZipFile(made) as archive:
        assert f"wheels/{path.name}" in archive.namelist()


def test_what_fetches_is_not_in_the_package():
    assert "package" in assemble.NOT_SHIPPED
    parser(cli.COMMANDS, in_blender=False).parse_args(["package"])
    with pytest.raises(SystemExit):  # nor offered inside Blender
        parser(cli.COMMANDS, in_blender=True).parse_args(["package"])


def test_a_wheel_that_is_none_fails_with_its_name(gi, tmp_path):
    done = gi("package", "--wheel", tmp_path / "x.whl", "-o", tmp_path)
    assert done.code == cli.FAILED and "x.whl" in done.err
