"""What a render would be: counts of what was exported, and every warning. Rendering's own way up to the first sample,
so that it can say nothing that a render would not. No bpy."""

from __future__ import annotations

from collections import Counter

from .approximations import heading
from .scene_data import Scene, Settings
from .session import Session

CAMERAS = {"PERSP": "perspective", "ORTHO": "orthographic", "PANO": "equirectangular"}


def describe(scene: Scene, settings: Settings) -> list[str]:
    """Lines about one exported view layer. Raises what building the native scene raises (ValueError, …)."""
    lines = [
        f"camera: {named(scene.camera.name)}, {CAMERAS.get(scene.camera.kind, scene.camera.kind)}",
        f"picture: {scene.film.width} x {scene.film.height} pixels{border(scene)}; passes {', '.join([*scene.film.passes, *dict(scene.film.aovs)])}",
        f"integrator: {settings.integrator}, {limits(settings)}",
        f"objects: {counted(sum(i.count for i in scene.instances), 'instance')} of {counted(len(scene.meshes), 'mesh', 'meshes')}",
        triangles(scene),
        f"lights: {lights(scene)}",
        f"materials: {listed(materials(scene))}",
        *approximated(scene),
        f"images: {listed([tiles[0].name for tiles in scene.images if tiles])}",
    ]
    session = Session(scene, settings)
    lines.append(f"memory: {session.progress().get('memory', 0) / 2**20:.0f} MiB for scene and film")
    lines.append(f"Embree: {session.native_scene.embree}")
    return lines + [f"warning: {message}" for message in session.warnings()]


def named(name: str) -> str:
    return f'"{name}"'


def counted(count: int, one: str, many: str = "") -> str:
    return f"{count:,} {one if count == 1 else many or one + 's'}"


def listed(names: list[str]) -> str:
    return f"{len(names)} ({', '.join(named(name) for name in names)})" if names else "none"


def border(scene: Scene) -> str:
    if not scene.film.region:
        return ""
    x0, y0, x1, y1 = scene.film.region
    whole = (x1 - x0, y1 - y0) == (scene.film.width, scene.film.height)
    return "" if whole else f", of which {x1 - x0} x {y1 - y0} are rendered"


def limits(settings: Settings) -> str:
    parts = [counted(settings.samples, "sample")] if settings.samples else []
    parts += [f"{settings.time_limit:g} s"] if settings.time_limit > 0 else []
    parts += [f"noise under {settings.noise_target:g}"] if settings.noise_target > 0 else []
    return " or ".join(parts)


def triangles(scene: Scene) -> str:
    sizes = [getattr(mesh, "triangle_count", 0) for mesh in scene.meshes]
    placed = sum(sizes[instance.mesh] * instance.count for instance in scene.instances)
    return f"triangles: {sum(sizes):,} stored, {placed:,} placed"


def lights(scene: Scene) -> str:
    kinds = Counter(light.kind.lower() for light in scene.lights)
    parts = [f"{count} {kind}" for kind, count in sorted(kinds.items())]
    if scene.world.program >= 0:
        parts.append(f"world {named(scene.programs[scene.world.program].name)}")
    return ", ".join(parts) or "none but what materials emit"


def approximated(scene: Scene) -> list[str]:
    """A line for each material (or lamp, or world) with nodes that are rendered as something else."""
    return [f"{named(p.name)}: {heading(p.approximated)}" for p in scene.programs if p.approximated]


def materials(scene: Scene) -> list[str]:
    used = {program for instance in scene.instances for program in instance.materials}
    return sorted(scene.programs[program].name for program in used if program >= 0)
