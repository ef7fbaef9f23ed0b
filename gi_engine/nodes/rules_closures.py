"""Rules of the shader nodes: what they add to the surface, as closure ops. No bpy.

Normal and Coat Normal that are not linked are the zero vector, which the ops take for the shading normal.
"""

from __future__ import annotations

from .attributes import STRAND_NORMAL, STRAND_RANDOM
from .program import Value
from .rules import closure_rule
from .rules_input import surface_tangent

NONE = (0.0, 0.0, 0.0)  # a normal or tangent that is not linked
CUTOFF = 1e-5  # weights below this do not show, as in Cycles
DISTRIBUTIONS = {"GGX": 0, "BECKMANN": 1, "ASHIKHMIN_SHIRLEY": 2, "MULTI_GGX": 3}


def number(b, value: Value) -> float | None:
    """The value where it is a constant (of a colour the largest component), else None."""
    for key, constant in b.builder.constants.items():
        if constant.source == value.source:
            return key[value.component] if value.width == 1 else max(key[:-1])
    return None


def is_zero(b, value: Value) -> bool:
    n = number(b, value)
    return n is not None and n <= CUTOFF


def normal(b, name: str = "Normal"):
    return b.linked_or(name, NONE)


def tangent(b, anisotropy: Value):
    """The Tangent socket; only looked up where the surface is anisotropic."""
    n = number(b, anisotropy)
    if n is not None and abs(n) <= 1e-4:
        return NONE
    return b.input("Tangent") if b.linked("Tangent") else surface_tangent(b)


def film(b):
    return b.input("Thin Film Thickness", default=0.0), b.input("Thin Film IOR", default=1.33)


# -------------------------------------------------------------------- combining


@closure_rule("ShaderNodeMixShader")
def mix_shader(b, weight):
    factor = b.input("Fac")
    known = number(b, factor)
    first, second = b.op("mix_weights", weight, factor)
    for identifier, share, empty in (("Shader", first, 1.0), ("Shader_001", second, 0.0)):
        if known is None:
            with b.branch(share):
                b.closure(identifier, share)
        elif min(max(known, 0.0), 1.0) != empty:
            b.closure(identifier, share)


@closure_rule("ShaderNodeAddShader")
def add_shader(b, weight):
    b.closure("Shader", weight)
    b.closure("Shader_001", weight)


# -------------------------------------------------------------------- light and transparency


@closure_rule("ShaderNodeEmission", "ShaderNodeBackground")
def emission(b, weight):
    color, strength = b.input("Color"), b.input("Strength")
    if not is_zero(b, color) and number(b, strength) != 0.0:
        b.op("emission", weight, color, strength)


@closure_rule("ShaderNodeBsdfTransparent")
def transparent(b, weight):
    b.op("transparent", weight, b.input("Color"))


@closure_rule("ShaderNodeHoldout")
def holdout(b, weight):
    b.op("holdout", weight)


# -------------------------------------------------------------------- plain lobes


@closure_rule("ShaderNodeBsdfDiffuse")
def diffuse(b, weight):
    b.op("diffuse", weight, b.input("Color"), b.input("Roughness"), normal(b))


@closure_rule("ShaderNodeBsdfTranslucent")
def translucent(b, weight):
    b.op("translucent", weight, b.input("Color"), normal(b))


@closure_rule("ShaderNodeBsdfSheen")
def sheen(b, weight):
    op = "velvet" if b.node.distribution == "ASHIKHMIN" else "sheen"
    b.op(op, weight, b.input("Color"), b.input("Roughness"), normal(b))


@closure_rule("ShaderNodeBsdfToon")
def toon(b, weight):
    glossy = b.node.component == "GLOSSY"
    b.op("toon", weight, b.input("Color"), b.input("Size"), b.input("Smooth"), normal(b), imm=(glossy,))


@closure_rule("ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfGlossy")
def glossy(b, weight):
    anisotropy = b.input("Anisotropy", default=0.0)
    b.op(
        "glossy", weight, b.input("Color"), b.input("Roughness"), anisotropy, b.input("Rotation", default=0.0),
        normal(b), tangent(b, anisotropy), imm=(DISTRIBUTIONS[b.node.distribution],),
    )  # fmt: skip


@closure_rule("ShaderNodeBsdfRefraction")
def refraction(b, weight):
    distribution = DISTRIBUTIONS[b.node.distribution]
    b.op("refraction", weight, b.input("Color"), b.input("Roughness"), b.input("IOR"), normal(b), imm=(distribution,))


