"""What each place of an instance knows besides its matrix: coordinates on its instancer, and its particle.

Read only where a material asks for it, in a second walk through the depsgraph's instances, in the order of the first."""

from __future__ import annotations

import numpy as np

from .. import native
from ..nodes.attributes import (
    INSTANCER_GENERATED,
    INSTANCER_UV,
    OF_PLACES,
    PARTICLE_PLACE,
    PARTICLE_SPIN,
    PARTICLE_STATE,
    PARTICLE_VELOCITY,
)

NOTHING = (0.0, 0.0, 0.0, 0.0)


def read_places(depsgraph, prototypes: list, wanted: set[str]) -> list[dict]:
    """For each prototype: name -> (places, 4) float32, of those names that are wanted."""
    names = sorted(wanted & OF_PLACES)
    if not names:
        return [{} for _ in prototypes]
    rows: dict[tuple, list] = {key_of(p.mesh, p.object, p.parent): [] for p in prototypes}
    scene = depsgraph.scene_eval
    frame = scene.frame_current + scene.frame_subframe
    for instance in depsgraph.object_instances:
        lasting = instance.instance_object
        if lasting is None or instance.object.data is None:
            continue
        found = rows.get(key_of(instance.object.data, lasting, instance.parent))
        if found is not None:
            found.append([value_of(name, instance, frame) for name in names])
    return [arrays(names, rows[key_of(p.mesh, p.object, p.parent)]) for p in prototypes]


def key_of(mesh, lasting, parent) -> tuple:
    return (mesh.as_pointer(), lasting.as_pointer(), parent.as_pointer())


def arrays(names: list[str], rows: list) -> dict:
    values = np.array(rows or [[NOTHING] * len(names)], np.float32)
    made = {name: values[:, i] for i, name in enumerate(names)}
    if PARTICLE_STATE in made:
        state = made[PARTICLE_STATE]
        state[:, 1] = native.module().random_of_numbers(np.ascontiguousarray(state[:, 0], np.uint32))
    return made


def value_of(name: str, instance, frame: float) -> tuple:
    if name == INSTANCER_GENERATED:
        return (*(0.5 * x - 0.5 for x in instance.orco), 0.0)
    if name == INSTANCER_UV:
        return (*instance.uv, 0.0, 0.0)
    particle, index = particle_of(instance)
    if particle is None:
        return NOTHING
    return {
        PARTICLE_STATE: lambda: (index, 0.0, frame - particle.birth_time, particle.lifetime),
        PARTICLE_PLACE: lambda: (*particle.location, particle.size),
        PARTICLE_VELOCITY: lambda: (*particle.velocity, 0.0),
        PARTICLE_SPIN: lambda: (*particle.angular_velocity, 0.0),
    }[name]()


def particle_of(instance):
    """The particle that an instance shows, and its number; nothing for children, which have no particle of their own."""
    system, index = instance.particle_system, instance.persistent_id[0]
    if system is None or not 0 <= index < len(system.particles):
        return None, 0
    return system.particles[index], float(index)
