"""Baking lightmaps: the settings' panel in the render tab and its button, which bakes in the background and can be stopped."""

from __future__ import annotations

from pathlib import Path

import bpy

from .. import bake, native
from ..output import OutputError
from .panel import RenderPanel, columns

ERRORS = (bake.BakeError, OutputError, *bake.USER_ERRORS)
INTERVAL = 0.1  # seconds between two looks at how far it is


def requests(context) -> dict[str, bake.Request]:
    """By name, of the selected meshes."""
    s = context.scene.gi_engine.lightmap
    return {
        item.name: bake.Request(item.name, s.uv_map, s.content, s.width, s.height, s.margin, s.denoise)
        for item in context.selected_objects
        if item.type == "MESH"
    }


def path_of(context, name: str) -> Path | None:
    """The EXR of an object; None where images stay inside the .blend file. Raises BakeError."""
    folder = context.scene.gi_engine.lightmap.folder
    if not folder:
        return None
    if folder.startswith("//") and not bpy.data.filepath:
        raise bake.BakeError(f'"{folder}" is beside the .blend file, which was never saved')
    return Path(bpy.path.abspath(folder)) / (bpy.path.clean_name(f"{name} {bake.FRESH_MAP}") + ".exr")


class GI_OT_bake_lightmap(bpy.types.Operator):
    """Bake the light on the selected meshes into an image each, by the chosen integrator and its settings"""

    bl_idname = "gi_engine.bake_lightmap"
    bl_label = "Bake Lightmap"
    bl_options = {"REGISTER", "UNDO"}
    running = False  # one at a time

    @classmethod
    def poll(cls, context):
        if cls.running:
            cls.poll_message_set("A lightmap is being baked; Esc stops that")
            return False
        if context.mode != "OBJECT":
            cls.poll_message_set("Only in Object Mode")
            return False
        if not any(item.type == "MESH" for item in context.selected_objects):
            cls.poll_message_set("No mesh is selected")
            return False
        return True

    def execute(self, context):
        """Waits: for scripts."""
        try:
            for name, request in self.begin(context).items():
                image, _, passes, warnings = bake.bake(context, request, path_of(context, name))
                self.tell(f'"{image.name}": {passes} passes', warnings)
        except ERRORS as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def invoke(self, context, event):
        try:
            self.left = list(self.begin(context).values())
            self.session = None
            self.next(context)
        except ERRORS as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.timer = context.window_manager.event_timer_add(INTERVAL, window=context.window)
        context.window_manager.modal_handler_add(self)
        type(self).running = True
        return {"RUNNING_MODAL"}

    def begin(self, context) -> dict[str, bake.Request]:
        """Whatever can be wrong with any of them, before the first. Raises one of ERRORS."""
        wanted = requests(context)
        for name, request in wanted.items():
            bake.check_map(bake.find_object(context.view_layer, name), request.uv_map)
            path = path_of(context, name)
            if path is not None:
                with bake.Target(path):
                    pass
        return wanted

    def next(self, context) -> None:
        wanted = self.left.pop(0)
        layers = bpy.data.objects[wanted.object].data.uv_layers
        before = set(layers.keys())
        self.session, self.request, warnings = bake.prepare(context, wanted)
        self.made_map = self.request.uv_map not in before
        self.tell("", warnings)
        self.session.__enter__()

    def modal(self, context, event):
        if event.type == "ESC":
            self.cancel(context)
            self.report({"INFO"}, "Baking was cancelled; lightmaps that were finished stay")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            done = self.session.native.wait(0)
            fraction = self.session.progress()["fraction"]
            context.workspace.status_text_set(f'Baking "{self.request.object}": {100 * fraction:.0f} %   (Esc: stop)')
            if not done:
                return {"RUNNING_MODAL"}
            self.session.wait()  # raises where it failed
            pixels, warnings = bake.finished(self.session, self.request)
            image = bake.store(f"{self.request.object} {bake.FRESH_MAP}", pixels, path_of(context, self.request.object))
            self.tell(f'"{image.name}" is baked', warnings)
            self.session.__exit__()
            if self.left:
                self.next(context)
                return {"RUNNING_MODAL"}
        except ERRORS as error:
            self.end(context)
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.end(context)
        return {"FINISHED"}

    def cancel(self, context) -> None:
        """By Esc, or by Blender, which opens another file or closes the window. The mesh is left as it was."""
        self.end(context)
        item = bpy.data.objects.get(self.request.object)
        layer = item and item.type == "MESH" and item.data.uv_layers.get(self.request.uv_map)
        if self.made_map and layer:
            item.data.uv_layers.remove(layer)

    def end(self, context) -> None:
        type(self).running = False
        if self.session is not None:
            self.session.__exit__()
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)

    def tell(self, message: str, warnings: list[str]) -> None:
        for warning in warnings:
            self.report({"WARNING"}, warning)
        if message:
            self.report({"INFO"}, message)


class GI_RENDER_PT_lightmap(RenderPanel, bpy.types.Panel):
    bl_label = "Bake Lightmap"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        settings = context.scene.gi_engine.lightmap
        column = columns(self.layout)
        column.prop(settings, "content")
        item = context.object
        if item is not None and item.type == "MESH":
            column.prop_search(settings, "uv_map", item.data, "uv_layers")
        else:
            column.prop(settings, "uv_map")
        row = column.column(align=True)
        row.prop(settings, "width")
        row.prop(settings, "height")
        for name in ("margin", "denoise", "folder"):
            column.prop(settings, name)
        chosen = next((d for d in native.integrators() if d["id"] == context.scene.gi_engine.integrator), None)
        if chosen and not chosen["bakes"]:
            column.label(text=f"{chosen['label']} cannot bake", icon="ERROR")
        self.layout.operator("gi_engine.bake_lightmap", icon="RENDER_STILL")


CLASSES = (GI_OT_bake_lightmap, GI_RENDER_PT_lightmap)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
