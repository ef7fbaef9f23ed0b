"""What a viewport has read of a scene, to be read again only where Blender says that it has changed: meshes, images, programs. Each is
tagged (`begin`), read or found (`read`), and swept (`sweep`). What comes out is what a fresh export has, numbers and all. No bpy."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field

from .sameness import same
from .scene_data import Program


@dataclass
class Changed:
    """What has changed since the last time, by session_uid."""

    geometry: set[int] = field(default_factory=set)  # objects and their data
    shading: set[int] = field(default_factory=set)  # materials, lamps, worlds
    images: set[int] = field(default_factory=set)
    every_program: bool = False  # a group, an image, the frame: whoever uses it


class KnownScene:
    def __init__(self):
        self.meshes, self.images, self.programs = KnownMeshes(), KnownImages(), KnownPrograms()

    def begin(self, changed: Changed, aovs: list) -> None:
        self.meshes.begin(changed.geometry)
        self.images.begin(changed.images)
        self.programs.begin(changed.shading, changed.every_program, aovs)

    def start_over(self) -> None:
        """What an attempt asked for that came to nothing is not in use."""
        for known in (self.meshes, self.images, self.programs):
            known.used = set()

    def sweep(self, meshes: bool = True) -> None:
        for known in (self.meshes, self.images, self.programs)[0 if meshes else 1 :]:
            known.sweep()


class Known:
    """Things by key, of which those not asked for are forgotten."""

    def __init__(self):
        self.known: dict = {}
        self.used: set = set()
        self.reads = 0

    def sweep(self) -> None:
        self.known = {key: found for key, found in self.known.items() if key in self.used}
        self.used = set()


@dataclass
class KnownMesh:
    wanted: frozenset
    deformed: bool
    size: tuple
    owner: int
    mesh: object


class KnownMeshes(Known):
    """Exported meshes, by the evaluated mesh they were read from. Blender may put another mesh where one was, so that one whose object or
    data was evaluated anew is never taken from here."""

    def begin(self, changed: set[int]) -> None:
        self.changed = changed

    def read(self, prototype, wanted: set[str], make):
        mesh, owner = prototype.mesh, prototype.object.original
        data = owner.data.session_uid if owner.data else 0
        key = mesh.as_pointer()
        size = (
            (prototype.style,)
            if prototype.style
            else (len(mesh.vertices), len(mesh.polygons), len(mesh.loops), mesh.name)
        )
        wish = KnownMesh(frozenset(wanted), prototype.is_deformed, size, owner.session_uid, None)
        found = self.known.get(key)
        fresh = {owner.session_uid, data, prototype.parent.original.session_uid} & self.changed
        if not found or fresh or dataclasses.replace(found, mesh=None) != wish:
            wish.mesh = make()
            self.reads += 1
            if found and same(found.mesh, wish.mesh):
                wish.mesh = found.mesh  # what was built of it still stands
            found = self.known[key] = wish
        self.used.add(key)
        if found.mesh and found.mesh.name != prototype.name:
            found.mesh = dataclasses.replace(found.mesh, name=prototype.name)
        return found.mesh


class KnownImages(Known):
    """Tiles by image_key, whose first number is the image's; those of sky models by the model."""

    def begin(self, changed: set[int]) -> None:
        self.known = {key: tiles for key, tiles in self.known.items() if not key or key[0] not in changed}

    def load(self, key, load):
        if key not in self.known:
            self.known[key] = load()
            self.reads += 1
        self.used.add(key)
        return self.known[key]

    def has(self, key) -> bool:
        return key in self.known

    def forget(self, key) -> None:
        self.known.pop(key, None)


@dataclass
class KnownProgram:
    program: Program
    notes: object  # nodes.resources.Notes


class KnownPrograms(Known):
    """Programs by their owner. One serves again where attributes and images have the numbers that it was compiled with."""

    aovs: list | None = None
    look_elsewhere = False  # some depend on more than their own tree: on where an object is, say

    def begin(self, changed: set[int], every: bool, aovs: list) -> None:
        self.look_elsewhere = False
        if every or aovs != self.aovs:
            self.known = {}
        self.aovs = list(aovs)
        for uid in changed:
            self.known.pop(uid, None)

    def read(self, owner, resources, compile_program) -> Program:
        uid = owner.original.session_uid if owner else 0
        found = self.known.get(uid)
        if not found or not resources.serve_again(found.notes):
            notes = resources.begin_notes()
            found = KnownProgram(compile_program(owner), notes)
            self.reads += 1
            if notes.lasting:
                self.known[uid] = found
            else:
                self.known.pop(uid, None)
                self.look_elsewhere = True
        self.used.add(uid)
        return dataclasses.replace(found.program)  # whoever gets it gives numbers to it
