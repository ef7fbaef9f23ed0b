"""Pixels of Blender's images as scene_data.Image tiles. What cannot be read becomes one magenta pixel and a warning.

Byte images stay bytes, as the file encodes them; the native side decodes sRGB. Float images are scene-linear already.
"""

from __future__ import annotations

import io
import os
import re
import tempfile
from contextlib import contextmanager

import bpy
import imbuf
import numpy as np

from .. import native
from ..scene_data import Image
from .version import divided_bytes_are_associated, straight_floats_are_associated

MAGENTA = (255, 0, 255, 255)
SCENE_LINEAR = "Linear Rec.709"
DATA = "Non-Color"
DECODES_FILES = hasattr(imbuf.types.ImBuf, "with_buffer")  # from Blender 5.2 on
BYTE_FILES = {"PNG", "JPEG", "TGA", "BMP", "WEBP", "IRIS"}  # and PNG only up to 8 bits a channel
PNG_MAGIC, PNG_DEPTH_AT = b"\x89PNG", 24
HEAD_BYTES = 64  # enough to tell the format
TILE_TOKENS = ("<UDIM>", "<UVTILE>")

# What could not be read, by path, and as it was then. Trying again makes datablocks, of which Blender tells the viewport, which reads again …
_hopeless: dict[str, tuple] = {}
_scratch = np.empty(0, np.float32)  # reused from image to image: paging in a fresh one takes longer than the copy


def image_key(image, user=None) -> tuple:
    """Equal for nodes that show the same pixels, as long as nobody paints on them."""
    if image is None:
        return ()
    settings = (image.source, image.filepath_raw, image.alpha_mode, image.colorspace_settings.name, image.is_dirty)
    return (image.original.session_uid, current_frame(image, user), *settings)


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
        return [read_file(image, sequence_path(absolute(image), current_frame(image, user)), None, warn)]
    path = absolute(image)
    if image.source == "MOVIE":
        return [read_movie(image, current_frame(image, user), warn, path)]
    if image.source == "FILE" and not image.is_dirty and not (image.packed_file and is_premultiplied(image)):
        pixels = bytes_of_file(path, image.packed_file.data if image.packed_file else None)
        if pixels is not None:
            return [from_file_bytes(image, pixels)]
    return [read_datablock(image, image.name, warn, path)]


def read_movie(image, frame: int, warn, path: str) -> Image:
    """Scripts see the frame that was last looked at, whoever did: here a texture does."""
    stays = image.has_data
    if not stays and is_hopeless(path):
        return shown_missing(image, image.name, warn, path)
    try:
        texture = bpy.data.textures.new("frame of a movie", "IMAGE")
    except (RuntimeError, AttributeError):  # where Blender lets nothing be made
        warn(f"image '{image.name}' is a movie; the frame that Blender has shown last is shown")
        return read_datablock(image, image.name, warn, path)
    try:
        texture.image = image.original
        texture.image_user.frame_current = frame
        texture.evaluate((0.0, 0.0, 0.0))
        return read_datablock(image, image.name, warn, path)
    finally:
        bpy.data.textures.remove(texture)
        if not stays:
            image.buffers_free()


def read_tiles(image, warn) -> list[Image]:
    """Each tile through its file: scripts reach only the first tile of a UDIM image."""
    packed = {tile_number(image, p.filepath): p.data for p in image.packed_files}
    tiles = []
    for tile in image.tiles:
        path = tile_path(absolute(image), tile.number)
        tiles.append(read_file(image, path, packed.get(tile.number), warn))
        tiles[-1].tile = tile.number
    return tiles


def read_file(like, path: str, packed: bytes | None, warn) -> Image:
    """A file, or one packed in `like`, seen through the colour space and alpha mode of `like`."""
    pixels = bytes_of_file(path, packed)
    if pixels is not None:
        return from_file_bytes(like, pixels)
    if is_hopeless(path, packed):
        return shown_missing(None, like.name, warn, path, packed)
    with temporary_image(like, path, packed) as image:
        return read_datablock(image, like.name, warn, path, packed)


def read_datablock(image, name: str, warn, path: str, packed: bytes | None = None) -> Image:
    """What Blender has loaded, or loads now and lets go of again. `image` may be None, and of a file or what a user's image has `packed`."""
    stays = image is None or image.has_data
    if image is None or not load(image):
        return shown_missing(image, name, warn, path, packed)
    if image.is_float:
        found = from_floats(image, name)
    else:
        # Blender has divided premultiplied colours by alpha, which Cycles does not undo where it gets them from Blender.
        from_blender = image.is_dirty or image.packed_file or image.source == "GENERATED"
        kept = from_blender and is_premultiplied(image) and divided_bytes_are_associated()
        alpha = "PREMULTIPLIED" if kept else alpha_of(image)
        found = from_bytes(image, name, as_bytes_or_floats(image), alpha)
    if not stays and not image.is_dirty:
        image.buffers_free()
    return found


# -------------------------------------------------------------------- interpreting pixels


