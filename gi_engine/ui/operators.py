"""Buttons."""

from __future__ import annotations

import bpy

from .. import camera_path, engine, presets
from ..export import ExportError
from ..export.settings import copy_from_cycles


class GI_OT_copy_from_cycles(bpy.types.Operator):
    """Give the scene its own copy of Cycles' samples, bounces, clamping, caustics, film, pixel filter and seed"""

    bl_idname = "gi_engine.copy_from_cycles"
    bl_label = "Copy from Cycles"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if hasattr(context.scene, "cycles"):
            return True
        cls.poll_message_set("The Cycles add-on is switched off")
        return False

    def execute(self, context):
        copy_from_cycles(context.scene)
        return {"FINISHED"}


class GI_OT_follow_cycles(bpy.types.Operator):
    """Forget the scene's own settings: take Cycles' samples, bounces, film and so on, whatever they are"""

    bl_idname = "gi_engine.follow_cycles"
    bl_label = "Follow Cycles"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        context.scene.gi_engine.is_own = False
        return {"FINISHED"}


class GI_OT_render_along(bpy.types.Operator):
    """Render the animation, with the cache of its first frame filled for all that the camera will see: nothing is added later that could flicker"""

    bl_idname = "gi_engine.render_along"
    bl_label = "Render Animation, Filling Ahead"

    def execute(self, context):
        scene = context.scene
        frames = list(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))
        try:
            engine.look_ahead(camera_path.collect(context, frames))
        except ExportError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return bpy.ops.render.render("EXEC_DEFAULT" if bpy.app.background else "INVOKE_DEFAULT", animation=True)


class GI_OT_preset(bpy.types.Operator):
    """Choose an integrator, samples and bounces that suit each other"""

    bl_idname = "gi_engine.preset"
    bl_label = "Preset"
    bl_options = {"REGISTER", "UNDO"}

    preset: bpy.props.EnumProperty(
        name="Preset", items=[(key, preset.label, preset.help) for key, preset in presets.PRESETS.items()]
    )

    @classmethod
    def description(cls, context, properties):
        return presets.PRESETS[properties.preset].help

    def execute(self, context):
        presets.apply(presets.PRESETS[self.preset], context.scene)
        return {"FINISHED"}


class GI_MT_presets(bpy.types.Menu):
    bl_label = "Presets"

    def draw(self, context):
        self.layout.operator_enum("gi_engine.preset", "preset")


CLASSES = (GI_OT_preset, GI_MT_presets, GI_OT_render_along, GI_OT_copy_from_cycles, GI_OT_follow_cycles)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
