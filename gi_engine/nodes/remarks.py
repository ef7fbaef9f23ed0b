"""What the user is told of a program: one warning that names the material and all of its nodes that render as something else. No bpy."""

from __future__ import annotations

import re

from ..approximations import heading

AS_CYCLES = "as in Cycles"
NUMBERED = re.compile(r"^\d+_")


class Remarks:
    """About `who`, a material, light or world; warn(message) is Resources'."""

    def __init__(self, who: str, warn, inlined: bool):
        self.who = who
        self.inlined = inlined
        self._warn = warn
        self.approximated: dict[str, str] = {}  # what is rendered as something else, by node

    def say(self, text: str) -> None:
        self._warn(f"{self.who}: {text}")

    def approximate(self, node, text: str) -> None:
        """What is so in Cycles, too, is said at once, by itself."""
        named = f"node '{self.name_of(node)}' ({node.bl_label}): {text}"
        if text.endswith(AS_CYCLES):
            self.say(named)
        else:
            self.approximated.setdefault(self.name_of(node), named)

    def name_of(self, node) -> str:
        """As the user knows the node: inlining puts a number before the names of all but outputs."""
        return NUMBERED.sub("", node.name) if self.inlined else node.name

    def summed_up(self) -> list[str]:
        """All that is approximated, once the warning is given."""
        texts = list(self.approximated.values())
        if texts:
            several = f"{heading(texts)}: " if len(texts) > 1 else ""
            self.say(f"{several}{'; '.join(texts)}")
        return texts
