"""What nodes read of text data-blocks and of files next to the scene."""

from __future__ import annotations

import bpy


def ies_text(node) -> str:
    """The IES data of a node, from its text or from its file; "" where there is none."""
    if node.mode == "INTERNAL":
        return node.ies.as_string() if node.ies else ""
    path = bpy.path.abspath(node.filepath, library=node.id_data.library)
    try:
        with open(path, encoding="utf-8", errors="replace") as file:
            return file.read()
    except OSError:
        return ""