@closure_rule("ShaderNodeBsdfGlass")
def glass(b, weight):
    distribution = DISTRIBUTIONS[b.node.distribution]
    b.op(
        "glass",
        weight,
        b.input("Color"),
        b.input("Roughness"),
        b.input("IOR"),
        normal(b),
        *film(b),
        imm=(distribution,),
    )


@closure_rule("ShaderNodeBsdfMetallic")
def metallic(b, weight):
    physical = b.node.fresnel_type == "PHYSICAL_CONDUCTOR"
    base, edge = ("IOR", "Extinction") if physical else ("Base Color", "Edge Tint")
    anisotropy = b.input("Anisotropy")
    b.op(
        "metallic", weight, b.input(base), b.input(edge), b.input("Roughness"), anisotropy, b.input("Rotation"),
        normal(b), tangent(b, anisotropy), *film(b), imm=(DISTRIBUTIONS[b.node.distribution], physical),
    )  # fmt: skip


# -------------------------------------------------------------------- Principled


@closure_rule("ShaderNodeBsdfPrincipled")
def principled(b, weight):
    """Layers from the top down; each op gives the weight that is left for the next. Those that cannot show are left out."""
    from ..export.version import metal_has_no_film  # needs bpy

    alpha = b.input("Alpha")
    if (number(b, alpha) or 0.0) < 1.0:
        b.op("alpha", weight, alpha)
        weight = b.op("math_multiply", weight, b.op("saturate", alpha))
    below = principled_top(b, weight)
    principled_emission(b, weight, below)
    color, roughness, ior, tint = b.input("Base Color"), b.input("Roughness"), b.input("IOR"), b.input("Specular Tint")
    anisotropy, thin_wall, coating = b.input("Anisotropic"), b.input("Thin Wall", default=0.0), film(b)
    brushed = anisotropy, b.input("Anisotropic Rotation"), tangent(b, anisotropy)
    distribution = (DISTRIBUTIONS[b.node.distribution],)
    metallic, transmission = b.input("Metallic"), b.input("Transmission Weight")
    if not is_zero(b, metallic):
        metal_film = (0.0, coating[1]) if metal_has_no_film() else coating
        below = b.op(
            "metal_layer", below, normal(b), metallic, color, tint, roughness, *brushed, *metal_film, imm=distribution
        )
        if (number(b, metallic) or 0.0) >= 1.0:
            return
    if not is_zero(b, transmission):
        below = b.op(
            "glass_layer",
            below,
            normal(b),
            transmission,
            color,
            tint,
            roughness,
            ior,
            thin_wall,
            *coating,
            imm=distribution,
        )
        if (number(b, transmission) or 0.0) >= 1.0:
            return
    below = b.op(
        "specular_layer", below, normal(b), roughness, ior, b.input("Specular IOR Level"), tint, *brushed, *coating,
        imm=distribution,
    )  # fmt: skip
    weight = b.input("Subsurface Weight")
    b.op(
        "base_layer", below, normal(b), color, b.input("Diffuse Roughness"), weight, b.input("Subsurface Anisotropy"), thin_wall,
        b.input("Subsurface Radius"), b.input("Subsurface Scale"), roughness, ior, b.input("Specular IOR Level"),
        b.input("Subsurface IOR"), imm=(subsurface_method(b, "subsurface_method", not is_zero(b, weight)),),
    )  # fmt: skip


def principled_top(b, weight):
    """What lies over everything, the emission too: sheen, then coat. Returns the weight that they leave."""
    coat, sheen = b.input("Coat Weight"), b.input("Sheen Weight")
    coat_normal = normal(b, "Coat Normal")
    if not is_zero(b, sheen):
        weight = b.op(
            "sheen_layer",
            weight,
            normal(b),
            coat_normal,
            coat,
            sheen,
            b.input("Sheen Roughness"),
            b.input("Sheen Tint"),
        )
    if not is_zero(b, coat):
        weight = b.op(
            "coat_layer",
            weight,
            coat_normal,
            coat,
            b.input("Coat Roughness"),
            b.input("Coat IOR"),
            b.input("Coat Tint"),
        )
    return weight


def principled_emission(b, weight, below) -> None:
    """Emits only where there is something to emit: every emitting triangle becomes a light."""
    color, strength = b.input("Emission Color"), b.input("Emission Strength")
    if is_zero(b, color) or is_zero(b, strength):
        return
    if below is weight:
        b.op("emission", weight, color, strength)
    else:
        b.op("emission", 1.0, b.op("vector_multiply", color, below), strength)


