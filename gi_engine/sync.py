"""A viewport's scene, kept up to date in two phases: what Blender says has changed is tagged, then just that is read anew; what is gone is
swept. Leaves out the camera, which each drawing brings along."""

from __future__ import annotations

import dataclasses
from collections import Counter
from dataclasses import dataclass

import bpy
import numpy as np

from . import native
from .export import Exported, export, export_luminaires, finish, read_mesh
from .export.film import export_film, frame_size
from .export.images import release_scratch
from .export.objects import Walk, usable
from .export.settings import export_settings, resolve
from .export.shaders import Shaders
from .export.strands import curve_style
from .export.warnings import Warnings
from .known import Changed, KnownScene
from .sameness import same_scene
from .scene_data import Scene

# What each kind of ID changes; all others, what objects there are.
KINDS = (
    (bpy.types.Camera, "camera"),
    (bpy.types.Light, "light"),
    (bpy.types.World, "world"),
    ((bpy.types.Material, bpy.types.NodeTree, bpy.types.Image, bpy.types.Texture), "material"),
    ((bpy.types.Mesh, bpy.types.Key), "mesh"),
    (bpy.types.Scene, "settings"),
    ((bpy.types.Collection, bpy.types.ViewLayer), "objects"),
)
OWNERS = (bpy.types.Material, bpy.types.Light, bpy.types.World)  # of programs
# What is read without going through all objects.
ONE_BY_ONE = {"light", "lamp", "material", "world", "camera", "settings", "object", "mesh"}


def kind_of(update) -> set[str]:
    item = update.id
    if not isinstance(item, bpy.types.Object):
        return {next((kind for types, kind in KINDS if isinstance(item, types)), "objects")}
    if item.type == "CAMERA":
        return {"camera"}
    if item.type == "LIGHT":
        return {"lamp"}
    return {"object" if item.type == "MESH" else "objects"}


def changes_of(depsgraph) -> set[str]:
    """Kinds of change since the depsgraph was last asked."""
    return set().union(*(kind_of(update) for update in depsgraph.updates))


def tag(depsgraph, frame_is_new: bool) -> Changed:
    """Which parts of what is known hold no more."""
    changed = Changed(every_program=frame_is_new)
    owners = trees = False
    for update in depsgraph.updates:
        item, uid = update.id, update.id.original.session_uid
        if update.is_updated_geometry:
            changed.geometry.add(uid)
        if isinstance(item, OWNERS):
            changed.shading.add(uid)
            owners = True
        elif isinstance(item, bpy.types.NodeTree):
            trees = True
            changed.every_program |= not item.original.is_embedded_data  # a group's users are not always named
        elif isinstance(item, bpy.types.Image):
            changed.images.add(uid)
            changed.every_program = True
        elif not isinstance(item, bpy.types.Object | bpy.types.Mesh | bpy.types.Camera):
            changed.every_program |= isinstance(item, bpy.types.Texture | bpy.types.Text)
    changed.every_program |= trees and not owners
    return changed


@dataclass
class Objects:
    """What going through the objects gave, without anything that Blender may take away."""

    own: dict[
        int, int
    ]  # prototype of each object that is its own only instance, by session_uid; empty where there are duplicates
    looks: list[tuple]  # by prototype: what but matrix and mesh goes into its instance
    materials: list[list[int]]  # by prototype and slot: session_uid, 0 for none
    instances: list  # by prototype
    lights: list[tuple]  # name, session_uid of the lamp, matrix, visibility, session_uid of the object or 0
    warnings: list[str]
    order: list[int]


