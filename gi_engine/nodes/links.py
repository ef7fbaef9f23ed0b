"""Following links of a node tree: back through reroutes, muted nodes and group borders to where a value comes from. No bpy."""

from __future__ import annotations

from .node_builder import by_identifier
from .remarks import AS_CYCLES, Remarks
from .trees import Context, Source, group_output, is_inlined, kind_of

# What Cycles leaves out of the trees that it makes.
NOT_FOR_CYCLES = {
    "ShaderNodeShaderToRGB": "is for EEVEE alone",
    "ShaderNodeUVAlongStroke": "is for Freestyle alone",
    "ShaderNodeSqueeze": "is from before Blender 2.8",
    "ShaderNodeScript": "needs Open Shading Language",
}


class Links:
    """Of the tree of a material, light or world."""

    def __init__(self, owner, remarks: Remarks):
        self.owner = owner
        self.remarks = remarks

    def resolve(self, context: Context, socket) -> Source:
        """What feeds an input socket."""
        through: list[str] = []
        unlinked = Source(context, None, socket)  # whose own value counts if the way ends here
        while True:
            link = self.live_link(context, socket)
            if link is None:
                return unlinked
            node, output = link.from_node, link.from_socket
            # Inlined, reroutes and muted nodes that nothing is linked to are as if not there.
            stays = is_inlined(self.owner)
            if node.type == "REROUTE":
                socket = node.inputs[0]
            elif node.mute:
                inner = next((i for i in node.internal_links if i.to_socket == output), None)
                if inner is None:
                    return unlinked
                through.append(kind_of(output))
                socket = inner.from_socket
            elif node.type in {"GROUP", "CUSTOM GROUP"}:
                inside = group_output(node)
                if inside is None:
                    self.remarks.say(f"node group '{self.remarks.name_of(node)}' has no output; it gives its default")
                    return unlinked
                through.append(kind_of(output))
                context = Context(node.node_tree, node, context)
                socket, stays = by_identifier(inside.inputs, output.identifier), False
            elif node.type == "GROUP_INPUT":
                if context.parent is None:
                    return unlinked
                through.append(kind_of(output))
                socket, stays = by_identifier(context.group.inputs, output.identifier), False
                context = context.parent
            elif node.bl_idname in NOT_FOR_CYCLES:
                why = NOT_FOR_CYCLES[node.bl_idname]
                self.remarks.approximate(node, f"{why}; it is as if not linked, {AS_CYCLES}")
                return unlinked
            else:
                return Source(context, node, output, tuple(through))
            if not stays:
                unlinked = Source(context, None, socket, tuple(through))

    def live_link(self, context: Context, socket):
        if socket is None or not socket.is_linked:
            return None
        for link in socket.links:
            if link.is_muted or link.is_hidden:
                continue
            if not link.is_valid:
                self.remarks.say(
                    f"the link into '{socket.name}' of node '{self.remarks.name_of(socket.node)}' is part of a cycle or invalid and is left out"
                )
                continue
            return link
        return None
