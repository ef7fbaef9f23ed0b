"""Lightmaps: light baked onto the UV map of an object by the same integrators that render, then filled beyond its edges, denoised
and kept as a 32-bit image. Leaves out buttons (ui/operators_bake.py) and arguments (cli.py)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from . import control, native
from .denoise import denoise_lightmap
from .export import ExportError, export
from .output import OutputError, Target
from .scene_data import CAMERA, Film, Lightmap
from .session import RenderFailed, Session

FRESH_MAP = "Lightmap"  # the name of a UV map that is made for a bake
USER_ERRORS = (ExportError, RenderFailed, native.NativeMissing)


class BakeError(ValueError):
    """The bake cannot be made; the message names the object, map or file."""


@dataclass
class Request:
    """One lightmap. Sizes are texels."""

    object: str
    uv_map: str = ""  # "" makes a fresh one
    content: str = "IRRADIANCE"
    width: int = 512
    height: int = 512
    margin: int = 8  # texels that are filled beyond the edges of the map's islands
    denoise: bool = True


# ---------------------------------------------------------------- what is there


def find_object(view_layer, name: str):
    """Raises BakeError unless the object can be baked."""
    view_layer.update()  # what was just linked is not there yet
    item = view_layer.objects.get(name)
    if item is None:
        raise BakeError(f'there is no object "{name}" in view layer "{view_layer.name}"')
    if item.type != "MESH":
        raise BakeError(f'object "{name}" is no mesh but a {item.type.lower()}: only meshes have UV maps to bake to')
    if not item.data.polygons:
        raise BakeError(f'object "{name}" has no faces')
    if item.hide_render:
        raise BakeError(f'object "{name}" is disabled in renders')
    return item


def check_map(item, name: str) -> None:
    names = [layer.name for layer in item.data.uv_layers]
    if name and name not in names:
        there = f"it has: {', '.join(names)}" if names else "it has none; leave the map out to have one made"
        raise BakeError(f'object "{item.name}" has no UV map "{name}"; {there}')


def unwrap(item, request: Request, whole_faces: bool) -> str:
    """Makes a UV map without overlaps and returns its name. `whole_faces`: every face apart, where projection overlaps."""
    mesh = item.data
    if mesh.library or item.library:
        raise BakeError(f'object "{item.name}" is linked from another file: it cannot be given a UV map')
    layers = mesh.uv_layers
    layer = layers.get(FRESH_MAP) or layers.new(name=FRESH_MAP, do_init=False)
    if layer is None:
        raise BakeError(f'object "{item.name}" has as many UV maps as Blender allows: remove one, or name one')
    name, active = layer.name, layers.active
    before = active.name if active else name
    layers.active = layer
    gap = (2 * request.margin + 2) / min(request.width, request.height)
    context = bpy.context
    chosen, selected = context.view_layer.objects.active, list(context.selected_objects)
    try:
        for other in selected:
            other.select_set(False)
        context.view_layer.objects.active = item
        item.select_set(True)
        with context.temp_override(
            area=None, region=None
        ):  # from within an image editor only what it has selected is unwrapped
            if whole_faces:
                bpy.ops.uv.lightmap_pack(PREF_CONTEXT="ALL_FACES", PREF_MARGIN_DIV=min(1.0, 10 * gap))
            else:
                project(min(gap, 0.1))
    except RuntimeError as error:
        raise BakeError(f'object "{item.name}" cannot be unwrapped: {str(error).strip()}') from error
    finally:
        item.select_set(False)
        for other in selected:
            other.select_set(True)
        context.view_layer.objects.active = chosen
        layers.active = layers[before]
    return name


def project(gap: float) -> None:
    """Unwraps the active object's faces, by projection from several sides."""
    bpy.ops.object.mode_set(mode="EDIT")
    try:
        bpy.ops.mesh.reveal(select=False)
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.uv.smart_project(island_margin=gap, margin_method="FRACTION", scale_to_bounds=False)
    finally:
        bpy.ops.object.mode_set(mode="OBJECT")


