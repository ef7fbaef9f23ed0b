"""Blender's own copy of Open Image Denoise, called directly: takes the noise out of pictures and lightmaps, on the processor.
No bpy: the caller says where Blender lies."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np

NAMES = ("libOpenImageDenoise.so.2*", "OpenImageDenoise.dll", "libOpenImageDenoise*.dylib")
CPU = 1  # OIDN_DEVICE_TYPE_CPU
FLOAT3 = 3  # OIDN_FORMAT_FLOAT3
CANCELLED = 6  # OIDN_ERROR_CANCELLED
POINTER, SIZE, TEXT = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
MONITOR = ctypes.CFUNCTYPE(ctypes.c_bool, POINTER, ctypes.c_double)  # false: stop
SIGNATURES = {
    "oidnNewDevice": (POINTER, [ctypes.c_int]),
    "oidnCommitDevice": (None, [POINTER]),
    "oidnReleaseDevice": (None, [POINTER]),
    "oidnNewFilter": (POINTER, [POINTER, TEXT]),
    "oidnSetSharedFilterImage": (None, [POINTER, TEXT, POINTER, ctypes.c_int, SIZE, SIZE, SIZE, SIZE, SIZE]),
    "oidnSetFilterBool": (None, [POINTER, TEXT, ctypes.c_bool]),
    "oidnSetFilterInt": (None, [POINTER, TEXT, ctypes.c_int]),
    "oidnSetFilterProgressMonitorFunction": (None, [POINTER, MONITOR, POINTER]),
    "oidnCommitFilter": (None, [POINTER]),
    "oidnExecuteFilter": (None, [POINTER]),
    "oidnReleaseFilter": (None, [POINTER]),
    "oidnGetDeviceError": (ctypes.c_int, [POINTER, ctypes.POINTER(TEXT)]),
}


class Stopped(RuntimeError):
    """Somebody has asked for the end."""


@functools.cache
def load(blender: tuple[str, ...]):
    """The library beneath one of the folders; None where there is none that works."""
    folders = [Path(root) / name for root in blender for name in ("lib", "blender.shared", "../Resources/lib", ".")]
    for file in (file for folder in folders for name in NAMES for file in sorted(folder.glob(name))):
        try:
            loaded = ctypes.CDLL(str(file))
            for name, (result, arguments) in SIGNATURES.items():
                function = getattr(loaded, name)
                function.restype, function.argtypes = result, arguments
        except (OSError, AttributeError):
            continue
        return loaded
    return None


QUALITIES = {"HIGH": 6, "BALANCED": 5, "FAST": 4}  # OIDN_QUALITY_*


def denoise_lightmap(pixels: np.ndarray, blender: tuple[str, ...]) -> np.ndarray | None:
    """(height, width, 3) float32, scene-linear, to the same without noise; None where there is no denoiser. `blender`: folders.

    Raises RuntimeError where it fails."""
    return denoise(pixels, {}, blender)


def denoise(
    pixels: np.ndarray,
    guides: dict[str, np.ndarray],
    blender: tuple[str, ...],
    quality: str = "HIGH",
    prefilter: str = "NONE",
    stopped: Callable[[], bool] = lambda: False,
) -> np.ndarray | None:
    """(height, width, 3 or 4) float32, scene-linear, to the same without noise; alpha stays. None where there is no denoiser.

    `guides`: "albedo" and "normal", (height, width, 3), or fewer; `quality`, `prefilter`: as Cycles names them; with ACCURATE the
    guides themselves are denoised first, with FAST they are taken for clean. `blender`: folders. `stopped` is asked now and then, from any thread.
    Raises RuntimeError; Stopped where that said yes."""
    oidn = load(blender)
    if oidn is None:
        return None
    images = {name: np.ascontiguousarray(image[..., :3], np.float32) for name, image in guides.items()}
    device = oidn.oidnNewDevice(CPU)
    oidn.oidnCommitDevice(device)
    try:
        if prefilter == "ACCURATE":
            images = {name: run(oidn, device, {name: image}, {}, stopped=stopped) for name, image in images.items()}
        options = {"hdr": True, "cleanAux": bool(images) and prefilter != "NONE"}
        color = np.ascontiguousarray(pixels[..., :3], np.float32)
        clean = run(oidn, device, {"color": color} | images, options, QUALITIES[quality], stopped)
    finally:
        oidn.oidnReleaseDevice(device)
    return np.concatenate([clean, pixels[..., 3:]], axis=-1) if pixels.shape[-1] > 3 else clean


def run(
    oidn,
    device,
    images: dict,
    options: dict,
    quality: int = QUALITIES["HIGH"],
    stopped: Callable[[], bool] = lambda: False,
) -> np.ndarray:
    """One filter over images of one size; the first says what is denoised."""
    output = np.empty_like(next(iter(images.values())))
    height, width, _ = output.shape
    # Of the filter for lightmaps Blender's copy leaves the weights out.
    made = oidn.oidnNewFilter(device, b"RT")
    for name, array in (images | {"output": output}).items():
        oidn.oidnSetSharedFilterImage(made, name.encode(), array.ctypes.data, FLOAT3, width, height, 0, 0, 0)
    for name, value in options.items():
        oidn.oidnSetFilterBool(made, name.encode(), value)
    oidn.oidnSetFilterInt(made, b"quality", quality)
    goes_on = MONITOR(lambda _, progress: not stopped())  # held while the filter may call it
    oidn.oidnSetFilterProgressMonitorFunction(made, goes_on, None)
    oidn.oidnCommitFilter(made)
    oidn.oidnExecuteFilter(made)
    message = TEXT()
    failed = oidn.oidnGetDeviceError(device, ctypes.byref(message))
    said = (message.value or b"").decode(errors="replace")
    oidn.oidnReleaseFilter(made)
    if failed == CANCELLED:
        raise Stopped("denoising was stopped")
    if failed:
        raise RuntimeError(f"denoising failed: {said}")
    return output
