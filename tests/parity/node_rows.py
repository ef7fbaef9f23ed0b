"""Rows of the table of shader nodes, made from Blender's RNA: every node that a shader tree takes, each of its modes, each of its
inputs. A node that a new Blender brings is here at once. What RNA does not tell (curves, images, names) is in SPECIAL.

A row's values come from the place on the object, so that a tile shows a whole range of each input at once."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import bpy
import numpy as np

from . import cases_nodes
from .studio import node, put, tree_of

MOST_MODES = 100  # combinations of a node's menus; beyond that one menu at a time
SKIPPED_PROPERTIES = {"target", "is_active_output", "data_type_socket"}
STEPPED = {"ShaderNodeTexWhiteNoise"}  # another value at every point: their sources go in steps
SPAN = 1.625  # jumps of a value then do not lie on the centres of pixels; exact in binary, as STEPPED nodes want it
SLANT = 1.0625  # of every other input, so that two of them are not the same along a diagonal
FINE = 0.2  # patterns so much coarser than by default, or pixels would be too few for them
POSITIVE = {"Exponent", "Randomness"}  # at 0 all points are as far, and the nearest is anyone's
LEAST = {"Sides": 2.0625}  # two sides with round corners are not a number in Cycles
LAYOUT = {"NodeFrame", "NodeReroute", "NodeGroupInput", "NodeGroupOutput", "ShaderNodeGroup"}


@dataclass
class Row:
    """One tile: a node in one mode, with some of its inputs moved, and one output (or the closure) that is looked at."""

    idname: str
    output: str  # identifier of the output socket
    modes: dict = field(default_factory=dict)  # property -> value
    moved: tuple = ()  # identifiers of inputs that are not at their default
    closure: bool = False

    @property
    def name(self) -> str:
        parts = [said(name, value) for name, value in self.modes.items()]
        moved = {0: "defaults", 1: f"{self.moved[0]} moved" if self.moved else ""}.get(len(self.moved), "all moved")
        return f"{' / '.join([*parts, moved])} -> {self.output}"


def said(name: str, value) -> str:
    """A mode as the table has it: menus by their item, switches and numbers by their name."""
    if isinstance(value, str):
        return value.lower().replace("_", " ")
    return f"{name} {'on' if value is True else 'off' if value is False else f'{value:.3g}'}"


def kinds() -> list[str]:
    """Every node type that may stand in a shader tree, in alphabetical order."""
    tree = scratch_tree()
    found = []
    for name in dir(bpy.types):
        kind = getattr(bpy.types, name)
        if not (isinstance(kind, type) and issubclass(kind, bpy.types.Node)):
            continue
        try:
            made = tree.nodes.new(name)
        except RuntimeError:
            continue
        found.append(name)
        tree.nodes.remove(made)
    return [name for name in found if name not in LAYOUT]


def scratch_tree():
    made = bpy.data.materials.get("scratch") or bpy.data.materials.new("scratch")
    return tree_of(made)


# -------------------------------------------------------------------- modes and inputs


def own_properties(made):
    base = set(bpy.types.ShaderNode.bl_rna.properties.keys()) | SKIPPED_PROPERTIES
    return [p for p in made.bl_rna.properties if p.identifier not in base and not p.is_readonly]


def enum_values(made, prop) -> list:
    """The items that this node really takes."""
    before, taken = getattr(made, prop.identifier), []
    for item in prop.enum_items:
        try:
            setattr(made, prop.identifier, item.identifier)
            taken.append(item.identifier)
        except TypeError:
            continue
    if before:
        setattr(made, prop.identifier, before)
    return taken


def modes_of(made) -> list[dict]:
    """The default first; all combinations of menus, or one at a time where they are many; then switches and numbers by themselves."""
    menus, others = {}, []
    for prop in own_properties(made):
        name = prop.identifier
        if prop.type == "ENUM" and not prop.is_enum_flag:
            values = enum_values(made, prop)
            if len(values) > 1:
                menus[name] = [getattr(made, name), *(v for v in values if v != getattr(made, name))]
        elif prop.type == "BOOLEAN" and not prop.is_array:
            others.append({name: not getattr(made, name)})
        elif prop.type in ("INT", "FLOAT") and not prop.is_array:
            others.append({name: another_number(prop, getattr(made, name))})
    if np.prod([len(values) for values in menus.values()]) <= MOST_MODES:
        combined = [dict(zip(menus, choice, strict=True)) for choice in itertools.product(*menus.values())]
    else:
        combined = [{}] + [{name: value} for name, values in menus.items() for value in values[1:]]
    return combined + others


def another_number(prop, value):
    lo, hi = max(prop.soft_min, value - 2.0), min(prop.soft_max, value + 2.0)
    other = lo + 0.7 * (hi - lo)
    if prop.type == "INT":
        return int(round(other)) if int(round(other)) != value else int(max(lo, min(hi, value + 1)))
    return float(other)


def moving(made) -> list:
    """Inputs that a row can move: enabled and of a kind that has numbers."""
    kinds_moved = {"VALUE", "INT", "BOOLEAN", "VECTOR", "ROTATION", "RGBA"}
    return [s for s in made.inputs if s.enabled and s.type in kinds_moved and s.name != "Weight"]


def rows_of(idname: str) -> list[Row]:
    tree = scratch_tree()
    rows = []
    made = tree.nodes.new(idname)
    prepare(made)
    for i, modes in enumerate(modes_of(made)):
        fresh = tree.nodes.new(idname)
        prepare(fresh)
        try:
            apply(fresh, modes)
        except (AttributeError, TypeError):
            tree.nodes.remove(fresh)
            continue
        names = tuple(s.identifier for s in moving(fresh))
        outputs = [s for s in fresh.outputs if s.enabled and s.type in cases_of(s)]
        for output in outputs:
            closure = output.type == "SHADER"
            rows.append(Row(idname, output.identifier, modes, () if closure else names, closure))
            if i == 0 and names:
                if not closure:
                    rows.append(Row(idname, output.identifier, modes, (), closure))
                rows += [Row(idname, output.identifier, modes, (name,), closure) for name in names]
        tree.nodes.remove(fresh)
    return rows


def cases_of(socket) -> set:
    return {"VALUE", "INT", "BOOLEAN", "VECTOR", "ROTATION", "RGBA", "SHADER"} - (
        {"VECTOR"}
        if socket.node.bl_idname in ("ShaderNodeBump", "ShaderNodeNormalMap") and socket.name != "Normal"
        else set()
    )


def apply(made, modes: dict) -> None:
    for name, value in modes.items():
        setattr(made, name, value)


# -------------------------------------------------------------------- materials


def material_of(row: Row, name: str):
    """The row's material: a value as emission, or the closure itself."""
    if not row.closure:
        return cases_nodes.emitting(
            name, lambda tree, given: built(row, tree, given).outputs[index_of_output(row, tree)]
        )
    made = bpy.data.materials.new(name)
    tree = tree_of(made)
    given = cases_nodes.sources(tree)
    shader = built(row, tree, given)
    from .studio import output

    if is_volume(shader):
        out = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(shader.outputs[0], out.inputs["Volume"])
    else:
        output(tree, shader)
    return made


