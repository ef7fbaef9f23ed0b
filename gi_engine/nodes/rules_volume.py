"""Rules of the nodes of volumes: coefficients per metre, as one closure op. No bpy.

On surfaces they render black, as in Cycles."""

from __future__ import annotations

from .rules import closure_rule

PHASES = {"HENYEY_GREENSTEIN": 0, "RAYLEIGH": 1, "DRAINE": 2, "MIE": 3, "FOURNIER_FORAND": 4}
BLACK, WHITE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)


def coefficients(b, weight, absorption, scattering, emission=BLACK, anisotropy=0.0, extra=0.0, phase=0) -> None:
    b.need("absorption" if is_black(b, scattering) and is_black(b, emission) else "volumes")
    b.op("volume_coefficients", weight, absorption, scattering, emission, anisotropy, extra, imm=(phase,))


def is_black(b, color) -> bool:
    """Whether it is a constant that is."""
    return color is BLACK or color == b.constant(*BLACK, kind=color.kind)


def volume_rule(idname: str):
    """For functions that are called in volumes alone."""

    def add(function):
        @closure_rule(idname)
        def closure(b, weight):
            if b.walker.is_volume:
                function(b, weight)
            else:
                b.warn("a volume on a surface; it renders black, as in Cycles")

        return function

    return add


def density(b):
    return b.op("math_maximum", b.input("Density"), 0.0)


def without(b, color):
    """1 - color"""
    return b.op("vector_subtract", WHITE, color)


def phase_inputs(b) -> tuple:
    """The phase function's two numbers, and which it is."""
    phase = getattr(b.node, "phase", "HENYEY_GREENSTEIN")
    if phase not in PHASES:
        b.warn(f"the phase function {phase.replace('_', ' ').title()} is not known: Henyey-Greenstein's is used")
        return b.input("Anisotropy"), 0.0, 0
    if phase == "FOURNIER_FORAND":
        return b.input("Backscatter"), b.input("IOR"), PHASES[phase]
    extra = {"DRAINE": "Alpha", "MIE": "Diameter"}.get(phase)
    return b.input("Anisotropy"), b.input(extra) if extra else 0.0, PHASES[phase]


@volume_rule("ShaderNodeVolumeAbsorption")
def absorption(b, weight):
    coefficients(b, weight, b.op("vector_scale", without(b, b.input("Color")), density(b)), BLACK)


@volume_rule("ShaderNodeVolumeScatter")
def scatter(b, weight):
    anisotropy, extra, phase = phase_inputs(b)
    scattering = b.op("vector_scale", b.input("Color"), density(b))
    coefficients(b, weight, BLACK, scattering, BLACK, anisotropy, extra, phase)


@volume_rule("ShaderNodeVolumeCoefficients")
def given_coefficients(b, weight):
    anisotropy, extra, phase = phase_inputs(b)
    names = ("Absorption Coefficients", "Scatter Coefficients", "Emission Coefficients")
    coefficients(b, weight, *map(b.input, names), anisotropy, extra, phase)


@volume_rule("ShaderNodeVolumePrincipled")
def principled(b, weight):
    """What is neither scattered nor of the absorption colour is absorbed; hot volumes glow by Stefan and Boltzmann's law."""
    color, thick = b.input("Color"), density(b)
    root = b.op("vector_power", b.op("vector_maximum", b.input("Absorption Color"), BLACK), (0.5, 0.5, 0.5))
    left = [b.op("vector_maximum", without(b, c), BLACK) for c in (color, root)]
    absorbed = b.op("vector_scale", b.op("vector_multiply", *left), thick)
    strength = b.op("math_maximum", b.input("Emission Strength"), 0.0)
    emission = b.op("vector_scale", b.input("Emission Color"), strength)
    coefficients(
        b,
        weight,
        absorbed,
        b.op("vector_scale", color, thick),
        b.op("vector_add", emission, glow(b)),
        b.input("Anisotropy"),
    )


STEFAN_BOLTZMANN = 5.670373e-8 * 1e-6 / 3.14159265358979


def glow(b):
    amount, temperature = b.input("Blackbody Intensity"), b.op("math_maximum", b.input("Temperature"), 0.0)
    fourth = b.op("math_power", temperature, 4.0)
    power = b.op("math_multiply", b.op("mix_float", amount, 1.0, fourth), STEFAN_BOLTZMANN)
    shown = b.op("math_multiply", power, b.op("math_greater_than", amount, 0.0))
    return b.op(
        "vector_scale", b.op("vector_multiply", b.op("blackbody", temperature), b.input("Blackbody Tint")), shown
    )
