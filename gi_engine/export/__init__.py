"""Blender's depsgraph to scene_data: the whole scene, its settings and what could not be taken along.

Everything is read here, while Blender's data holds still; nothing is read while rendering.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .. import approximations
from ..scene_data import Camera, Instance, Scene, Settings, Strands
from .camera import export_camera
from .film import export_film, frame_size
from .images import release_scratch
from .lights import export_light
from .mesh import export_mesh, readable
from .objects import Collected, collect, place
from .places import read_places
from .settings import export_settings, resolve, unheeded
from .shaders import Shaders
from .strands import export_strands
from .warnings import Warnings
from .world import export_world

# What integrators make of what they do not carry.
WITHOUT = {
    "subsurface": "does not follow light below surfaces: subsurface scattering is diffuse of the same albedo",
    "volumes": "does not render volumes that scatter or glow: they are left out",
    "absorption": "does not render volumes: they are left out",
    "strands": "leaves out light that hair and points scatter on to other surfaces, in part at least",
    "portals": "sends no light through ray portals: they only show what lies behind them",
}


@dataclass
class Walked:
    """What going through the depsgraph's objects gave."""

    found: Collected
    instances: list[Instance | None] = field(default_factory=list)  # by prototype
    warnings: list[str] = field(default_factory=list)


@dataclass
class Exported:
    scene: Scene
    settings: Settings
    warnings: list[str]
    walked: Walked | None = None  # holds Blender's data, which is gone once the depsgraph is evaluated again


class ExportError(ValueError):
    """The scene cannot be rendered; the message is for the user."""


def export(
    depsgraph,
    descriptors: list[dict],
    engine=None,
    size=None,
    integrator: str | None = None,
    lightmap: str = "",
    known=None,
    view=None,
    needs_camera: bool = True,
) -> Exported:
    """`descriptors`: the integrators'. `engine`: the RenderEngine, where there is one (stereo, camera override).

    `size` is the full frame's in pixels; by default the scene's. `integrator` overrides the scene's.
    `lightmap`: the UV map that a bake is for; it needs no camera. Of a viewport: what is `known` (sync.py) is not read again, and
    only what the 3D viewport `view` shows is taken.
    """
    scene, view_layer = depsgraph.scene_eval, depsgraph.view_layer_eval
    width, height = size or frame_size(scene.render)
    warnings, out = Warnings(), Scene()
    if (lightmap or not needs_camera) and not scene.camera:
        out.camera = Camera("none", "ORTHO", np.eye(4, dtype=np.float32))
    else:
        out.camera = export_active_camera(engine, depsgraph, width, height, warnings)
    out.film = export_film(scene, view_layer, resolve(scene, view_layer), (width, height))
    walked = Walked(collect(depsgraph, of_objects := Warnings(), view))
    shaders = Shaders(out, depsgraph, warnings, known)
    export_luminaires(out, depsgraph, walked.found.lights, shaders, warnings)
    if view_layer.use_solid:
        export_objects(out, walked, depsgraph, shaders, of_objects, {lightmap} - {""}, known and known.meshes)
    walked.warnings = of_objects.messages()
    if scene.render.use_motion_blur:
        warnings.add("motion blur is not supported yet; rendered without")
    release_scratch()
    settings = export_settings(scene, view_layer, descriptors, integrator)
    messages = walked.warnings + [text for text in warnings.messages() if text not in walked.warnings]
    exported = Exported(out, settings, messages, walked if known else None)
    return finish(exported, depsgraph, descriptors)


def finish(exported: Exported, depsgraph, descriptors: list[dict]) -> Exported:
    """What settings and materials together are to be warned of."""
    chosen = next((d for d in descriptors if d["id"] == exported.settings.integrator), None)
    warnings = Warnings()
    if chosen:
        warn_of_needs(exported.scene, chosen, warnings)
        for text in unheeded(depsgraph.scene_eval, chosen):
            warnings.add(text)
    exported.warnings += warnings.messages()
    approximations.note(exported.scene.programs)
    return exported


