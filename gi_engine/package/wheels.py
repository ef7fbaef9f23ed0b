"""Wheels as files: the tags that Blender chooses by, and wheels written anew with other tags. Nothing is compiled or fetched."""

from __future__ import annotations

import base64
import hashlib
import re
import zipfile
from dataclasses import dataclass
from pathlib import Path

GLIBC = re.compile(rb"\bGLIBC_2\.(\d+)(?:\.\d+)?\0")
STAMP = (1980, 1, 1, 0, 0, 0)  # the same content makes the same file


class WheelError(RuntimeError):
    """A wheel cannot be used; the message is for the user."""


@dataclass
class Name:
    """The five parts of a wheel's file name."""

    package: str
    version: str
    python: str
    abi: str
    platform: str

    @classmethod
    def of(cls, path: Path) -> Name:
        parts = path.stem.split("-")
        if path.suffix != ".whl" or len(parts) not in (5, 6):
            raise WheelError(f'"{path}" is not named as a wheel')
        return cls(parts[0], parts[1], *parts[-3:])

    def __str__(self) -> str:
        return f"{self.package}-{self.version}-{self.python}-{self.abi}-{self.platform}.whl"


def read(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist() if not name.endswith("/")}


def payload(files: dict[str, bytes]) -> dict[str, bytes]:
    """What is installed, without what is said about it."""
    return {name: data for name, data in files.items() if ".dist-info/" not in name}


def write(folder: Path, name: Name, files: dict[str, bytes]) -> Path:
    """A wheel of these files, with metadata of its own."""
    info = f"{name.package}-{name.version}.dist-info/"
    tags = [
        f"Tag: {python}-{name.abi}-{platform}"
        for python in name.python.split(".")
        for platform in name.platform.split(".")
    ]
    files = dict(files)
    files[info + "METADATA"] = f"Metadata-Version: 2.1\nName: {name.package}\nVersion: {name.version}\n".encode()
    files[info + "WHEEL"] = "\n".join(
        ["Wheel-Version: 1.0", "Generator: gi-engine", "Root-Is-Purelib: false", *tags, ""]
    ).encode()
    record = [f"{path},{digest(data)},{len(data)}" for path, data in files.items()]
    files[info + "RECORD"] = "\n".join([*record, f"{info}RECORD,,", ""]).encode()
    folder.mkdir(parents=True, exist_ok=True)
    with zipfile.ZipFile(folder / str(name), "w", zipfile.ZIP_DEFLATED) as archive:
        for path, data in files.items():
            archive.writestr(zipfile.ZipInfo(path, STAMP), data, zipfile.ZIP_DEFLATED)
    return folder / str(name)


def digest(data: bytes) -> str:
    return "sha256=" + base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()


def manylinux(libraries: list[bytes]) -> str:
    """The lowest tag that these ELF files allow, by the youngest symbol of glibc that they want."""
    wanted = [int(minor) for data in libraries for minor in GLIBC.findall(data)]
    if not wanted:
        raise WheelError("the compiled part wants no glibc: it is no Linux library")
    return f"manylinux_2_{max(17, *wanted)}_x86_64"


def tagged(path: Path, folder: Path, pythons: list[str]) -> Path:
    """The compiled part's wheel for exactly these Pythons.

    A stable-ABI wheel loads in every later Python, but an exact tag anywhere in a manifest keeps Blender from taking abi3 wheels,
    so it has to name them. Its version holds what is in it, for Blender never unpacks the same version twice.
    """
    name, files = Name.of(path), payload(read(path))
    libraries = [data for file, data in files.items() if file.endswith((".so", ".pyd"))]
    if not libraries:
        raise WheelError(f'"{path}" holds no compiled part')
    if name.abi == "abi3":
        name.python, name.abi = ".".join(pythons), "none"
    elif name.python not in pythons:
        raise WheelError(f'"{path}" is for {name.python}; Blender has {", ".join(pythons)}')
    if name.platform.startswith(("linux", "manylinux")):
        name.platform = manylinux(libraries)
    mark = hashlib.sha256(b"".join(libraries)).hexdigest()[:8]
    name.version = f"{name.version.partition('+')[0]}+{mark}"
    return write(folder, name, files)


def libraries_only(path: Path, folder: Path) -> Path:
    """embreex without its extension modules: Embree's library and a package by which it is found, for any Python."""
    name, files = Name.of(path), payload(read(path))
    kept = {
        file: data
        for file, data in files.items()
        if file.startswith(("embreex.libs/", "embreex/.dylibs/")) or file == "embreex/__init__.py"
    }
    if len(kept) < 2:
        raise WheelError(f'"{path}" holds no Embree library')
    kept["embreex/__init__.py"] = (
        b'"""Only the folder beside which Embree lies; the modules of embreex are left out."""\n'
    )
    name.python, name.abi = "py3", "none"
    return write(folder, name, kept)