# ---------------------------------------------------------------- baking


def begin(depsgraph, request: Request, integrator: str | None = None) -> tuple[Session, list[str]]:
    """A session that is ready to start, and warnings. Raises RenderFailed, ExportError."""
    found = export(depsgraph, native.integrators(), None, integrator=integrator, lightmap=request.uv_map)
    for instance in found.scene.instances:
        if instance.name == request.object:
            instance.visibility |= CAMERA  # it is looked at, whatever cameras see
    settings = control.apply(found.settings)
    found.scene.film = Film(
        request.width, request.height, filter="BOX", filter_width=1.0, passes=["Combined", "Emission"]
    )
    session = Session(found.scene, settings, Lightmap(request.object, request.uv_map, request.content))
    return session, found.warnings + session.warnings()


def prepare(context, request: Request, integrator: str | None = None) -> tuple[Session, Request, list[str]]:
    """Checks, unwraps where no map is chosen, and builds. The request that comes back names the map."""
    context.scene.update_tag()  # scripts' changes of settings would go unnoticed
    item = find_object(context.view_layer, request.object)
    check_map(item, request.uv_map)
    if request.uv_map:
        session, warnings = begin(context.evaluated_depsgraph_get(), request, integrator)
        return session, request, warnings
    for whole_faces in (False, True):
        named = replace(request, uv_map=unwrap(item, request, whole_faces))
        context.view_layer.update()
        try:
            session, warnings = begin(context.evaluated_depsgraph_get(), named, integrator)
        except RenderFailed as error:
            if whole_faces or "overlaps itself" not in str(error):
                raise
        else:
            return session, named, warnings
    raise AssertionError("unreachable")


def finished(session: Session, request: Request) -> tuple[np.ndarray, list[str]]:
    """(height, width, 4) float32 of a session that has rendered, row 0 at the bottom, and warnings."""
    warnings = []
    light, alpha = fill(session.read("Combined")[..., :3], session.native.coverage() > 0, request.margin)
    if request.denoise:
        # The denoiser looks at neighbours: what no texel ever was beside must not look like darkness.
        everywhere, _ = fill(light, alpha, max(request.width, request.height))
        clean = denoise_lightmap(everywhere, blender_folders())
        if clean is None:
            warnings.append("this Blender brings no denoiser: the lightmap stays as it is")
        else:
            light = np.where(alpha[..., None], np.maximum(clean, 0), 0)
    return np.concatenate([light, alpha[..., None].astype(np.float32)], -1), warnings


def blender_folders() -> tuple[str, ...]:
    """Where Blender's libraries may be: beside the program; as a module, some levels above its Python scripts."""
    program = [Path(bpy.app.binary_path).resolve().parent] if bpy.app.binary_path else []
    return tuple(map(str, [*program, *list(Path(bpy.__file__).resolve().parents)[:5]]))


def fill(light: np.ndarray, known: np.ndarray, margin: int) -> tuple[np.ndarray, np.ndarray]:
    """Grows the known texels by up to `margin`, each new one the mean of its known neighbours."""
    light, known = np.where(known[..., None], light, 0).astype(np.float32), known.copy()
    for _ in range(margin):
        if known.all():
            break
        padded = np.pad(np.concatenate([light, known[..., None]], -1), ((1, 1), (1, 1), (0, 0)))
        h, w = known.shape
        total = sum(padded[y : y + h, x : x + w] for y in range(3) for x in range(3))
        new = ~known & (total[..., 3] > 0)
        light[new] = total[new][:, :3] / total[new][:, 3:]
        known |= new
    return light, known


# ---------------------------------------------------------------- keeping


