"""Files of what an integrator keeps: tables of numbers under a header, with a checksum over all. No bpy, nothing of light.

A file is MAGIC, the version of the format and the length of the header (both uint32), the header (JSON: kind, version of what is
kept, notes, names and shapes of the tables), the tables (float32, by rows), and the SHA-256 of all before it. Everything is
little-endian. Files appear whole or not at all. Leaves out what the tables mean, and whether they fit a scene.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import struct
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

MAGIC = b"GI-KEPT\n"
FORMAT = 1
HEAD = struct.Struct("<8sII")
SUM_BYTES = hashlib.sha256().digest_size
NUMBER = np.dtype("<f4")


class KeptFileError(ValueError):
    """The file cannot be used; the message names it. `foreign`: it is none of ours, and must not be replaced."""

    def __init__(self, path: Path, problem: str, foreign: bool = False):
        super().__init__(f'"{path}" {problem}')
        self.foreign = foreign


@dataclass
class KeptFile:
    kind: str  # the integrator's id
    version: int  # of what the tables hold
    notes: dict  # whatever JSON can hold
    tables: dict[str, np.ndarray] = field(default_factory=dict)  # (rows, columns) float32


def write(path: Path, kept: KeptFile) -> None:
    """Raises KeptFileError."""
    tables = {name: np.ascontiguousarray(table, NUMBER) for name, table in kept.tables.items()}
    shapes = [[name, *table.shape] for name, table in tables.items()]
    header = {"kind": kept.kind, "version": kept.version, "notes": kept.notes, "tables": shapes}
    words = json.dumps(header, separators=(",", ":")).encode()
    digest = hashlib.sha256()
    written = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=".gi-engine-", delete=False) as file:
            written = file.name
            for part in (HEAD.pack(MAGIC, FORMAT, len(words)), words, *(table.data for table in tables.values())):
                # NumPy gives an empty table no bytes that hashlib would take.
                part = memoryview(part).cast("B") if len(part) else b""
                digest.update(part)
                file.write(part)
            file.write(digest.digest())
            file.flush()
            os.fsync(file.fileno())
        os.replace(written, path)
    except OSError as error:
        if written:
            Path(written).unlink(missing_ok=True)
        raise KeptFileError(path, f"cannot be written: {error.strerror}") from error


def read(path: Path, kind: str, version: int) -> KeptFile:
    """The tables of a `kind`, in the `version` that is understood. Raises KeptFileError."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise KeptFileError(path, f"cannot be read: {error.strerror}", foreign=True) from error
    if content[: len(MAGIC)] != MAGIC:
        raise KeptFileError(path, "is no file of GI Engine's", foreign=True)
    if len(content) < HEAD.size + SUM_BYTES:
        raise KeptFileError(path, "is damaged: it ends too soon")
    _, format_version, length = HEAD.unpack_from(content)
    if format_version != FORMAT:
        raise KeptFileError(path, f"is of format {format_version}, this GI Engine reads {FORMAT}")
    body = memoryview(content)[:-SUM_BYTES]
    if hashlib.sha256(body).digest() != content[-SUM_BYTES:]:
        raise KeptFileError(path, "is damaged: its checksum is wrong")
    header = json.loads(bytes(body[HEAD.size : HEAD.size + length]))
    if header["kind"] != kind:
        raise KeptFileError(path, f'was kept by integrator "{header["kind"]}", not "{kind}"', foreign=True)
    if header["version"] != version:
        raise KeptFileError(path, f"holds version {header['version']} of its tables, this GI Engine reads {version}")
    kept = KeptFile(kind, version, header["notes"])
    start = HEAD.size + length
    for name, *shape in header["tables"]:
        kept.tables[name] = np.frombuffer(body, NUMBER, math.prod(shape), start).reshape(shape).astype(np.float32)
        start += kept.tables[name].nbytes
    return kept
