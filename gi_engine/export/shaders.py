"""Materials, lamps and the world to programs, each compiled once; and what those programs ask of objects."""

from __future__ import annotations

import bpy

from ..nodes.attributes import look_up, property_paths
from ..nodes.compile import Compiler
from ..scene_data import Scene
from .warnings import Warnings


class Shaders:
    """Hands out indices into scene.programs. `known` programs (known.py) are not compiled again."""

    def __init__(self, scene: Scene, depsgraph, warnings: Warnings, known=None):
        self.scene = scene
        self.known = known
        images = known.images if known else None
        self.compiler = Compiler(scene, depsgraph, warnings.add, bpy.app.version >= (5, 0, 0), images)
        self.index_of: dict[int, int] = {}

    def slots(self, materials: list) -> list[int]:
        """Programs of an object's material slots; empty ones get the default material."""
        return [self.material(material) for material in materials]

    def material(self, material) -> int:
        return self.filled(self.once(material, self.compiler.material))

    def filled(self, index: int) -> int:
        """`index` of a program whose volume has its own index, too."""
        program = self.scene.programs[index]
        if program.volume_program is not None:
            program.volume = len(self.scene.programs)
            self.scene.programs.append(program.volume_program)
            program.volume_program = None
        if program.displacement_program is not None:
            program.displacement = len(self.scene.programs)
            self.scene.programs.append(program.displacement_program)
            program.displacement_program = None
        return index

    def light(self, light) -> int:
        """-1 where the lamp has no nodes of its own."""
        return self.once(light, self.compiler.light) if has_nodes(light) else -1

    def world(self, world) -> int:
        return self.filled(self.once(world, self.compiler.world))

    def once(self, owner, compile_program) -> int:
        key = owner.as_pointer() if owner else 0
        if key not in self.index_of:
            self.index_of[key] = len(self.scene.programs)
            self.scene.programs.append(self.program(owner, compile_program))
        return self.index_of[key]

    def program(self, owner, compile_program):
        if self.known is None:
            return compile_program(owner)
        return self.known.programs.read(owner, self.compiler.resources, compile_program)

    def wanted_attributes(self) -> set[str]:
        """Names of what programs read of meshes, and of objects (nodes/attributes.py)."""
        return set(self.scene.attribute_names)

    def object_attributes(self, prototype) -> dict[str, tuple]:
        """What programs read of an object or its instancer, as far as they have it."""
        own = (prototype.object, prototype.mesh)
        owners = {"OBJECT": own, "INSTANCER": (prototype.parent, *own)}
        values = {}
        for kind, candidates in owners.items():
            for name, path in property_paths(self.scene.attribute_names, kind).items():
                value = look_up(candidates, path)
                if value:
                    values[name] = value
        return values


def has_nodes(owner) -> bool:
    """From 5.0 on, every material, lamp and world has its nodes in use."""
    return owner.node_tree is not None and (bpy.app.version >= (5, 0, 0) or owner.use_nodes)
