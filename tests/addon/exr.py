"""Reading multilayer EXR files that Blender wrote, one part a file (4.5) or one part a pass (5.x)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR


def read(path: Path) -> dict[str, np.ndarray]:
    """"Layer.Pass" -> (height, width, channels), row 0 at the bottom, channels in the order R G B A, X Y Z, U V A."""
    planes: dict[str, dict[str, np.ndarray]] = {}
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            for name, channel in part.channels.items():
                # In files of many parts channels may leave out what the part's name says.
                full = name if name.count(".") >= 2 else f"{part.name()}.{name.split('.')[-1]}"
                owner, _, letter = full.rpartition(".")
                planes.setdefault(owner, {})[letter] = channel.pixels[::-1]
    return {owner: np.stack([planes[owner][k] for k in order(planes[owner])], -1) for owner in planes}


def order(letters) -> list[str]:
    return sorted(letters, key="RGBXYZUVA".index)
