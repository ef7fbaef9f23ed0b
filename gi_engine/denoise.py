"""Blender's own copy of Open Image Denoise, called directly: takes the noise out of a lightmap. Leaves out pictures, whose
denoiser is the compositor's. No bpy: the caller says where Blender lies."""

from __future__ import annotations

import ctypes
import functools
from pathlib import Path

import numpy as np

NAMES = ("libOpenImageDenoise.so.2*", "OpenImageDenoise.dll", "libOpenImageDenoise*.dylib")
CPU = 1  # OIDN_DEVICE_TYPE_CPU
FLOAT3 = 3  # OIDN_FORMAT_FLOAT3
POINTER, SIZE, TEXT = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_char_p
SIGNATURES = {
    "oidnNewDevice": (POINTER, [ctypes.c_int]),
    "oidnCommitDevice": (None, [POINTER]),
    "oidnReleaseDevice": (None, [POINTER]),
    "oidnNewFilter": (POINTER, [POINTER, TEXT]),
    "oidnSetSharedFilterImage": (None, [POINTER, TEXT, POINTER, ctypes.c_int, SIZE, SIZE, SIZE, SIZE, SIZE]),
    "oidnSetFilterBool": (None, [POINTER, TEXT, ctypes.c_bool]),
    "oidnCommitFilter": (None, [POINTER]),
    "oidnExecuteFilter": (None, [POINTER]),
    "oidnReleaseFilter": (None, [POINTER]),
    "oidnGetDeviceError": (ctypes.c_int, [POINTER, ctypes.POINTER(TEXT)]),
}


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


def denoise_lightmap(pixels: np.ndarray, blender: tuple[str, ...]) -> np.ndarray | None:
    """(height, width, 3) float32, scene-linear, to the same without noise; None where there is no denoiser. `blender`: folders.

    Raises RuntimeError where it fails."""
    oidn = load(blender)
    if oidn is None:
        return None
    color = np.ascontiguousarray(pixels, np.float32)
    output = np.empty_like(color)
    height, width, _ = color.shape
    device = oidn.oidnNewDevice(CPU)
    oidn.oidnCommitDevice(device)
    lightmap = oidn.oidnNewFilter(device, b"RT")  # Blender's copy leaves the weights of RTLightmap out
    for name, array in ((b"color", color), (b"output", output)):
        oidn.oidnSetSharedFilterImage(lightmap, name, array.ctypes.data, FLOAT3, width, height, 0, 0, 0)
    oidn.oidnSetFilterBool(lightmap, b"hdr", True)
    oidn.oidnCommitFilter(lightmap)
    oidn.oidnExecuteFilter(lightmap)
    message = TEXT()
    failed = oidn.oidnGetDeviceError(device, ctypes.byref(message))
    said = (message.value or b"").decode(errors="replace")
    oidn.oidnReleaseFilter(lightmap)
    oidn.oidnReleaseDevice(device)
    if failed:
        raise RuntimeError(f"denoising failed: {said}")
    return output
