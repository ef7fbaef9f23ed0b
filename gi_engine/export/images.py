"""Pixels of Blender's images as scene_data.Image tiles. What cannot be read becomes one magenta pixel and a warning.

Byte images stay bytes, as the file encodes them; the native side decodes sRGB. Float images are scene-linear already.
"""

from __future__ import annotations

import os
import re
import tempfile
from contextlib import contextmanager

import bpy
import numpy as np

from .. import native
from ..scene_data import Image
from .version import straight_floats_are_associated

MAGENTA = (255, 0, 255, 255)
SCENE_LINEAR = "Linear Rec.709"
DATA = "Non-Color"
TILE_TOKENS = ("<UDIM>", "<UVTILE>")

_scratch = np.empty(0, np.float32)  # reused from image to image: paging in a fresh one takes longer than the copy


def image_key(image, user=None) -> tuple:
    """Equal for nodes that show the same pixels."""
    return (image.as_pointer(), current_frame(image, user)) if image is not None else ()


def read_image(image, warn, user=None) -> list[Image]:
    """The tiles of an image at the frame that `user` (an ImageUser) shows. warn(text) is told what cannot be read."""
    if image is None:
        return [missing("no image")]
    try:
        tiles = read_tiles(image, warn) if image.source == "TILED" else read_frame(image, warn, user)
    except (RuntimeError, OSError, MemoryError) as error:
        warn(f"image '{image.name}' cannot be read ({error}) and shows magenta")
        return [missing(image.name)]
    return tiles


def read_frame(image, warn, user) -> list[Image]:
    if image.source == "SEQUENCE":
        path = sequence_path(absolute(image), current_frame(image, user))
        with temporary_image(image, path) as frame:
            return [read_single(frame, image.name, warn, path)]
    if image.source == "MOVIE" and current_frame(image, user) != 1:
        warn(f"image '{image.name}' is a movie; its first frame is shown")
    return [read_single(image, image.name, warn, absolute(image))]


def read_tiles(image, warn) -> list[Image]:
    """Each tile through a datablock of its own: scripts reach only the first tile of a UDIM image."""
    packed = {tile_number(image, p.filepath): p.data for p in image.packed_files}
    tiles = []
    for tile in image.tiles:
        path = tile_path(absolute(image), tile.number)
        with temporary_image(image, path, packed.get(tile.number)) as single:
            made = read_single(single, image.name, warn, path)
        made.tile = tile.number
        tiles.append(made)
    return tiles


def read_single(image, name: str, warn, path: str) -> Image:
    """One image of one frame. `image` may be None."""
    if image is None or not load(image):
        warn(f"image '{name}' shows magenta: {trouble(image, path)}")
        return missing(name)
    space = image.colorspace_settings.name
    mode = "CHANNEL_PACKED" if space == DATA and image.alpha_mode != "NONE" else image.alpha_mode
    alpha = mode if mode in ("CHANNEL_PACKED", "NONE") else "STRAIGHT"
    if image.is_float:
        pixels = with_four_channels(np.array(pixels_of(image)), image)
        np.nan_to_num(pixels, copy=False, nan=0.0, posinf=0.0, neginf=0.0)
        # What files hold is associated already, which Blender marks as PREMUL; Cycles multiplies what is marked STRAIGHT.
        associated = image.alpha_mode == "PREMUL" or straight_floats_are_associated()
        return Image(name, pixels, alpha="PREMULTIPLIED" if associated and alpha == "STRAIGHT" else alpha)
    encoded = with_four_channels(pixels_of(image), image)
    if space in (DATA, SCENE_LINEAR, "sRGB") and working_space() == SCENE_LINEAR:
        return Image(name, to_bytes(encoded), srgb=space == "sRGB", alpha=alpha)
    return Image(name, to_scene_linear(encoded, space), alpha=alpha)


def load(image) -> bool:
    """Whether the image has pixels; reads the file if need be."""
    return image.size[0] > 0 and image.size[1] > 0 and len(image.pixels) >= image.size[0] * image.size[1]


def trouble(image, path: str) -> str:
    if image is not None and image.packed_file is not None:
        return "the file packed in it is not an image"
    if not path:
        return "it has no file"
    if not os.path.isfile(path):
        return f"there is no file '{path}'"
    return f"the file '{path}' is " + ("empty" if os.path.getsize(path) == 0 else "damaged or of an unknown format")


def missing(name: str) -> Image:
    return Image(name, np.array([[MAGENTA]], np.uint8), alpha="NONE")


# -------------------------------------------------------------------- pixels


def pixels_of(image) -> np.ndarray:
    """(n,) float32 in the scratch buffer, valid until the next call."""
    global _scratch
    count = len(image.pixels)
    if _scratch.size < count:
        _scratch = np.empty(count, np.float32)
    image.pixels.foreach_get(_scratch[:count])
    return _scratch[:count]


