"""The border of the native programs: whatever comes in is either run or refused with a ValueError."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gi_engine import native
from gi_engine.nodes.program import ProgramBuilder, op_table

TABLE = op_table()
SMALL = st.integers(-4, 40)
WORD = st.one_of(SMALL, st.integers(-(2**31), 2**31 - 1))


def run(code, constants=(), registers=64, tables=()):
    """The native check, folding, packing, and one run at a point."""
    point = native.module()._core.ShadedPoint if hasattr(native.module(), "_core") else native.module().ShadedPoint
    return point([int(c) for c in code], [float(c) for c in constants], registers, list(tables), (0.0, 0.6, 0.8), False)


@settings(max_examples=400, deadline=None)
@given(st.lists(WORD, max_size=60), st.lists(st.floats(width=32), max_size=12), st.integers(-1, 70))
def test_garbage(code, constants, registers):
    try:
        run(code, constants, registers)
    except ValueError as error:
        assert "test" in str(error)


@st.composite
def instructions(draw):
    """Real ops with random operands, nearly all in range."""
    code = []
    for _ in range(draw(st.integers(1, 12))):
        number, outputs, inputs, immediates = TABLE[draw(st.sampled_from(sorted(TABLE)))]
        code += [number, *(draw(st.integers(12, 61)) for _ in outputs), *(draw(st.integers(0, 61)) for _ in inputs)]
        code += [draw(SMALL if number else st.integers(0, 90)) for _ in range(immediates)]
    return code


@settings(max_examples=1500, deadline=None)
@given(instructions(), st.lists(st.floats(width=32), min_size=12, max_size=12), st.integers(0, 64))
def test_random_instructions(code, constants, tables):
    try:
        run(code, constants, 64, [0.5] * tables)
    except ValueError as error:
        assert "test" in str(error)


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ([10**6], "no op"),
        ([-1], "no op"),
        ([TABLE["math_add"][0], 20, 0], "cut off"),
        ([TABLE["math_add"][0], 20, 0, 64], "register 64"),
        ([TABLE["math_add"][0], 20, 0, -1], "register -1"),
        ([TABLE["vector_add"][0], 62, 0, 0], "register 62"),
        ([TABLE["math_add"][0], 1, 0, 0], "constant"),
        ([TABLE["jump_if_zero"][0], 0, 0], "forwards"),
        ([TABLE["jump_if_zero"][0], 0, 4, TABLE["math_sine"][0], 20, 0], "inside"),
        ([TABLE["color_ramp"][0], 20, 23, 0, 0, 256, 1], "table"),
    ],
)
def test_refused(code, message):
    with pytest.raises(ValueError, match=message):
        run(code, [1.0, 2.0])


def test_equal_instructions_are_made_once():
    builder = ProgramBuilder()
    a = builder.op("math_add", 1.0, 2.0)
    assert builder.op("math_add", 1.0, 2.0) == a
    assert builder.op("math_add", 2.0, 1.0) != a
    program = builder.finish("once")
    assert sorted(program.constants.tolist()) == [1.0, 2.0]


def test_branches_keep_their_values_to_themselves():
    """What is computed in a branch may not have been computed where the branch was skipped."""
    builder = ProgramBuilder()
    with builder.unless_zero(builder.constant(1.0)):
        inside = builder.op("math_sine", 0.5)
    assert builder.op("math_sine", 0.5) != inside


def emitted(build) -> np.ndarray:
    builder = ProgramBuilder()
    builder.op("emission", 1.0, build(builder), 1.0)
    p = builder.finish("test")
    return np.array(run(p.code, p.constants, p.register_count, p.tables).emission)


def test_skipped_and_taken_branches():
    def build(builder, condition):
        with builder.unless_zero(builder.op("ray_kind", imm=(condition,))):
            builder.op("emission", 1.0, (0.0, 2.0, 0.0), 1.0)
        return (1.0, 0.0, 0.0)

    camera, shadow = 1, 2
    assert emitted(lambda b: build(b, camera)).tolist() == [1.0, 2.0, 0.0]
    assert emitted(lambda b: build(b, shadow)).tolist() == [1.0, 0.0, 0.0]


@settings(max_examples=100, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["math_add", "math_multiply", "math_maximum"]), st.integers(0, 30), st.integers(0, 30)
        ),
        min_size=1,
        max_size=60,
    )
)
def test_folding_and_packing_change_nothing(steps):
    """The same sums from a constant (folded away) and from the point (computed, in shared registers)."""

    def build(start):
        def run_steps(builder):
            values = [start(builder), builder.constant(0.5)]
            for name, a, b in steps:
                values.append(
                    builder.op("saturate", builder.op(name, values[a % len(values)], values[b % len(values)]))
                )
            return builder.op("combine", values[-1], values[len(values) // 2], values[0])

        return run_steps

    folded = emitted(build(lambda b: b.constant(1.0)))
    computed = emitted(build(lambda b: b.op("ray_kind", imm=(1,))))
    assert folded.tolist() == computed.tolist()


SPECIAL = st.sampled_from([0.0, 1.0, -1.0, 0.5, 2.0, 0.3])
ARITHMETIC = sorted(
    n
    for n, op in TABLE.items()
    if n.startswith(("math_", "vector_", "blend_", "mix_", "mapping")) and len(op[1]) == 1 and op[3] < 2
)


@settings(max_examples=800, deadline=None)
@given(
    st.sampled_from(ARITHMETIC), st.lists(st.tuples(SPECIAL, SPECIAL, SPECIAL, st.booleans()), min_size=6, max_size=6)
)
def test_what_leaves_a_value_as_it_is_is_passed_by(name, inputs):
    """The same op with some inputs constant (where a sum with 0 or a mix of one side is left out) and with none."""
    _, outputs, widths, immediates = TABLE[name]
    if "vector_transform" in name or name == "vector_displacement":
        return

    def build(all_vary):
        def make(builder):
            one = builder.op("ray_kind", imm=(1,))
            values = []
            for (x, y, z, varies), width in zip(inputs, widths, strict=False):
                value = builder.constant(x) if width == "f" else builder.constant(x, y, z)
                if varies or all_vary:
                    # 1 and 0 that are not known to be so, or they would be left out as well
                    value = (
                        builder.op("math_multiply", value, one)
                        if width == "f"
                        else builder.op("vector_scale", value, one)
                    )
                values.append(value)
            made = builder.op(name, *values, imm=(0,) * immediates)
            return builder.op("combine", made, made, made) if outputs == "f" else made

        return make

    assert emitted(build(False)).tolist() == pytest.approx(emitted(build(True)).tolist(), rel=1e-6, nan_ok=True)


@pytest.mark.parametrize("name", [name for name, op in sorted(TABLE.items()) if not op[1] and "f" in op[2]])
def test_closures_of_what_is_not_a_number(name):
    """One input after the other not a number, the others one half: run or refused."""
    number, _, inputs, immediates = TABLE[name]
    for broken in range(len(inputs)):
        sources = [3 if k == broken else 0 for k in range(len(inputs))]
        for immediate in range(4):
            try:
                run([number, *sources, *[immediate] * immediates], [0.5] * 3 + [np.nan] * 3, 16)
            except ValueError as error:
                assert "test" in str(error)
