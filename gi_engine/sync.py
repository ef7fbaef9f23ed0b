"""A viewport's scene, kept up to date: what Blender says has changed is exported anew, meshes that have not changed are not read again.
Leaves out the camera, which each drawing brings along."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import bpy

from . import native
from .content import digest
from .export import Exported, export
from .export.film import frame_size
from .export.settings import export_settings

# What each kind of ID changes. Of objects, Blender says itself whether their geometry or their place has.
KINDS = (
    (bpy.types.Camera, "camera"),
    (bpy.types.Light, "light"),
    (bpy.types.World, "world"),
    ((bpy.types.Material, bpy.types.NodeTree, bpy.types.Image, bpy.types.Texture), "material"),
    ((bpy.types.Mesh, bpy.types.Curve, bpy.types.MetaBall), "geometry"),
    (bpy.types.Scene, "settings"),
    ((bpy.types.Collection, bpy.types.ViewLayer), "objects"),
)
NOT_IN_THE_SCENE = {"camera", "settings"}


def changes_of(depsgraph) -> set[str]:
    """Kinds of change since the depsgraph was last asked."""
    found = set()
    for update in depsgraph.updates:
        item = update.id
        if isinstance(item, bpy.types.Object):
            found |= changes_of_object(item, update)
        else:
            found.add(next((kind for types, kind in KINDS if isinstance(item, types)), "objects"))
    return found


def changes_of_object(item, update) -> set[str]:
    if item.type == "CAMERA":
        return {"camera"}
    found = {"objects"}  # shown, hidden, its settings
    if update.is_updated_geometry:
        found.add("geometry")
    if update.is_updated_transform:
        found.add("transform")
    return found


@dataclass
class Known:
    """A mesh as it was exported."""

    wanted: frozenset
    deformed: bool
    size: tuple
    owner: int
    mesh: object


class KnownMeshes:
    """Exported meshes, by the evaluated mesh they were read from. Blender may put another mesh where one was, so that one whose object or
    data was evaluated anew is never taken from here."""

    def __init__(self):
        self.known: dict[int, Known] = {}
        self.used: set[int] = set()
        self.changed: set[int] = set()  # session_uid of objects and data
        self.reads = 0

    def begin(self, depsgraph) -> None:
        self.used = set()
        self.changed = {u.id.original.session_uid for u in depsgraph.updates if u.is_updated_geometry}

    def read(self, prototype, wanted: set[str], make):
        mesh, owner = prototype.mesh, prototype.object.original
        data = owner.data.session_uid if owner.data else 0
        key, names = mesh.as_pointer(), frozenset(wanted)
        size = (len(mesh.vertices), len(mesh.polygons), len(mesh.loops), mesh.name)
        found = self.known.get(key)
        wish = Known(names, prototype.is_deformed, size, owner.session_uid, None)
        fresh = {owner.session_uid, data, prototype.parent.original.session_uid} & self.changed
        if (
            not found
            or fresh
            or (found.wanted, found.deformed, found.size, found.owner)
            != (
                wish.wanted,
                wish.deformed,
                wish.size,
                wish.owner,
            )
        ):
            wish.mesh = make()
            self.reads += 1
            found = self.known[key] = wish
        self.used.add(key)
        return found.mesh and dataclasses.replace(found.mesh, name=prototype.name)

    def sweep(self) -> None:
        self.known = {key: found for key, found in self.known.items() if key in self.used}


class Sync:
    """Holds what a viewport shows. `exports` counts whole exports."""

    def __init__(self):
        self.exported: Exported | None = None
        self.meshes = KnownMeshes()
        self.exports = 0
        self._digest = ""
        self._frame: tuple = ()

    def update(self, depsgraph, view=None) -> bool:
        """Takes over what has changed; True where the picture has to begin anew. `view`: the 3D viewport, for local view.

        Raises ExportError."""
        changes = changes_of(depsgraph)
        if self.exported and not changes - {"camera"}:
            return False
        if self.exported and not changes - NOT_IN_THE_SCENE:
            # The scene's own settings come with any change of it, the frame's and the simplification's included.
            before = (self.exported.settings, self._frame)
            if self._frame == frame_of(depsgraph):
                self.exported.settings = self.settings(depsgraph)
                return before[0] != self.exported.settings
        self.meshes.begin(depsgraph)
        size = frame_size(depsgraph.scene_eval.render)
        exported = export(depsgraph, native.integrators(), None, size, known=self.meshes, view=view, needs_camera=False)
        self.meshes.sweep()
        self.exports += 1
        self._frame = frame_of(depsgraph)
        mark = mark_of(exported)
        same = mark == self._digest and self.exported is not None and exported.settings == self.exported.settings
        if mark == self._digest and self.exported:
            exported.scene = self.exported.scene  # what was built of it still stands
        self.exported, self._digest = exported, mark
        return not same

    def settings(self, depsgraph):
        return export_settings(depsgraph.scene_eval, depsgraph.view_layer_eval, native.integrators())


def frame_of(depsgraph) -> tuple:
    """What of a scene's own data changes what is exported."""
    scene = depsgraph.scene_eval
    render = scene.render
    return scene.frame_current, scene.frame_subframe, render.use_simplify, render.simplify_subdivision, str(scene.world)


def mark_of(exported: Exported) -> str:
    """Tells whether two exports hold the same scene; camera and film do not count."""
    scene = exported.scene
    return digest(
        scene.meshes, scene.instances, scene.lights, scene.programs, scene.images, scene.attribute_names, scene.world
    )
