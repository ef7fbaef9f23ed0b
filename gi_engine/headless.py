"""Rendering without a window: opens a file, sets what was asked for, renders a frame into a file.

Leaves out names of files (output.py), arguments and messages (cli.py).
"""

from __future__ import annotations

from pathlib import Path

import bpy

from . import control
from .control import RenderError


def open_file(path: Path, factory_settings: bool) -> None:
    """Opens a .blend in place of whatever is open; no scripts of the file run. Factory settings would disable an
    installed add-on, so inside Blender the user's stay."""
    if factory_settings:
        bpy.ops.wm.read_factory_settings(use_empty=True)
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        raise RenderError(f'"{path}" cannot be opened: {message_of(error)}') from error


def register_once() -> None:
    """Registers the engine where Blender does not know it yet. Before opening a file, whose settings need it."""
    if not hasattr(bpy.types.Scene, "gi_engine"):
        from . import register

        register()


def save_file(path: Path) -> None:
    """Writes what is open as a .blend. Raises RenderError."""
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), copy=True, relative_remap=True)
    except RuntimeError as error:
        raise RenderError(f'"{path}" cannot be written: {message_of(error)}') from error


def message_of(error: RuntimeError) -> str:
    """What Blender's operators say, without their decoration."""
    return str(error).strip().removeprefix("Error: ")


def set_resolution(scene: bpy.types.Scene, width: int, height: int) -> None:
    """Raises ValueError where Blender cannot: it knows 4 to 65536 pixels, and less as a percentage of that."""
    factor = 1 if min(width, height) >= 4 else 4
    if factor * max(width, height) > 65536:
        raise ValueError(f"Blender cannot make pictures of {width}x{height} pixels")
    scene.render.resolution_x, scene.render.resolution_y = factor * width, factor * height
    scene.render.resolution_percentage = 100 // factor


def set_format(scene: bpy.types.Scene, suffix: str) -> None:
    """The scene's own image settings where they make such files, else 8 bit PNG or float EXR with every pass."""
    settings = scene.render.image_settings
    multilayer = suffix == ".exr"
    if hasattr(settings, "media_type"):  # from 5.0 on
        settings.media_type = "MULTI_LAYER_IMAGE" if multilayer else "IMAGE"
    if multilayer:
        settings.file_format = "OPEN_EXR_MULTILAYER"
        settings.color_depth = "32"
    elif settings.file_format != "PNG":
        settings.file_format = "PNG"
        settings.color_mode = "RGBA" if scene.render.film_transparent else "RGB"
        settings.color_depth = "8"


def own_output(scene: bpy.types.Scene, frame: int) -> Path:
    """Where the scene itself would put this frame. Raises RenderError where that is a video."""
    if scene.render.is_movie_format:
        raise RenderError(f'scene "{scene.name}" is set to write a video; name an image with -o')
    return Path(bpy.path.abspath(scene.render.frame_path(frame=frame)))


def render_frame(scene: bpy.types.Scene, frame: int, folder: Path, stem: str) -> None:
    """Renders one frame into `folder` as `stem` and whatever suffix the format has."""
    scene.frame_set(frame)
    scene.render.filepath = escaped(str(folder / stem))
    scene.render.use_file_extension = True
    start_render(scene, write_still=True)


def look_at(scene: bpy.types.Scene) -> None:
    """Goes through a render for control.inspect, leaving no file."""
    scene.render.use_compositing = scene.render.use_sequencer = False
    start_render(scene, write_still=False)


def start_render(scene: bpy.types.Scene, write_still: bool) -> None:
    try:
        bpy.ops.render.render(write_still=write_still, scene=scene.name)
    except RuntimeError as error:
        errors = control.current.errors if control.current else []
        raise RenderError("; ".join(errors) or named(message_of(error), scene)) from error


def named(message: str, scene: bpy.types.Scene) -> str:
    return f'scene "{scene.name}" has no camera' if message == "Cannot render, no camera" else message


def escaped(path: str) -> str:
    """Braces in paths are Blender's templates."""
    return path.replace("{", "{{").replace("}", "}}")


# `blender -c gi_engine …`


def run_in_blender(argv: list[str]) -> int:
    from .cli import run

    return run(argv, in_blender=True)


_commands: list = []


def register() -> None:
    _commands.append(bpy.utils.register_cli_command("gi_engine", run_in_blender))


def unregister() -> None:
    while _commands:
        bpy.utils.unregister_cli_command(_commands.pop())