def from_floats(image, name: str) -> Image:
    pixels = with_four_channels(pixels_of(image, np.empty(len(image.pixels), np.float32)), image)
    np.nan_to_num(pixels, copy=False, nan=0.0, posinf=0.0, neginf=0.0)
    # What files hold is associated already, which Blender marks as PREMUL; Cycles multiplies what is marked STRAIGHT.
    associated = image.alpha_mode == "PREMUL" or straight_floats_are_associated()
    alpha = alpha_of(image)
    return Image(name, pixels, alpha="PREMULTIPLIED" if associated and alpha == "STRAIGHT" else alpha)


def from_bytes(image, name: str, encoded: np.ndarray, alpha: str) -> Image:
    """`encoded`: (H, W, 4) uint8, or float32 where bytes will not do."""
    space = image.colorspace_settings.name
    if encoded.dtype == np.uint8:
        if stays_encoded(space):
            return Image(name, encoded, srgb=space == "sRGB", alpha=alpha)
        encoded = encoded.astype(np.float32) / 255
    return Image(name, to_scene_linear(encoded, space), alpha=alpha)


def from_file_bytes(image, encoded: np.ndarray) -> Image:
    return from_bytes(image, image.name, encoded, "PREMULTIPLIED" if is_premultiplied(image) else alpha_of(image))


def alpha_of(image) -> str:
    """How alpha is to be taken; both STRAIGHT and PREMUL are "STRAIGHT"."""
    if image.alpha_mode != "NONE" and image.colorspace_settings.name == DATA:
        return "CHANNEL_PACKED"
    return image.alpha_mode if image.alpha_mode in ("CHANNEL_PACKED", "NONE") else "STRAIGHT"


def is_premultiplied(image) -> bool:
    return image.alpha_mode == "PREMUL" and alpha_of(image) == "STRAIGHT"


def stays_encoded(space: str) -> bool:
    return space in (DATA, SCENE_LINEAR, "sRGB") and working_space() == SCENE_LINEAR


def load(image) -> bool:
    """Whether the image has pixels; reads the file if need be."""
    return image.size[0] > 0 and image.size[1] > 0 and len(image.pixels) >= image.size[0] * image.size[1]


def shown_missing(image, name: str, warn, path: str, packed: bytes | None = None) -> Image:
    warn(f"image '{name}' shows magenta: {trouble(image, path)}")
    if packed is not None or image is None or not image.packed_file:  # else the file at that path has no part in it
        _hopeless[path] = stamp(path, packed)
    return missing(name)


def is_hopeless(path: str, packed: bytes | None = None) -> bool:
    """Whether there is no such file, or it is still the one that could not be read; or the same of what is packed."""
    now = stamp(path, packed)
    return not now or _hopeless.get(path) == now


def stamp(path: str, packed: bytes | None = None) -> tuple:
    """By which a file, or what is packed, is known again; empty where there is none."""
    if packed is not None:
        return "packed", len(packed), hash(bytes(packed))
    try:
        found = os.stat(path)
    except OSError:
        return ()
    return found.st_mtime_ns, found.st_size


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


class Decoded:
    """The pixels of an ImBuf as an array without a copy; NumPy keeps this object, and with it the pixels, alive."""

    def __init__(self, decoded):
        self.context = decoded.with_buffer()
        pixels = np.asarray(self.context.__enter__())
        self.__array_interface__ = {
            "version": 3,
            "shape": pixels.shape,
            "typestr": pixels.dtype.str,
            "data": (pixels.ctypes.data, True),
        }


def bytes_of_file(path: str, packed: bytes | None) -> np.ndarray | None:
    """(H, W, 4) uint8 as a file holds it, decoded by Blender but not kept by it.

    None for files of floats, for those that cannot be read and before Blender 5.2; the datablock knows more of them.
    """
    if not DECODES_FILES:
        return None
    try:
        with io.BytesIO(packed) if packed is not None else open(path, "rb") as file:
            data = file.read(HEAD_BYTES)
            if not holds_bytes(data):
                return None
            decoded = imbuf.load_from_buffer(packed if packed is not None else data + file.read())
    except (OSError, ValueError, RuntimeError):
        return None
    pixels = np.asarray(Decoded(decoded))
    return pixels if pixels.dtype == np.uint8 and pixels.ndim == 3 and pixels.shape[2] == 4 else None


def holds_bytes(head: bytes) -> bool:
    kind = imbuf.file_type_from_buffer(head)
    if kind is None or kind.id not in BYTE_FILES:
        return False
    return not head.startswith(PNG_MAGIC) or head[PNG_DEPTH_AT : PNG_DEPTH_AT + 1] <= b"\x08"


def pixels_of(image, out: np.ndarray | None = None) -> np.ndarray:
    """(n,) float32 in `out`, or in the scratch buffer and valid until the next call."""
    global _scratch
    count = len(image.pixels)
    if out is None:
        if _scratch.size < count:
            _scratch = np.empty(count, np.float32)
        out = _scratch[:count]
    image.pixels.foreach_get(out)
    return out


def as_bytes_or_floats(image) -> np.ndarray:
    """Of a byte image; floats where its colour space has to be converted."""
    encoded = with_four_channels(pixels_of(image), image)
    return to_bytes(encoded) if stays_encoded(image.colorspace_settings.name) else encoded


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
