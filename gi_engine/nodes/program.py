"""Building a register program, instruction by instruction. No bpy.

A Value stands for registers that are numbered at the end: constants first, as the native side wants them. Equal
constants and equal instructions are made once; what is computed inside a branch is not used outside it.
"""

from __future__ import annotations

import functools
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from .. import native
from ..scene_data import Program

FLOAT, VECTOR, COLOR = "FLOAT", "VECTOR", "COLOR"


@dataclass(frozen=True)
class Value:
    """The result of an instruction, a constant, or one component of either."""

    source: int  # number of the result within its builder
    kind: str  # FLOAT, VECTOR or COLOR: what a conversion makes of it
    component: int = 0

    @property
    def width(self) -> int:
        return 1 if self.kind == FLOAT else 3


@functools.cache
def op_table() -> dict[str, tuple[int, str, str, int]]:
    """name -> (code, outputs, inputs, number of immediates), as the native side declares them."""
    return native.module().ops()


class ProgramBuilder:
    """One program in the making."""

    def __init__(self):
        self.widths: list[int] = []  # of every source
        self.constants: dict[tuple, Value] = {}
        self.code: list = []  # (code, outputs, inputs, immediates), or a label
        self.scopes: list[dict] = [{}]  # results of instructions by what they are, innermost last
        self.tables: list[float] = []

    # ---------------------------------------------------------------- values

    def constant(self, *numbers: float, kind: str | None = None) -> Value:
        kind = kind or (FLOAT if len(numbers) == 1 else VECTOR)
        key = (*map(float, numbers), kind)
        if key not in self.constants:
            self.constants[key] = self.new_value(kind)
        return self.constants[key]

    def new_value(self, kind: str) -> Value:
        self.widths.append(1 if kind == FLOAT else 3)
        return Value(len(self.widths) - 1, kind)

    def as_kind(self, value: Value, kind: str) -> Value:
        """The value converted as Blender converts between sockets."""
        if value.kind == kind:
            return value
        if kind == FLOAT:
            return self.op("rgb_to_bw" if value.kind == COLOR else "average", value)
        if value.kind == FLOAT:
            return self.op("splat", value, kind=kind)
        return Value(value.source, kind, value.component)

    def component(self, value: Value, index: int) -> Value:
        return Value(value.source, FLOAT, value.component + index)

    def table(self, numbers) -> int:
        """Adds a lookup table; returns its offset, for an immediate."""
        self.tables.extend(np.asarray(numbers, np.float32).ravel().tolist())
        return len(self.tables) - np.size(numbers)

    # ---------------------------------------------------------------- instructions

    def op(self, name: str, *inputs, imm: tuple = (), kind: str | None = None):
        """Emits an instruction. Numbers and tuples among the inputs become constants, values are converted to the width
        that the op wants. Returns its output, or a tuple of outputs; `kind` says COLOR where a width of 3 means one."""
        code, outputs, widths, immediates = op_table()[name]
        if len(inputs) != len(widths) or len(imm) != immediates:
            raise TypeError(
                f"op {name} takes {len(widths)} inputs and {immediates} immediates, not {len(inputs)} and {len(imm)}"
            )
        values = tuple(self.fit(value, width) for value, width in zip(inputs, widths, strict=True))
        imm = tuple(int(i) for i in imm)
        key = (name, tuple((v.source, v.component) for v in values), imm)
        if outputs and name not in UNIQUE:
            for scope in reversed(self.scopes):
                if key in scope:
                    return self.results(scope[key], kind)
        made = tuple(self.new_value(FLOAT if width == "f" else VECTOR) for width in outputs)
        self.code.append((code, made, values, imm))
        self.scopes[-1][key] = made
        return self.results(made, kind)

    @staticmethod
    def results(made: tuple, kind: str | None):
        if kind:
            made = tuple(v if v.kind == FLOAT else Value(v.source, kind, v.component) for v in made)
        return made[0] if len(made) == 1 else made

    def fit(self, value, width: str) -> Value:
        if not isinstance(value, Value):
            value = self.constant(*np.atleast_1d(np.asarray(value, float)).tolist())
        if width == "f":
            return self.as_kind(value, FLOAT)
        return value if value.kind != FLOAT else self.as_kind(value, VECTOR)

    @contextmanager
    def fresh(self):
        """Results made inside are not shared with the outside: for branches, and where the shading point is shifted."""
        self.scopes.append({})
        yield
        self.scopes.pop()

    @contextmanager
    def isolated(self):
        """As `fresh`, and results from outside are not used inside either."""
        outer, self.scopes = self.scopes, [{}]
        yield
        self.scopes = outer

    @contextmanager
    def unless_zero(self, condition: Value):
        """Skips the instructions inside where `condition` is 0."""
        jump = [op_table()["jump_if_zero"][0], (), (self.as_kind(condition, FLOAT),), [0]]
        self.code.append(jump)
        with self.fresh():
            yield
        jump[3] = [len(self.code)]  # as an index into self.code until `finish` knows the words

    def finish(self, name: str) -> Program:
        place: dict[int, int] = {}
        constants: list[float] = []
        for numbers, value in self.constants.items():
            place[value.source] = len(constants)
            constants.extend(numbers[:-1])
        count = len(constants)
        for source, width in enumerate(self.widths):
            if source not in place:
                place[source] = count
                count += width
        words, starts = [], []
        for code, outputs, inputs, imm in self.code:
            starts.append(len(words))
            words += [code, *(place[v.source] + v.component for v in (*outputs, *inputs)), *imm]
        starts.append(len(words))
        for at, (_, _, _, imm) in enumerate(self.code):
            if isinstance(imm, list):
                words[starts[at] + 2] = starts[imm[0]]
        return Program(
            name=name,
            code=np.array(words, np.int32),
            constants=np.array(constants, np.float32),
            register_count=count,
            tables=np.array(self.tables, np.float32),
        )


# Ops that do something besides giving a value: never shared.
UNIQUE = frozenset({"bump_shift", "undisplace"})