def is_volume(shader) -> bool:
    return shader.outputs[0].name == "Volume"


def index_of_output(row: Row, tree) -> int:
    made = next(n for n in tree.nodes if n.name == "under test")
    return [s.identifier for s in made.outputs].index(row.output)


def built(row: Row, tree, given: dict):
    made = node(tree, row.idname)
    made.name = "under test"
    prepare(made)
    apply(made, row.modes)
    accompany(made, row)
    if row.idname.startswith("ShaderNodeTex") and "Scale" in made.inputs:
        made.inputs["Scale"].default_value *= FINE
    texture = row.idname.startswith("ShaderNodeTex")
    for i, socket in enumerate(moving(made)):
        if socket.identifier not in row.moved:
            continue
        # How a pattern is made goes in steps over it, or it would be finer than pixels can show.
        steps = row.idname in STEPPED or (texture and socket.type != "VECTOR")
        source = stepped(tree, given["P"]) if steps else given["P"]
        (fix if row.closure else move)(tree, socket, i, given | {"P": source})
    return made


def stepped(tree, place):
    return node(tree, "ShaderNodeVectorMath", {"operation": "SNAP"}, {0: place, 1: (0.25, 0.25, 16.0)}).outputs[0]


def move(tree, socket, i: int, given: dict) -> None:
    """Links an input to something that goes through a range about its default."""
    if socket.type == "RGBA":
        parts = node(tree, "ShaderNodeSeparateXYZ", None, {0: given["P"]}).outputs
        turned = {
            0: parts[(i + 1) % 2],
            1: parts[i % 2],
            2: 0.2 + 0.1 * i,
        }  # different for each, as mixing would not show
        put(tree, socket, node(tree, "ShaderNodeCombineColor", None, turned).outputs[0])
    elif socket.type in ("VECTOR", "ROTATION"):
        default = np.array(list(socket.default_value)[:3] + [0.0] * (3 - len(socket.default_value)))
        size = SPAN * max(1.0, float(np.abs(default).max())) * np.array((1.0, SLANT, 1.0))
        inputs = {0: given["P"], 1: tuple(size), 2: tuple(default - 0.5 * size)}
        put(tree, socket, node(tree, "ShaderNodeVectorMath", {"operation": "MULTIPLY_ADD"}, inputs).outputs[0])
    elif socket.type == "VALUE":
        default = float(socket.default_value)
        factor = "Factor" in socket.bl_idname
        size = (
            1.0 if factor else SPAN * max(1.0 if abs(default) < 1e-6 else 0.6, abs(default)) * (SLANT if i % 2 else 1.0)
        )
        source = node(tree, "ShaderNodeSeparateXYZ", None, {0: given["P"]}).outputs[i % 2]
        start = 0.0 if factor else default - 0.5 * size
        if socket.name in POSITIVE:
            size, start = 0.75, 0.1875
        start = max(start, LEAST.get(socket.name, start))
        put(
            tree,
            socket,
            node(tree, "ShaderNodeMath", {"operation": "MULTIPLY_ADD"}, {0: source, 1: size, 2: start}).outputs[0],
        )
    else:
        fix(tree, socket, i, given)


