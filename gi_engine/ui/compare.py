""" "Compare with Cycles": the settings' panel in the render tab and its button, which compares in the background and can be stopped, then shows
pictures beside each other and opens the report."""

from __future__ import annotations

import bpy

from .. import native
from ..compare import job
from ..compare.plan import PlanError
from ..output import OutputError
from .panel import RenderPanel, columns

ERRORS = (OutputError, PlanError, job.JobError)
INTERVAL = 0.1  # seconds between two looks at how far it is
NAME = "Compare: "  # before the names of images


class GI_OT_compare(bpy.types.Operator):
    """Render the scene as it is, unsaved changes included, by each engine for the same time and show the pictures and a report. Nothing of the scene is changed; Esc stops it"""

    bl_idname = "gi_engine.compare"
    bl_label = "Compare with Cycles"
    running = False  # one at a time

    @classmethod
    def poll(cls, context):
        if cls.running:
            cls.poll_message_set("A comparison is running; Esc stops that")
            return False
        if not native.available():
            cls.poll_message_set("The compiled part is missing")
            return False
        return True

    def execute(self, context):
        """Waits: for scripts."""
        try:
            self.job = job.Job(context.scene)
            self.job.done(None)
            return self.finish(context)
        except ERRORS as error:
            return self.fail(error)

    def invoke(self, context, event):
        try:
            self.job = job.Job(context.scene)
        except ERRORS as error:
            return self.fail(error)
        self.timer = context.window_manager.event_timer_add(INTERVAL, window=context.window)
        context.window_manager.modal_handler_add(self)
        type(self).running = True
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC":
            self.cancel(context)
            self.report({"INFO"}, "The comparison was cancelled; nothing is left of it")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        words = f"Comparing: {100 * self.job.fraction:.0f} %, {self.job.text}   (Esc: stop)"
        context.workspace.status_text_set(words)
        if not self.job.done():
            return {"RUNNING_MODAL"}
        self.end(context)
        try:
            return self.finish(context)
        except ERRORS as error:
            return self.fail(error)

    def cancel(self, context) -> None:
        """By Esc, or by Blender, which opens another file, closes the window or itself."""
        self.job.cancel()
        self.end(context)

    def end(self, context) -> None:
        type(self).running = False
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)

    def finish(self, context):
        facts = self.job.finish()
        for engine in facts["engines"]:
            if engine["error"]:
                self.report({"WARNING"}, f"{engine['label']}: {engine['error']}")
        for warning in facts["warnings"]:
            self.report({"WARNING"}, warning)
        images = load(job.pictures_of(facts, self.job.folder))
        page = self.job.folder / job.REPORT
        if not bpy.app.background and context.window is not None:
            # Later: a modal operator that opens a window is never taken off Blender's list.
            names, window = [image.name for image in images], context.window
            bpy.app.timers.register(lambda: show(window, names), first_interval=0.0)
            if context.scene.gi_engine.compare.open_report:
                bpy.ops.wm.url_open(url=page.as_uri())
        self.report({"INFO"}, f"The comparison is in {page}")
        return {"FINISHED"}

    def fail(self, error):
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}


def load(pictures: dict) -> list:
    """Images of these files, in the places of those of an earlier comparison."""
    images = []
    for name, path in pictures.items():
        image = bpy.data.images.get(NAME + name)
        if image is None:
            image = bpy.data.images.load(str(path))
            image.name = NAME + name
        else:
            image.filepath = str(path)
            image.reload()
        images.append(image)
    return images


def still_open(window) -> bool:
    return window in list(bpy.context.window_manager.windows)


def show(parent, names: list[str]) -> None:
    """A window with two Image Editors beside each other: the first of the images, and the last."""
    if not names or not still_open(parent):
        return
    with bpy.context.temp_override(window=parent):
        bpy.ops.wm.window_new()
    window = bpy.context.window_manager.windows[-1]
    area = window.screen.areas[0]
    area.type = "IMAGE_EDITOR"
    if len(names) > 1:
        with bpy.context.temp_override(window=window, screen=window.screen, area=area, region=area.regions[-1]):
            bpy.ops.screen.area_split(direction="VERTICAL", factor=0.5)
    # Areas have their places and sizes once they were drawn.
    bpy.app.timers.register(lambda: fill(window, (names[0], names[-1])), first_interval=0.2)


def fill(window, names: tuple[str, str]) -> None:
    if not still_open(window):
        return
    for area, name in zip(sorted(window.screen.areas, key=lambda area: area.x), names, strict=False):
        area.spaces.active.image = bpy.data.images.get(name)
        region = next(region for region in area.regions if region.type == "WINDOW")
        with bpy.context.temp_override(window=window, screen=window.screen, area=area, region=region):
            bpy.ops.image.view_all(fit_view=True)


class GI_RENDER_PT_compare(RenderPanel, bpy.types.Panel):
    bl_label = "Compare"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        settings = context.scene.gi_engine.compare
        column = columns(self.layout)
        column.column(align=True).prop(settings, "engines", expand=True)
        column.prop(settings, "seconds")
        column.prop(settings, "reference")
        if settings.reference == "FILE":
            column.prop(settings, "reference_file")
        column.prop(settings, "folder")
        column.prop(settings, "open_report")
        self.layout.operator("gi_engine.compare", icon="IMAGE_REFERENCE")


CLASSES = (GI_OT_compare, GI_RENDER_PT_compare)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