# -------------------------------------------------------------------- below the surface

WALK, WALK_LEGACY, WALK_SKIN, PROFILE = range(4)


def subsurface_method(b, name: str, shows: bool = True) -> int:
    """The random walk of files from before "legacy" was told apart is the legacy one."""
    method = getattr(b.node, name)
    if shows:
        b.need("subsurface")
    known = b.node.bl_rna.properties[name].enum_items.keys()
    legacy = WALK_LEGACY if "RANDOM_WALK_LEGACY" not in known else WALK
    return {"RANDOM_WALK": legacy, "RANDOM_WALK_SKIN": WALK_SKIN, "BURLEY": PROFILE}.get(method, WALK_LEGACY)


@closure_rule("ShaderNodeSubsurfaceScattering")
def subsurface(b, weight):
    inputs = [b.input(name) for name in ("Color", "Scale", "Radius", "IOR")]
    entry = b.input("Roughness", default=1.0), b.input("Anisotropy")
    b.op("subsurface", weight, *inputs, *entry, normal(b), imm=(subsurface_method(b, "falloff"),))


# -------------------------------------------------------------------- hair


@closure_rule("ShaderNodeBsdfHair")
def hair(b, weight):
    along, across, is_strand, _ = b.op("strand")
    b.op(
        "hair_strand", weight, b.input("Color"), b.input("RoughnessU"), b.input("RoughnessV"), b.input("Offset"),
        b.linked_or("Tangent", NONE), along, across, is_strand, imm=(b.node.component == "Transmission",),
    )  # fmt: skip


@closure_rule("ShaderNodeBsdfHairPrincipled")
def principled_hair(b, weight):
    from ..export.version import hair_on_meshes_heeds_their_sides  # needs bpy

    imm = (hair_on_meshes_heeds_their_sides(),)
    along, _, is_strand, met = b.op("strand")
    random, uneven = hair_random(b), b.input("Random Roughness")
    roughness, huang = b.op("vary", b.input("Roughness"), random, uneven), b.node.model == "HUANG"
    radial = roughness if huang else b.op("vary", b.input("Radial Roughness"), random, uneven)
    absorption = hair_absorption(b, random, radial)
    offset, ior = b.input("Offset"), b.input("IOR")
    if huang:
        parts = [b.input(name) for name in ("R lobe", "TT lobe", "TRT lobe")]
        aspect = b.input("Aspect Ratio")
        round_one = number(b, aspect) == 1.0
        own_normal = NONE if round_one else b.op("attribute", imm=(b.attribute(STRAND_NORMAL),))[0]
        place = along, met, is_strand, b.op("strand_place", imm=(0,))[1], own_normal
        name = "hair_huang" if round_one else "hair_huang_elliptic"
        b.op(name, weight, absorption, roughness, offset, ior, aspect, *parts, *place, imm=imm)
    else:
        b.op("hair_chiang", weight, absorption, roughness, radial, b.input("Coat"), offset, ior, along, met, imm=imm)


def hair_random(b):
    """Where nothing is linked, each strand's own number; on meshes, which have none, the socket's."""
    given = b.input("Random")
    if b.linked("Random"):
        return given
    slot = b.attribute(STRAND_RANDOM)
    more = b.op("math_subtract", b.op("attribute", imm=(slot,))[1], given)
    return b.op("math_add", given, b.op("math_multiply", more, b.op("has_attribute", imm=(slot,))))


def hair_absorption(b, random, radial):
    if b.node.parametrization == "ABSORPTION":
        return b.input("Absorption Coefficient")
    if b.node.parametrization == "COLOR":
        return b.op("absorption_of_color", b.input("Color"), radial)
    melanin = b.op("vary", b.input("Melanin"), random, b.op("saturate", b.input("Random Color")))
    pigments = b.op("absorption_of_melanin", melanin, b.input("Melanin Redness"))
    return b.op("vector_add", pigments, b.op("absorption_of_color", b.input("Tint"), radial))


# -------------------------------------------------------------------- portals, and what is for other engines


@closure_rule("ShaderNodeBsdfRayPortal")
def ray_portal(b, weight):
    color, elsewhere = b.input("Color"), b.linked("Position")
    if not is_zero(b, color):
        b.need("portals")
        b.op("ray_portal", weight, color, b.linked_or("Position", NONE), b.input("Direction"), imm=(elsewhere,))


@closure_rule("ShaderNodeEeveeSpecular")
def eevee_specular(b, weight):
    b.warn("for EEVEE alone; it renders black, as in Cycles")