def release_scratch() -> None:
    global _scratch
    _scratch = np.empty(0, np.float32)


def with_four_channels(pixels: np.ndarray, image) -> np.ndarray:
    """(H, W, 4), with grey spread over the colours and alpha 1 where the image has none."""
    width, height = image.size
    pixels = pixels.reshape(height, width, -1)
    channels = pixels.shape[2]
    if channels == 4:
        return pixels
    out = np.ones((height, width, 4), np.float32)
    out[..., :3] = pixels[..., :3] if channels == 3 else pixels[..., :1]
    if channels == 2:
        out[..., 3] = pixels[..., 1]
    return out


def to_bytes(pixels: np.ndarray) -> np.ndarray:
    out = np.empty(pixels.shape, np.uint8)
    native.module().quantize(np.ascontiguousarray(pixels).reshape(-1), out.reshape(-1))
    return out


def working_space() -> str:
    """The scene-linear space of the file (a choice from Blender 5.0 on)."""
    settings = getattr(bpy.data, "colorspace", None)
    return getattr(settings, "working_space", SCENE_LINEAR) if settings else SCENE_LINEAR


def to_scene_linear(encoded: np.ndarray, space: str) -> np.ndarray:
    """Converts by Blender itself, which does so when it loads a float file of that colour space."""
    height, width = encoded.shape[:2]
    opaque = np.array(encoded, np.float32)
    opaque[..., 3] = 1.0  # or loading would take it for premultiplied
    raw = bpy.data.images.new("GI Engine conversion", width, height, alpha=True, float_buffer=True, is_data=True)
    converted = None
    path = os.path.join(tempfile.mkdtemp(prefix="gi_engine_"), "pixels.exr")
    try:
        raw.pixels.foreach_set(opaque.reshape(-1))
        raw.file_format = "OPEN_EXR"
        raw.filepath_raw = path
        raw.save()
        converted = bpy.data.images.load(path)
        converted.colorspace_settings.name = space
        out = np.empty(opaque.size, np.float32)
        converted.pixels.foreach_get(out)
    finally:
        for image in (raw, converted):
            if image is not None:
                bpy.data.images.remove(image)
        if os.path.exists(path):
            os.remove(path)
        os.rmdir(os.path.dirname(path))
    out = out.reshape(height, width, 4)
    out[..., 3] = encoded[..., 3]
    return out


# -------------------------------------------------------------------- files


def absolute(image) -> str:
    path = image.filepath_raw
    return bpy.path.abspath(path, library=image.library) if path else ""


def current_frame(image, user) -> int:
    """The frame of a sequence or movie that is shown now; 1 for other images."""
    if user is None or image.source not in ("SEQUENCE", "MOVIE"):
        return 1
    frame = bpy.context.scene.frame_current - user.frame_start + 1
    if user.use_cyclic and user.frame_duration:
        frame = (frame - 1) % user.frame_duration + 1
    return max(1, min(frame, user.frame_duration or frame)) + user.frame_offset


def sequence_path(path: str, frame: int) -> str:
    """The last digits of the name are the frame number, padded to as many digits."""
    found = re.search(r"(\d+)(\D*)$", os.path.basename(path))
    if not found:
        return path
    name = os.path.basename(path)
    return os.path.join(
        os.path.dirname(path), name[: found.start(1)] + str(frame).zfill(len(found.group(1))) + found.group(2)
    )


def tile_path(path: str, number: int) -> str:
    index = number - 1001
    return path.replace(TILE_TOKENS[0], str(number)).replace(TILE_TOKENS[1], f"u{index % 10 + 1}_v{index // 10 + 1}")


def tile_number(image, path: str) -> int:
    """Which tile of a UDIM image a packed file is."""
    for tile in image.tiles:
        if os.path.basename(path) == os.path.basename(tile_path(image.filepath_raw, tile.number)):
            return tile.number
    return image.tiles[0].number


@contextmanager
def temporary_image(like, path: str, data: bytes | None = None):
    """Another file seen through the colour space and alpha mode of `like`; None if it cannot be loaded."""
    folder = None
    if data is not None:
        folder = tempfile.mkdtemp(prefix="gi_engine_")
        path = os.path.join(folder, os.path.basename(path) or "image")
        with open(path, "wb") as file:
            file.write(data)
    image = None
    try:
        image = bpy.data.images.load(path)
        image.colorspace_settings.name = like.colorspace_settings.name
        image.alpha_mode = like.alpha_mode
    except RuntimeError:
        image = None
    try:
        yield image
    finally:
        if image is not None:
            bpy.data.images.remove(image)
        if folder:
            os.remove(path)
            os.rmdir(folder)
