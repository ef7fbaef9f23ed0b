"""What programs take from outside their trees: numbers of images and attributes, where objects are, what time it is. No bpy."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..scene_data import Scene
from .attributes import look_up


@dataclass
class Notes:
    """What compiling a program came across: whether and where the program may serve again."""

    warnings: list[str] = field(default_factory=list)
    attributes: dict = field(default_factory=dict)  # name: slot, in the order in which they were asked for
    images: dict = field(default_factory=dict)  # key: index
    lasting: bool = True  # it depends on nothing but its owner's tree, and what that is made of


def agree(asked: dict, known: dict) -> bool:
    """Whether asking in this order, with `known` numbered from 0 on, gives the same numbers."""
    following = len(known)
    for key, number in asked.items():
        if key not in known:
            if number != following:
                return False
            following += 1
        elif known[key] != number:
            return False
    return True


class Resources:
    """Collects the images and attribute names that programs refer to in `scene`, and notes what each program asks for.

    warn(message) is called once for each message; `known_images`: of an earlier export (known.py)."""

    def __init__(self, scene: Scene, depsgraph, warn, known_images=None):
        self.scene = scene
        self.depsgraph = depsgraph
        self._warn = warn
        self._warned: set[str] = set()
        self._images: dict = {}
        self._known_images = known_images
        self.notes = Notes()

    def begin_notes(self) -> Notes:
        self.notes = Notes()
        return self.notes

    def warn(self, message: str) -> None:
        self.notes.warnings.append(message)
        if message not in self._warned:
            self._warned.add(message)
            self._warn(message)

    def attribute(self, name: str) -> int:
        """The slot of a named attribute; "" is the active UV map."""
        if name not in self.scene.attribute_names:
            self.scene.attribute_names.append(name)
        slot = self.scene.attribute_names.index(name)
        self.notes.attributes[name] = slot
        return slot

    def image(self, key, load) -> int:
        """The index of an image texture; load() gives its tiles the first time that `key` is asked for."""
        if key not in self._images:
            self._images[key] = len(self.scene.images)
            self.scene.images.append(self._tiles(key, load))
        self.notes.images[key] = self._images[key]
        return self._images[key]

    def _tiles(self, key, load) -> list:
        if self._known_images is None:
            return load()
        warned = len(self.notes.warnings)
        tiles = self._known_images.load(key, load)
        if len(self.notes.warnings) > warned:  # what could not be read is tried again the next time
            self._known_images.forget(key)
            self.notes.lasting = False
        return tiles

    def serve_again(self, notes: Notes) -> bool:
        """Takes over what a program asked for when it was compiled; False, and nothing, where that would have other numbers now."""
        attributes = {name: slot for slot, name in enumerate(self.scene.attribute_names)}
        if not agree(notes.attributes, attributes) or not agree(notes.images, self._images):
            return False
        if not all(key in self._images or self._known_images.has(key) for key in notes.images):
            return False
        self.begin_notes()  # what follows is not for those of the program that was compiled last
        for name in notes.attributes:
            self.attribute(name)
        for key in notes.images:
            self.image(key, None)
        for message in notes.warnings:
            self.warn(message)
        return True

    # ---------------------------------------------------------------- what may change without the tree

    def matrix_of(self, owner):
        """The object to world matrix of an object that a node refers to."""
        self.notes.lasting = False
        return owner.evaluated_get(self.depsgraph).matrix_world

    def view_layer_attribute(self, name: str) -> tuple:
        """A property of the view layer, the scene or the world as four numbers; zeros where there is none."""
        self.notes.lasting = False
        scene = self.depsgraph.scene_eval
        return look_up((self.depsgraph.view_layer_eval, scene, scene.world), name) or (0.0, 0.0, 0.0, 0.0)

    def scene_time(self) -> tuple[float, float]:
        """Seconds and frames."""
        self.notes.lasting = False
        scene = self.depsgraph.scene_eval
        frame = scene.frame_current + scene.frame_subframe
        return frame * scene.render.fps_base / scene.render.fps, frame
