"""GI Engine, a render engine for Blender whose subject is global illumination. What is registered, nothing else."""


def register() -> None:
    from . import engine, properties, ui

    for part in (properties, engine, ui):
        part.register()


def unregister() -> None:
    from . import engine, properties, ui

    for part in (ui, engine, properties):
        part.unregister()
