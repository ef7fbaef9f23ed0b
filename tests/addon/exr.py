"""Reading multilayer EXR files that Blender wrote, one part a file (4.5) or one part a pass (5.x)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR


def read(path: Path) -> dict[str, np.ndarray]:
    """ "Layer.Pass" (and ".view" in stereo) -> (height, width, channels), row 0 at the bottom, channels in the order R G B A, X Y Z, U V A."""
    planes: dict[str, dict[str, np.ndarray]] = {}
    with OpenEXR.File(str(path), separate_channels=True) as file:
        for part in file.parts:
            view = part.header.get("view")
            for name, channel in part.channels.items():
                owner, _, letter = name.rpartition(".")
                # Files of one part have the view in the channel's name.
                owner = f"{owner}.{view}" if view else owner
                planes.setdefault(owner, {})[letter] = channel.pixels[::-1]
    return {owner: np.stack([planes[owner][k] for k in order(planes[owner])], -1) for owner in planes}


def order(letters) -> list[str]:
    return sorted(letters, key="RGBXYZUVA".index)
