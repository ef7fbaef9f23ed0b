"""The add-on's preferences: what of this machine is used. Kept with the user, not with files."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import EnumProperty, FloatProperty, IntProperty, StringProperty

from . import caches, log, machine

DEFAULT = machine.Machine()
LEVELS = (
    ("WARNING", "Problems", "Only what went wrong and is told nowhere else"),
    ("INFO", "Renders", "And of each render its integrator, threads, times, rays and memory, and what is dropped from the cache"),
    ("DEBUG", "Everything", "And what each change of the scene made the viewport do, and how long it took: for reports of faults"),
)  # fmt: skip


def take(_preferences=None, _context=None) -> None:
    """What the preferences say holds from now on; the defaults where the add-on is not in Blender's list."""
    entry = bpy.context.preferences.addons.get(__package__)
    chosen = entry.preferences if entry else None
    if chosen is None:
        machine.current = DEFAULT
        log.logger.setLevel(log.LEVELS[0])
        return
    folder = Path(bpy.path.abspath(chosen.cache_folder)) if chosen.cache_folder else None
    machine.current = machine.Machine(chosen.threads, folder, round(chosen.cache_limit * machine.GIB))
    log.logger.setLevel(chosen.log_level)


def take_limit(_preferences, _context) -> None:
    take()
    caches.trim()


class GI_Preferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    threads: IntProperty(
        name="Threads",
        description="Threads that renders and the viewport use at most, where the scene does not fix their number itself; 0 for all that the "
        "machine has (in the viewport all but one). Fewer leave more to other programs and take longer; the picture is the same",
        default=DEFAULT.threads,
        min=0,
        soft_max=64,
        max=1024,
        update=take,
    )
    cache_folder: StringProperty(
        name="Cache Folder",
        description="Where references of comparisons are kept, and Cache Files that are named without a folder; empty for the "
        "system's own place for caches",
        subtype="DIR_PATH",
        update=take,
    )
    cache_limit: FloatProperty(
        name="Cache Limit (GB)",
        description="Gigabytes that the cache folder may hold: beyond that, what was not used for longest is deleted; 0 for no limit. "
        "Files elsewhere are never deleted",
        default=DEFAULT.cache_limit / machine.GIB,
        min=0,
        soft_max=100,
        precision=1,
        step=50,
        update=take_limit,
    )
    log_level: EnumProperty(name="Log", description="What is said on the console", items=LEVELS, update=take)

    def draw(self, context):
        column = self.layout.column()
        column.use_property_split = True
        column.use_property_decorate = False
        column.prop(self, "threads", text="Threads" if self.threads else "Threads (0: All)")
        column.separator()
        column.prop(self, "cache_folder", placeholder=str(caches.system_folder()))
        column.prop(self, "cache_limit")
        row = column.split(factor=0.4)
        row.label(text="")
        found = caches.entries()
        row = row.row()
        row.label(
            text=f"{caches.words(sum(entry.size for entry in found))} in {len(found)} cache{'s' * (len(found) != 1)}"
        )
        row.operator("gi_engine.clear_cache", icon="TRASH")
        column.separator()
        column.prop(self, "log_level")


class GI_OT_clear_cache(bpy.types.Operator):
    """Delete all that is in the cache folder: comparisons render their references anew, and integrators begin without what they kept. Files elsewhere stay"""

    bl_idname = "gi_engine.clear_cache"
    bl_label = "Clear"

    def execute(self, context):
        dropped = caches.clear()
        self.report({"INFO"}, f"{caches.words(sum(entry.size for entry in dropped))} of caches were deleted")
        return {"FINISHED"}


CLASSES = (GI_Preferences, GI_OT_clear_cache)


@bpy.app.handlers.persistent
def take_again(*_) -> None:
    """Factory settings have no entry for the add-on, and leave it switched on where it was registered by hand."""
    take()


HANDLERS = (bpy.app.handlers.load_post, bpy.app.handlers.load_factory_preferences_post)


def register() -> None:
    log.open_console()
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for handlers in HANDLERS:
        handlers.append(take_again)
    take()


def unregister() -> None:
    for handlers in HANDLERS:
        handlers.remove(take_again)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
    machine.current = DEFAULT
    log.close_console()