def fix(_tree, socket, i: int, _given: dict) -> None:
    """Sets an input to another value: closures are looked at one value at a time."""
    if socket.type == "RGBA":
        socket.default_value = (0.8, 0.45, 0.2, 1.0)
    elif socket.type in ("VECTOR", "ROTATION"):
        if not is_direction(socket):
            socket.default_value = [v * f for v, f in zip(socket.default_value, (0.8, 1.3, 0.6), strict=False)]
    elif socket.type == "BOOLEAN":
        socket.default_value = not socket.default_value
    elif socket.type == "INT":
        socket.default_value += 1
    else:
        default = float(socket.default_value)
        socket.default_value = (
            (0.35 if default > 0.5 else 0.65) if "Factor" in socket.bl_idname else default * 1.3 + 0.2
        )


def is_direction(socket) -> bool:
    return "Normal" in socket.name or socket.name in ("Tangent", "Direction", "Position")


def accompany(made, row: Row) -> None:
    """Turns on what an input needs to show at all: the weight of its layer, a film, a metal that is brushed."""
    if row.idname in COMPANIONS:
        for name, value in COMPANIONS[row.idname].items():
            made.inputs[name].default_value = value
    for moved in row.moved if row.closure else ():
        socket = next(s for s in made.inputs if s.identifier == moved)
        for words, others in NEEDS.items():
            if socket.name.startswith(words):
                for name, value in others.items():
                    if name in made.inputs and made.inputs[name] != socket:
                        made.inputs[name].default_value = value


