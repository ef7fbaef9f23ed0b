"""GI Engine, a render engine for Blender whose subject is global illumination. What is registered, nothing else."""


def register() -> None:
    from . import engine, headless, properties, ui

    for part in (properties, engine, ui, headless):
        part.register()


def unregister() -> None:
    from . import engine, headless, properties, ui

    for part in (headless, ui, engine, properties):
        part.unregister()