def store(name: str, pixels: np.ndarray, path: Path | None):
    """The 32-bit Blender image of that name, made where there is none; also an EXR where `path` is given. Raises OutputError."""
    height, width, _ = pixels.shape
    # Always a new one in the old one's place: a packed image would go back to what it was.
    image, old = bpy.data.images.new(name, width, height, alpha=True, float_buffer=True), bpy.data.images.get(name)
    if old != image:
        old.user_remap(image)
        bpy.data.images.remove(old)
        image.name = name
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())
    image.update()
    if path is not None:
        with Target(path) as target:
            save(image, target.folder / ("lightmap" + path.suffix))
            target.publish(path, "lightmap")
    image.pack()
    if path is not None:
        image.filepath_raw = str(path)
    return image


def save(image, path: Path) -> None:
    """As an EXR of full floats, by way of a scene of its own: Image.save() would encode a generated image as sRGB."""
    scene = bpy.data.scenes.new("Lightmap")
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # from 5.0 on
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"
    try:
        image.save_render(str(path), scene=scene)
    except RuntimeError as error:
        raise OutputError(f'output "{path}" cannot be written: {str(error).strip()}') from error
    finally:
        bpy.data.scenes.remove(scene)


def bake(context, request: Request, path: Path | None, integrator: str | None = None, stopped=lambda: False):
    """From request to image, waiting. Returns (image, map's name, passes, warnings); image None where it was stopped before a
    pass was finished."""
    session, request, warnings = prepare(context, request, integrator)
    with session:
        while not session.wait():
            if stopped():
                session.native.cancel()
            tell(session.progress())
        progress = session.progress()
        tell(progress)
        if not progress["passes"]:
            return None, request.uv_map, 0, warnings
        pixels, more = finished(session, request)
    image = store(f"{request.object} {FRESH_MAP}", pixels, path)
    return image, request.uv_map, progress["passes"], warnings + more


DIRECT, INDIRECT, COLOR = 64, 128, 256  # of Blender's pass_filter; RE_pipeline's order, checked by a test


def bake_for_blender(depsgraph, item, pass_type: str, pass_filter: int, size: tuple[int, int], stopped):
    """What Blender's own Bake button asks for: (height, width, 4) and warnings. Margin and images are Blender's affair."""
    if pass_type != "DIFFUSE":
        raise BakeError(f"GI Engine bakes the type Diffuse, not {pass_type.title()}")
    uv = item.data.uv_layers.active
    if uv is None:
        raise BakeError(f'object "{item.name}" has no UV map to bake to')
    if pass_filter & COLOR and not pass_filter & (DIRECT | INDIRECT):
        raise BakeError("Diffuse needs Direct or Indirect light: its colour alone is no light")
    if pass_filter & DIRECT and not pass_filter & INDIRECT:
        raise BakeError("Direct light alone cannot be baked: choose Indirect too, or alone")
    colored, indirect = bool(pass_filter & COLOR), not pass_filter & DIRECT
    if colored and indirect:
        raise BakeError("Indirect light alone is baked without Color: switch Direct on, or Color off")
    content = "RADIOSITY" if colored else "INDIRECT" if indirect else "IRRADIANCE"
    request = Request(item.name, uv.name, content, *size, margin=0, denoise=False)
    session, warnings = begin(depsgraph, request)
    with session:
        while not session.wait():
            if stopped():
                session.native.cancel()
            tell(session.progress())
        light = session.read("Combined")
        if content == "RADIOSITY":  # Blender's Diffuse leaves out what the surface emits
            light[..., :3] -= session.read("Emission")
    return light, warnings


def tell(progress: dict) -> None:
    control.report(
        control.Progress(
            stage="Render",
            fraction=progress["fraction"],
            passes=progress["passes"],
            rays=progress["rays"],
            seconds=progress["seconds"],
            seconds_left=progress["remaining"] if np.isfinite(progress["remaining"]) else None,
            noise=progress["noise"] if np.isfinite(progress["noise"]) else None,
        )
    )