COMPANIONS = {
    "ShaderNodeTexBrick": {"Mortar Size": 0.1, "Mortar Smooth": 0.5},
    "ShaderNodeBump": {"Distance": 0.05},
    "ShaderNodeSubsurfaceScattering": {"Scale": 0.2},
    "ShaderNodeVolumePrincipled": {"Density": 2.0},
    "ShaderNodeVolumeAbsorption": {"Density": 2.0},
    "ShaderNodeVolumeScatter": {"Density": 2.0},
    "ShaderNodeBsdfHair": {"RoughnessU": 0.3, "RoughnessV": 0.6},
}
NEEDS = {
    "Subsurface": {"Subsurface Weight": 1.0, "Subsurface Scale": 0.2},
    "Anisotropic": {"Metallic": 1.0, "Anisotropic": 0.7},
    "Transmission": {"Transmission Weight": 1.0},
    "Coat": {"Coat Weight": 1.0},
    "Sheen": {"Sheen Weight": 1.0},
    "Thin Film": {"Thin Film Thickness": 400.0, "Roughness": 0.2},
    "Emission Color": {"Emission Strength": 0.5},
    "Thin Wall": {"Transmission Weight": 1.0},
    "Rotation": {"Anisotropy": 0.7},
    "Blackbody": {"Blackbody Intensity": 1.0},
}


# -------------------------------------------------------------------- what RNA does not tell


def prepare(made) -> None:
    special = SPECIAL.get(made.bl_idname)
    if special:
        special(made)


def a_picture(made) -> None:
    made.image = bpy.data.images.get("picture")
    if made.image is None:
        cases_nodes.picture("picture")(made)


def a_curve(made) -> None:
    cases_nodes.curve(made)


def a_ramp(made) -> None:
    made.color_ramp.elements[0].color = (0.1, 0.2, 0.8, 1)
    made.color_ramp.elements.new(0.4).color = (0.9, 0.7, 0.1, 0.6)


def two_shaders(made) -> None:
    tree = made.id_data
    first = node(tree, "ShaderNodeBsdfDiffuse", None, {"Color": (0.1, 0.3, 0.7)})
    second = node(tree, "ShaderNodeEmission", None, {"Color": (0.3, 0.2, 0.1)})
    tree.links.new(first.outputs[0], made.inputs[-2])
    tree.links.new(second.outputs[0], made.inputs[-1])


IES = "IESNA:LM-63-1995\nTILT=NONE\n1 1000 1 5 1 1 2 0 0 0 1 1 0\n0 22.5 45 67.5 90\n0\n100 80 60 20 5\n"


def a_photometry(made) -> None:
    made.ies = bpy.data.texts.get("lamp.ies") or bpy.data.texts.new("lamp.ies")
    made.ies.from_string(IES)


SPECIAL = {
    "ShaderNodeTexImage": a_picture,
    "ShaderNodeTexEnvironment": a_picture,
    "ShaderNodeRGBCurve": a_curve,
    "ShaderNodeVectorCurve": a_curve,
    "ShaderNodeFloatCurve": a_curve,
    "ShaderNodeValToRGB": a_ramp,
    "ShaderNodeMixShader": two_shaders,
    "ShaderNodeAddShader": two_shaders,
    "ShaderNodeTexIES": a_photometry,
    "ShaderNodeAttribute": lambda made: setattr(made, "attribute_name", "paint"),
    "ShaderNodeVertexColor": lambda made: setattr(made, "layer_name", "paint"),
    "ShaderNodeUVMap": lambda made: setattr(made, "uv_map", "UVMap"),
    "ShaderNodeValue": lambda made: setattr(made.outputs[0], "default_value", 0.37),
    "ShaderNodeRGB": lambda made: setattr(made.outputs[0], "default_value", (0.2, 0.5, 0.7, 1.0)),
}