class Sync:
    """Holds what a viewport shows. `walks` counts how often all objects were gone through."""

    def __init__(self):
        self.exported: Exported | None = None
        self.known = KnownScene()
        self.walks = 0
        self._objects: Objects | None = None
        self._frame: tuple = ()
        self._local: tuple = ()
        self._shown: frozenset = frozenset()

    def is_stale(self, depsgraph, view=None) -> bool:
        """Whether something has changed that Blender may have said nothing of."""
        if self.exported is None or frame_of(depsgraph) != self._frame or local_of(view) != self._local:
            return True
        return any(self._local) and shown_objects(depsgraph, view) != self._shown

    def update(self, depsgraph, view=None) -> bool:
        """Takes over what has changed; True where the picture has to begin anew. `view`: the 3D viewport, for local view.

        Raises ExportError."""
        changes, frame = changes_of(depsgraph), frame_of(depsgraph)
        before, frame_is_new = self.exported, frame != self._frame
        may_hide = changes & {"settings", "objects"} or self.is_stale(depsgraph, view) or any(self._local)
        shown = shown_objects(depsgraph, view) if may_hide else self._shown
        same_frame = before and not frame_is_new and shown == self._shown
        stands = same_frame and not self.known.programs.look_elsewhere
        self._local, self._shown = local_of(view), shown
        if stands and not changes - {"camera"}:
            return False
        if stands and not changes - {"camera", "settings"}:
            # The scene's own settings come with any change of it.
            old, before.settings = before.settings, self.settings(depsgraph)
            return old != before.settings
        layer = depsgraph.view_layer_eval
        film = export_film(
            depsgraph.scene_eval, layer, resolve(depsgraph.scene_eval, layer), frame_size(depsgraph.scene_eval.render)
        )
        if frame[:2] != self._frame[:2]:
            self.known = KnownScene()  # another depsgraph, which tells of its own
        self.known.begin(tag(depsgraph, frame_is_new), film.aovs)
        shaded = same_frame and not changes - ONE_BY_ONE and self.shade(depsgraph, film)
        exported = shaded or self.walk(depsgraph, view)
        self.known.sweep(meshes=not shaded)
        self._frame = frame
        if before and same_scene(exported.scene, before.scene):
            exported.scene = before.scene  # what was built of it still stands
            self.exported = exported
            return exported.settings != before.settings
        self.exported = exported
        return True

    def walk(self, depsgraph, view) -> Exported:
        """Goes through all objects."""
        self.walks += 1
        self.known.start_over()
        size = frame_size(depsgraph.scene_eval.render)
        found = export(depsgraph, native.integrators(), None, size, known=self.known, view=view, needs_camera=False)
        walked, found.walked = found.walked, None
        prototypes = walked.found.prototypes
        self._objects = Objects(
            {} if any(p.randoms for p in prototypes) else alone(prototypes),
            [look_of(p) for p in prototypes],
            [[uid_of(material) for material in p.materials] for p in walked.found.prototypes],
            walked.instances or [None] * len(walked.found.prototypes),
            [(n, uid_of(light), matrix, seen, uid_of(item)) for n, light, matrix, seen, item in walked.found.lights],
            walked.warnings,
            order_of(depsgraph),
        )
        return found

    def shade(self, depsgraph, film) -> Exported | None:
        """Reads materials, lamps and the world alone; None where that is not enough."""
        old, known = self.exported.scene, self._objects
        if any(isinstance(u.id, bpy.types.Object) for u in depsgraph.updates) and order_of(depsgraph) != known.order:
            return None
        warnings, out = Warnings(), Scene(camera=old.camera, film=film)
        walk = Walk(depsgraph.view_layer_eval, warnings)
        lights = self.lights(depsgraph, walk)
        bent = self.move(depsgraph, walk) if lights is not None else None
        if bent is None:
            return None
        shaders = Shaders(out, depsgraph, warnings, self.known)
        export_luminaires(out, depsgraph, lights, shaders, warnings)
        if depsgraph.view_layer_eval.use_solid:
            materials = evaluated(bpy.data.materials, depsgraph)
            slots = [[shaders.material(materials[uid] if uid else None) for uid in row] for row in known.materials]
            pairs = zip(known.instances, slots, strict=True)
            out.instances = [replaced(instance, row) for instance, row in pairs if instance]
        if out.attribute_names != old.attribute_names:
            return None  # meshes have to bring others
        out.meshes = list(old.meshes)
        for at, prototype in bent:
            mesh = read_mesh(prototype, shaders.wanted_attributes(), self.known.meshes)
            if mesh is None:
                return None
            out.meshes[at] = mesh
        release_scratch()
        settings = self.settings(depsgraph)
        messages = known.warnings + [text for text in warnings.messages() if text not in known.warnings]
        return finish(Exported(out, settings, messages), depsgraph, native.integrators())

    def move(self, depsgraph, walk: Walk) -> list[tuple] | None:
        """Puts objects where they are now. Returns the meshes to be read again, as index and prototype; None where more may have changed
        than an object's place and a mesh that it alone has."""
        known, bent = self._objects, []
        users = Counter(instance.mesh for instance in known.instances if instance)
        for update in depsgraph.updates:
            item = update.id
            if not isinstance(item, bpy.types.Object) or item.type in {"CAMERA", "LIGHT"}:
                continue
            at = known.own.get(uid_of(item))
            instance = None if at is None else known.instances[at]
            if instance is None or instance.attributes or item.is_instancer:
                return None
            prototype = walk.add_prototype(item, item, item, item.data)
            if prototype is None or look_of(prototype) != known.looks[at]:
                return None
            if update.is_updated_geometry:
                if users[instance.mesh] > 1 or item.original.data.users > 1 or not prototype.is_plain:
                    return None  # of an edit mode that ends, too: only then is it the others' mesh again
                bent.append((instance.mesh, prototype))
            matrix = np.array(item.matrix_world, np.float32)
            if not usable(matrix[None])[0]:
                return None
            if not np.array_equal(matrix, instance.matrix):
                known.instances[at] = dataclasses.replace(instance, matrix=matrix)
        return bent

    def lights(self, depsgraph, walk: Walk) -> list[tuple] | None:
        """The lamps as they are now, those that moved where they are now; None where others may have come or gone."""
        moved = {
            u.id.original.session_uid: u.id
            for u in depsgraph.updates
            if isinstance(u.id, bpy.types.Object) and u.id.type == "LIGHT"
        }
        if moved and not all(item for *_, item in self._objects.lights):
            return None  # duplicates may be of those
        lamps = evaluated(bpy.data.lights, depsgraph)
        found = []
        for at, (name, lamp, matrix, seen, item) in enumerate(self._objects.lights):
            if item in moved:
                place = moved.pop(item)
                if place.name != name or place.is_instancer or uid_of(place.data) != lamp:
                    return None
                matrix, seen = np.array(place.matrix_world, np.float32), walk.visibility(place, place)
                self._objects.lights[at] = (name, lamp, matrix, seen, item)
            if lamp not in lamps:
                return None
            found.append((name, lamps[lamp], matrix, seen))
        return None if moved else found

    def settings(self, depsgraph):
        return export_settings(depsgraph.scene_eval, depsgraph.view_layer_eval, native.integrators())


