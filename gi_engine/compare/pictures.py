"""Pictures as arrays and files: EXR by OpenEXR, or by Blender itself where that is not there; PNG; colours of heat maps. No scene."""

from __future__ import annotations

import importlib.util
import re
import struct
import zlib
from pathlib import Path

import numpy as np

CHANNELS = "RGBXYZWUVA"  # a file has them by the alphabet
LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)


class PictureError(ValueError):
    """A picture cannot be read; the message names it."""


def reads_passes() -> bool:
    return importlib.util.find_spec("OpenEXR") is not None


def read_exr(path: Path) -> np.ndarray:
    """(height, width, 3) float32 of the combined pass, row 0 at the top. Raises PictureError."""
    if not reads_passes():
        return read_with_blender(path)
    planes = planes_of(path)
    names = {name.lower(): name for name in planes}
    for prefix in ("", *sorted({n.rpartition(".")[0] + "." for n in names if n.endswith("combined.r")})):
        if all(prefix + letter in names for letter in "rgb"):
            return np.stack([planes[names[prefix + letter]] for letter in "rgb"], -1)
    if "y" in names or "v" in names:
        grey = planes[names.get("y") or names["v"]]
        return np.stack([grey] * 3, -1)
    raise PictureError(f'"{path}" has no colours R, G, B; it has: {", ".join(planes)}')


def read_passes(path: Path) -> dict[str, np.ndarray]:
    """Pass → (height, width, channels) float32, of the first view layer, channels as in CHANNELS. Raises PictureError."""
    groups: dict[tuple[str, str], dict] = {}
    for name, pixels in planes_of(path).items():
        found = re.fullmatch(r"(?:(.*)\.)?([^.]+)\.(\w)", name)
        if found:
            groups.setdefault((found[1] or "", found[2]), {})[found[3]] = pixels
    layers = list(dict.fromkeys(layer for layer, _ in groups))
    return {
        name: np.stack([planes[c] for c in sorted(planes, key=CHANNELS.find)], -1)
        for (layer, name), planes in groups.items()
        if layer == layers[0] and name != "Combined"
    }


def planes_of(path: Path) -> dict[str, np.ndarray]:
    import OpenEXR

    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            return {n: c.pixels.astype(np.float32) for part in file.parts for n, c in part.channels.items()}
    except Exception as error:  # OpenEXR raises RuntimeError, ValueError and more
        raise PictureError(
            f'"{path}" is damaged or no EXR: {str(error).splitlines()[0] if str(error) else "unreadable"}'
        ) from error


def read_with_blender(path: Path) -> np.ndarray:
    import bpy

    try:
        image = bpy.data.images.load(str(path.resolve()))
    except RuntimeError as error:
        raise PictureError(f'"{path}" cannot be read: {error}') from error
    try:
        image.colorspace_settings.name = "Non-Color"
        width, height = image.size
        pixels = np.empty(len(image.pixels), np.float32)
        if not len(pixels):
            raise PictureError(f'"{path}" is damaged or has several layers, which need the Python package OpenEXR')
        image.pixels.foreach_get(pixels)
        return pixels.reshape(height, width, -1)[::-1, :, :3].copy()
    finally:
        bpy.data.images.remove(image)


def write_exr(path: Path, pixels: np.ndarray) -> None:
    """`pixels`: (height, width, 3), row 0 at the top."""
    if reads_passes():
        import OpenEXR

        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        with OpenEXR.File(header, {"RGB": np.ascontiguousarray(pixels, np.float32)}) as file:
            file.write(str(path))
        return
    import bpy

    from ..bake import save

    height, width, _ = pixels.shape
    image = bpy.data.images.new("Compare", width, height, float_buffer=True)
    image.pixels.foreach_set(np.dstack([pixels[::-1], np.ones((height, width))]).astype(np.float32).ravel())
    save(image, path)
    bpy.data.images.remove(image)


def png(pixels: np.ndarray) -> bytes:
    """`pixels`: (height, width, 3) of 0 to 1, row 0 at the top."""
    rows = (np.clip(np.nan_to_num(pixels), 0, 1) * 255 + 0.5).astype(np.uint8)
    height, width, _ = rows.shape
    raw = np.hstack([np.zeros((height, 1), np.uint8), rows.reshape(height, -1)]).tobytes()

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b"")


# Colours of maps, scene-referred numbers to what is seen

HEAT = np.array([[0, 0, 4], [59, 15, 112], [140, 41, 129], [222, 73, 104], [254, 159, 109], [252, 253, 191]]) / 255
SIGNED = np.array([[33, 102, 172], [103, 169, 207], [247, 247, 247], [239, 138, 98], [178, 24, 43]]) / 255


def ramp(values: np.ndarray, colors: np.ndarray) -> np.ndarray:
    """`values` of 0 to 1 → colours."""
    at = np.linspace(0, 1, len(colors))
    return np.stack([np.interp(np.clip(np.nan_to_num(values), 0, 1), at, colors[:, c]) for c in range(3)], -1)


def difference_map(image: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Relative differences, black at none; full at 1, by their square root so that small ones are seen."""
    grey = reference @ LUMA
    relative = np.abs(image @ LUMA - grey) / (np.abs(grey) + 0.1 * max(float(grey.mean()), 1e-12))
    return ramp(np.sqrt(relative), HEAT)


def signed_map(relative: np.ndarray, beyond: np.ndarray, block: int, size: tuple[int, int], full: float) -> np.ndarray:
    """Blocks of signed relative error: blue darker, red brighter than the reference, full at `full`; pale within noise."""
    colors = ramp(0.5 + 0.5 * relative / full, SIGNED)
    colors = np.where(beyond[..., None], colors, 0.75 * SIGNED[2] + 0.25 * colors)
    height, width = size
    canvas = np.kron(colors, np.ones((block, block, 1)))[:height, :width]
    return np.pad(canvas, ((0, height - canvas.shape[0]), (0, width - canvas.shape[1]), (0, 0)), mode="edge")