def export_luminaires(out: Scene, depsgraph, lights: list[tuple], shaders: Shaders, warnings: Warnings) -> None:
    """The world and the lamps."""
    scene, view_layer = depsgraph.scene_eval, depsgraph.view_layer_eval
    world = (getattr(view_layer, "world_override", None) or scene.world) if view_layer.use_sky else None
    out.world = export_world(world, shaders.world(world) if world else -1)
    export_lights(out, lights, shaders, warnings)


def warn_of_needs(out: Scene, chosen: dict, warnings: Warnings) -> None:
    """One warning for each thing that materials have and the integrator does not carry."""
    for program in out.programs:
        for need in program.needs:
            if need not in chosen["carries"]:
                warnings.add(f"{chosen['label']} {WITHOUT[need]}", program.name)
    if "strands" not in chosen["carries"]:
        for name in dict.fromkeys(i.name for i in out.instances if isinstance(out.meshes[i.mesh], Strands)):
            warnings.add(f"{chosen['label']} {WITHOUT['strands']}", name)


def export_active_camera(engine, depsgraph, width: int, height: int, warnings: Warnings):
    scene = depsgraph.scene_eval
    camera = (engine.camera_override if engine else None) or scene.camera
    if camera is None:
        raise ExportError(f'scene "{scene.name}" has no camera')
    try:
        return export_camera(engine, camera.evaluated_get(depsgraph), scene.render, width, height, warnings)
    except ValueError as error:
        raise ExportError(str(error)) from error


def export_lights(out: Scene, lights: list[tuple], shaders: Shaders, warnings: Warnings) -> None:
    for name, light, matrix, visibility, *_ in lights:
        lamp = export_light(name, light, matrix, visibility, shaders.light(light))
        if lamp:
            out.lights.append(lamp)
            if lamp.kind == "AREA" and 0.0 in lamp.size:
                warnings.add("the area light has no size and gives no light", name)


def export_objects(
    out: Scene, walked: Walked, depsgraph, shaders: Shaders, warnings: Warnings, attributes: set[str], known=None
) -> None:
    found = walked.found
    # Programs first: they say which attributes the meshes have to bring.
    slots = [shaders.slots(prototype.materials) for prototype in found.prototypes]
    wanted = shaders.wanted_attributes() | attributes
    if "UV" in out.film.passes:
        wanted.add("")
    index_of: dict[int, int | None] = {}
    for prototype in found.prototypes:
        key = prototype.mesh.as_pointer()
        if key not in index_of:
            index_of[key] = add_mesh(out, prototype, wanted, warnings, known)
    meshes = [index_of[prototype.mesh.as_pointer()] for prototype in found.prototypes]
    values = [shaders.object_attributes(prototype) for prototype in found.prototypes]
    for value, own in zip(values, read_places(depsgraph, found.prototypes, wanted), strict=True):
        value.update(own)
    walked.instances = place(found, meshes, slots, values, warnings)
    out.instances = [instance for instance in walked.instances if instance]


def add_mesh(out: Scene, prototype, wanted: set[str], warnings: Warnings, known=None) -> int | None:
    mesh = read_mesh(prototype, wanted, known)
    if mesh is None:
        # Instancers and curves without a fill have no faces on purpose.
        if prototype.is_plain:
            warnings.add("its mesh has no faces; left out", prototype.name)
        return None
    out.meshes.append(mesh)
    return len(out.meshes) - 1


def read_mesh(prototype, wanted: set[str], known=None):
    """None where there are no faces, or no strands."""

    def read():
        if prototype.style:
            return export_strands(prototype.mesh, prototype.name, wanted, prototype.style)
        with readable(prototype.object, prototype.mesh, wanted) as mesh:
            return export_mesh(mesh, prototype.name, wanted, prototype.is_deformed)

    return known.read(prototype, wanted, read) if known else read()
