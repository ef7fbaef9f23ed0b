"""The extension's zip: manifest, add-on, wheels and licences, checked and packed by Blender's own tool."""

from __future__ import annotations

import importlib.util
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

from . import wheels
from .build import compile_native, fetch
from .wheels import Name, WheelError

ROOT = Path(__file__).resolve().parents[2]
# 3.11: Blender 4.5 and 5.0; 3.13: 5.1 and 5.2; 3.14: Debian's 5.2.
PYTHONS = ["cp311", "cp313", "cp314"]
COMPILED = ["3.11", "3.13"]  # the second is of the stable ABI, which serves what comes after it, too
# Blender's name of a platform: what wheels are asked for.
PLATFORMS = {
    "linux-x64": ["manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64"],
    "windows-x64": ["win_amd64"],
    "macos-arm64": ["macosx_13_0_arm64", "macosx_12_0_arm64", "macosx_11_0_arm64"],
}
NOT_SHIPPED = ("__pycache__", "package")


def package(out: Path, given: list[Path], compiler: str, say) -> list[Path]:
    """Writes one zip for each platform into the folder `out`. `given`: wheels of the compiled part that were made elsewhere; without,
    it is compiled here. Raises WheelError."""
    if not (ROOT / "native" / "pyproject.toml").is_file():
        raise WheelError("packages are made from a checkout of GI Engine, which this is not")
    work = ROOT / "build" / "package"
    if not given:
        say(f"compiling for Python {' and '.join(COMPILED)} ({compiler})")
        given = [compile_native(ROOT / "native", work, python, compiler) for python in COMPILED]
    source = work / "source"
    shutil.rmtree(source, ignore_errors=True)
    shutil.copytree(ROOT / "gi_engine", source, ignore=shutil.ignore_patterns(*NOT_SHIPPED))
    compiled = [wheels.tagged(path, source / "wheels", sorted_pythons(path, given)) for path in given]
    platforms = sorted({platform_of(Name.of(path).platform) for path in compiled})
    for platform, missing in not_served(compiled).items():
        say(
            f"{platform}: warning: nothing here is for Python {', '.join(missing)}; Blender refuses to render with it there"
        )
    for platform in platforms:
        say(f"{platform}: gathering the wheels of others")
        gather(source, work / "fetched", platform)
    write_licences(source, work / "fetched")
    write_manifest(source, platforms)
    return pack(source, out, platforms)


def sorted_pythons(path: Path, given: list[Path]) -> list[str]:
    """The Pythons that a wheel is to serve: a stable one those for which there is no exact one of its platform."""
    own = Name.of(path)
    exact = {
        n.python
        for n in map(Name.of, given)
        if n.abi != "abi3" and platform_of(n.platform) == platform_of(own.platform)
    }
    if own.abi != "abi3":
        return PYTHONS
    return [python for python in PYTHONS if python not in exact and minor(python) >= minor(own.python)]


def minor(python: str) -> int:
    """cp311 to 11."""
    return int(python[3:])


def not_served(compiled: list[Path]) -> dict[str, list[str]]:
    """Pythons of Blender's for which a platform has nothing compiled."""
    served: dict[str, set[str]] = {}
    for name in map(Name.of, compiled):
        served.setdefault(platform_of(name.platform), set()).update(name.python.split("."))
    missing = {platform: [python for python in PYTHONS if python not in has] for platform, has in served.items()}
    return {platform: pythons for platform, pythons in missing.items() if pythons}


def platform_of(tag: str) -> str:
    """Blender's name of a wheel's platform."""
    kinds = {"linux": "linux-x64", "manylinux": "linux-x64", "win": "windows-x64", "macosx": "macos-arm64"}
    found = re.match(r"(manylinux|linux|win|macosx)\w*?_(x86_64|amd64|arm64)$", tag.split(".")[0])
    if not found or (found[1] == "macosx") != (found[2] == "arm64"):
        raise WheelError(f'"{tag}" is no platform that packages are made for: {", ".join(PLATFORMS)}')
    return kinds[found[1]]


def gather(source: Path, fetched: Path, platform: str) -> None:
    """Embree's library for any Python, and OpenEXR for each."""
    wheels.libraries_only(fetch(pinned("embreex"), fetched, "cp313", PLATFORMS[platform]), source / "wheels")
    for python in PYTHONS:
        shutil.copy(fetch(pinned("openexr"), fetched, python, PLATFORMS[platform]), source / "wheels")


def pinned(name: str) -> str:
    """The requirement as pyproject.toml has it, so that what passed the tests is what is bundled."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    every = project["dependencies"] + [line for extra in project["optional-dependencies"].values() for line in extra]
    return next(line for line in every if line.startswith(f"{name}=="))


def write_licences(source: Path, fetched: Path) -> None:
    shutil.copy(ROOT / "LICENSE", source)
    shutil.copytree(ROOT / "licenses", source / "licenses")
    for path in fetched.rglob("*.whl"):
        for file, text in wheels.read(path).items():
            if ".dist-info/licenses/" in file:
                (source / "licenses" / f"{Name.of(path).package}.txt").write_bytes(text)


def write_manifest(source: Path, platforms: list[str]) -> None:
    names = sorted(path.name for path in (source / "wheels").glob("*.whl"))
    listed = "".join(f'  "./wheels/{name}",\n' for name in names)
    text = (ROOT / "blender_manifest.toml").read_text()
    quoted = ", ".join(f'"{platform}"' for platform in platforms)
    (source / "blender_manifest.toml").write_text(f"{text}platforms = [{quoted}]\nwheels = [\n{listed}]\n")


def pack(source: Path, out: Path, platforms: list[str]) -> list[Path]:
    tool = blender_tool()
    out.mkdir(parents=True, exist_ok=True)
    blender(tool, "build", "--split-platforms", "--source-dir", source, "--output-dir", out)
    version = tomllib.loads((source / "blender_manifest.toml").read_text())["version"]
    made = [out / f"gi_engine-{version}-{platform.replace('-', '_')}.zip" for platform in platforms]
    for path in made:
        said = blender(tool, "validate", path)
        if "WARNING" in said.upper():
            raise WheelError(f"{path.name}: {said}")
    return made


def blender(tool: Path, *words) -> str:
    done = subprocess.run([sys.executable, tool, *words], capture_output=True, text=True)
    if done.returncode:
        raise WheelError(f"Blender's tool refuses the package: {done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def blender_tool() -> Path:
    """The script behind `blender --command extension`, out of the bpy module, which need not be loaded for it."""
    spec = importlib.util.find_spec("bpy")
    folder = Path(spec.origin).parent if spec and spec.origin else Path()
    found = sorted(folder.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"))
    if not found:
        raise WheelError("Blender's Python module, which checks packages, is not installed")
    return found[-1]
