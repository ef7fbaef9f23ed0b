"""The button of bidirectional integrators that renders every strategy by itself, in the background; it can be stopped."""

from __future__ import annotations

from pathlib import Path

import bpy

from .. import bake, strategies
from ..output import OutputError, Target

ERRORS = (strategies.StrategyError, OutputError, *bake.USER_ERRORS)
INTERVAL = 0.1  # seconds between two looks at how far it is


class GI_OT_render_strategies(bpy.types.Operator):
    """Render every way in which paths from the eye and from the lights are joined by itself, weighted and unweighted: pictures and contact sheets into a folder. Paths of up to 8 vertices, luminaire and lens included; lower Max Bounces for fewer"""

    bl_idname = "gi_engine.render_strategies"
    bl_label = "Render Strategies"

    directory: bpy.props.StringProperty(subtype="DIR_PATH")
    filter_folder: bpy.props.BoolProperty(default=True, options={"HIDDEN"})
    running = False  # one at a time
    session = timer = None

    @classmethod
    def poll(cls, context):
        if cls.running:
            cls.poll_message_set("Strategies are being rendered; Esc stops that")
        return not cls.running

    def invoke(self, context, event):
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        folder = Path(bpy.path.abspath(self.directory))
        try:
            with Target(folder / strategies.INDEX):
                pass
            if bpy.app.background or context.window is None:
                made = strategies.render(context, folder)
                return self.finish(made.warnings, len(made.images))
            self.pyramid, self.session = strategies.begin(context), None
            self.next()
        except ERRORS as error:
            return self.fail(error)
        self.timer = context.window_manager.event_timer_add(INTERVAL, window=context.window)
        context.window_manager.modal_handler_add(self)
        type(self).running = True
        return {"RUNNING_MODAL"}

    def next(self) -> bool:
        self.session = self.pyramid.next()
        if self.session is not None:
            self.session.__enter__()
        return self.session is not None

    def modal(self, context, event):
        if event.type == "ESC":
            self.cancel(context)
            self.report({"INFO"}, "The strategies were cancelled; nothing is written")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            done = self.session.native.wait(0)
            fraction = self.pyramid.fraction(self.session.progress()["fraction"])
            context.workspace.status_text_set(f"Rendering strategies: {100 * fraction:.0f} %   (Esc: stop)")
            if not done:
                return {"RUNNING_MODAL"}
            self.session.wait()  # raises where it failed
            self.pyramid.take(self.session)
            self.session.__exit__()
            if self.next():
                return {"RUNNING_MODAL"}
            strategies.write(context.scene, self.pyramid, Path(bpy.path.abspath(self.directory)))
        except ERRORS as error:
            self.end(context)
            return self.fail(error)
        self.end(context)
        return self.finish(self.pyramid.warnings, len(self.pyramid.images))

    def cancel(self, context) -> None:
        """By Esc, or by Blender: no folder is chosen, another file is opened, the window is closed."""
        if self.timer is not None:
            self.end(context)

    def end(self, context) -> None:
        type(self).running = False
        if self.session is not None:
            self.session.__exit__()
        context.window_manager.event_timer_remove(self.timer)
        context.workspace.status_text_set(None)

    def finish(self, warnings: list[str], count: int):
        for warning in warnings:
            self.report({"WARNING"}, warning)
        self.report({"INFO"}, f"{count} pictures are in {self.directory}")
        return {"FINISHED"}

    def fail(self, error):
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}


CLASSES = (GI_OT_render_strategies,)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