def alone(prototypes) -> dict[int, int]:
    """Of the objects that are one prototype, not a mesh and its hair: which."""
    count = Counter(uid_of(p.object) for p in prototypes)
    return {uid_of(p.object): k for k, p in enumerate(prototypes) if count[uid_of(p.object)] == 1}


def look_of(prototype) -> tuple:
    settings = {
        f.name: getattr(prototype, f.name)
        for f in dataclasses.fields(prototype)
        if f.name not in {"mesh", "materials", "object", "parent", "matrices", "randoms"}
    }
    return [uid_of(material) for material in prototype.materials], settings


def order_of(depsgraph) -> list[int]:
    """Objects in the order that Blender goes through them in: parents come early, and nothing tells of another order."""
    return [uid_of(item) for item in depsgraph.objects]


def uid_of(item) -> int:
    return item.original.session_uid if item else 0


def evaluated(items, depsgraph) -> dict:
    return {item.session_uid: item.evaluated_get(depsgraph) for item in items}


def replaced(instance, materials: list[int]):
    return instance if instance.materials == materials else dataclasses.replace(instance, materials=materials)


def local_of(view) -> tuple:
    """Whether a 3D viewport shows objects of its own choice."""
    return (view.local_view is not None, view.use_local_collections) if view else ()


def shown_objects(depsgraph, view) -> frozenset:
    """Objects that are not hidden, in the viewport: where they come or go, Blender tells of a changed scene, of no object."""
    layer = depsgraph.view_layer
    return frozenset(uid_of(o) for o in depsgraph.objects if o.original.visible_get(view_layer=layer, viewport=view))


def frame_of(depsgraph) -> tuple:
    """What of a scene's and a view layer's own data changes what is exported: Blender says no more than that something of them has."""
    scene, layer = depsgraph.scene_eval, depsgraph.view_layer_eval
    render = scene.render
    overrides = uid_of(layer.material_override), uid_of(getattr(layer, "world_override", None)), uid_of(scene.world)
    frame = scene.frame_current, scene.frame_subframe, render.use_simplify, render.simplify_subdivision
    shown = layer.use_sky, layer.use_solid, layer.use_strand
    return (uid_of(scene), layer.name, *frame, *overrides, *shown, curve_style(scene, True))
