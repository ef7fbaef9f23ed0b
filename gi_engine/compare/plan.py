"""What is to be compared: the engines, how long each renders, against what. No bpy, nothing is rendered here."""

from __future__ import annotations

import hashlib
from dataclasses import asdict, dataclass
from pathlib import Path

from .. import native

CYCLES = "cycles"
DEFAULT_SECONDS = 10.0
# The last picture of each engine is rendered twice, by two seeds: what the two have in common is no noise.
STEP = 4  # times as long as the one before
FIRST_SECONDS = 1.0  # of a run until an error is reached


class PlanError(ValueError):
    """The comparison cannot begin; the message names why."""


@dataclass
class Plan:
    file: Path
    engines: list[str]  # "cycles" or an integrator's id
    output: Path
    reference: str | Path = CYCLES  # an engine, or an EXR file
    seconds: float = 0.0  # one of these three is above 0
    samples: int = 0
    until: float = 0.0  # relative mean squared error
    reference_seconds: float = 0.0  # 0: as many times an engine's as REFERENCE_TIMES
    reference_samples: int = 0
    reference_pieces: int = 8  # by different seeds
    steps: int = 3  # renders of each engine before the one by another seed, each STEP times as long as the one before
    frame: int | None = None
    resolution: tuple[int, int] | None = None
    longest: int = 0  # pixels along the longer side; 0: the scene's
    region: tuple[float, float, float, float] | None = None  # left, bottom, right, top: shares of the picture
    threads: int = 0  # 0: the scene's
    limit: float = 600.0  # seconds that one render may take beyond what was asked for
    cache: Path | None = None
    neutral: bool = False  # takes away filters and cut-offs that bias, so that blocks can be tested

    def view(self) -> dict:
        """What the picture depends on beside the file and the engine."""
        return {
            "frame": self.frame,
            "resolution": self.resolution,
            "longest": self.longest,
            "region": self.region,
            "neutral": self.neutral,
            "threads": self.threads,
        }


def to_json(plan: Plan) -> dict:
    """Paths are absolute, so that who reads it may be elsewhere."""
    return {name: str(value.absolute()) if isinstance(value, Path) else value for name, value in asdict(plan).items()}


def from_json(fields: dict) -> Plan:
    tuples = {name: tuple(value) for name, value in fields.items() if name in ("resolution", "region") and value}
    paths = {name: Path(value) for name, value in fields.items() if name in ("file", "output", "cache") and value}
    if is_picture(fields["reference"]):
        paths["reference"] = Path(fields["reference"])
    return Plan(**fields | tuples | paths)


def is_picture(reference: str) -> bool:
    return reference.lower().endswith(".exr")


def engine_label(engine: str) -> str:
    if engine == CYCLES:
        return "Cycles"
    return next((d["label"] for d in native.integrators() if d["id"] == engine), engine)


def find_engine(word: str) -> str:
    """The engine that `word` names, whole or by its beginning. Raises PlanError with what there is."""
    names = [CYCLES, *(d["id"] for d in native.integrators())]
    if word in names:
        return word
    found = [name for name in names if word and name.startswith(word)]
    if len(found) != 1:
        raise PlanError(f'no engine "{word}"; there are: {", ".join(names)}')
    return found[0]


def find_engines(text: str) -> list[str]:
    return list(dict.fromkeys(find_engine(word.strip()) for word in text.split(",")))


def find_reference(text: str) -> str | Path:
    if is_picture(text):
        if not Path(text).is_file():
            raise PlanError(f'reference "{text}" is not there')
        return Path(text)
    return find_engine(text)


def content_key(plan: Plan, engine: str, facts: dict) -> str:
    """A digest of all that the reference depends on: the .blend, the files it reads (by size and time), the view, the program."""
    digest = hashlib.sha256(plan.file.read_bytes())
    for name in sorted(facts["reads"]):
        path = Path(name)
        stat = path.stat() if path.is_file() else None
        digest.update(f"{name} {stat.st_size if stat else ''} {stat.st_mtime_ns if stat else ''}".encode())
    view = {name: value for name, value in plan.view().items() if name != "threads"}
    digest.update(f"{engine} {facts['blender']} {facts['size']} {facts['frame']} {view}".encode())
    if engine != CYCLES:
        digest.update(Path(native.module()._core.__file__).read_bytes())
    return digest.hexdigest()[:24]
