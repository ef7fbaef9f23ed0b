"""The compiled part as wheels, and the wheels of others, by uv and pip. On Linux zig compiles, whose old glibc lets the result run
everywhere; leaves out compiling for other systems (docs/packaging.md)."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

from .wheels import WheelError

ZIG = "ziglang==0.17.1"
GLIBC = "2.28"  # Blender's own floor
# zig spells the levels of x86-64 its own way.
WRAPPER = """#!/bin/bash
words=()
for word in "$@"; do words+=("${{word/#-march=x86-64-v/-march=x86_64_v}}"); done
exec "{zig}" {language} -target x86_64-linux-gnu.{glibc} "${{words[@]}}"
"""


def run(*command, **options) -> None:
    words = [str(word) for word in command]
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **options)
    if done.returncode:
        raise WheelError(f"{' '.join(words)} failed:\n{done.stdout[-4000:]}")


def uv() -> list[str]:
    """`uv run` says where it is itself."""
    found = os.environ.get("UV") or shutil.which("uv")
    if not found:
        raise WheelError("uv is not there; run this as `uv run gi-engine package`")
    return [found]


def zig(folder: Path) -> dict[str, str]:
    """The environment in which zig is the compiler. It is installed into the folder."""
    program = folder / "zig" / "ziglang" / "zig"
    if not program.is_file():
        run(*uv(), "pip", "install", "--quiet", "--target", folder / "zig", ZIG)
    wrappers = {"CC": ("zig-cc", "cc"), "CXX": ("zig-c++", "c++")}
    for file, language in wrappers.values():
        text = WRAPPER.format(zig=program, language=language, glibc=GLIBC)
        wrapper = folder / file
        if not wrapper.is_file() or wrapper.read_text() != text:
            wrapper.write_text(text)
            wrapper.chmod(0o755)
    # nanobind wants <cstdio>, which libc++ does not bring along.
    flags = " ".join(["-include cstdio", *debian_headers(folder / "headers")])
    return {variable: str(folder / file) for variable, (file, _) in wrappers.items()} | {"CXXFLAGS": flags}


def debian_headers(folder: Path, system: Path = Path("/usr/include/x86_64-linux-gnu")) -> list[str]:
    """Flags by which zig finds the headers of Debian's own Pythons: they include a part of them from where only Debian's compilers look.
    Not all that is there, which is of another libc. Without such Pythons, none."""
    pythons = sorted(system.glob("python3.*"))
    for python in pythons:
        link = folder / system.name / python.name
        link.parent.mkdir(parents=True, exist_ok=True)
        link.unlink(missing_ok=True)
        link.symlink_to(python)
    return ["-idirafter", str(folder)] if pythons else []


def compile_native(source: Path, folder: Path, python: str, compiler: str) -> Path:
    """One wheel of the compiled part. `compiler`: "zig" or "system"."""
    folder.mkdir(parents=True, exist_ok=True)
    environment = dict(os.environ)
    if compiler == "zig":
        environment |= zig(folder)
    if shutil.which("ccache"):
        environment |= {
            "CMAKE_CXX_COMPILER_LAUNCHER": "ccache",
            "CCACHE_COMPILERCHECK": "content",
            "CCACHE_NOHASHDIR": "1",
        }
        environment |= {"CCACHE_COMPILERTYPE": "clang"} if compiler == "zig" else {}
    wheels = folder / "wheels" / python
    shutil.rmtree(wheels, ignore_errors=True)
    tree = folder / f"{compiler}-{python}"
    shutil.rmtree(tree, ignore_errors=True)  # another compiler's or another source's
    run(
        *uv(),
        "build",
        "--wheel",
        "--python",
        python,
        "--out-dir",
        wheels,
        "-C",
        f"build-dir={tree}",
        source,
        env=environment,
    )
    (made,) = wheels.glob("*.whl")
    return made


def fetch(requirement: str, folder: Path, python: str, platforms: list[str]) -> Path:
    """A wheel of a package for a Python ("cp313") and one of the platforms, by pip, from wherever pip is set to look."""
    folder = folder / f"{requirement}-{python}-{platforms[0]}"
    if not list(folder.glob("*.whl")):
        version = f"{python[2]}.{python[3:]}"
        wishes = [word for platform in platforms for word in ("--platform", platform)]
        pip = [*uv(), "tool", "run", "pip", "download", "--quiet", "--no-deps", "--only-binary", ":all:"]
        run(*pip, "--python-version", version, *wishes, "--dest", folder, requirement)
    (found,) = folder.glob("*.whl")
    return found
