"""GI Engine, a render engine for Blender whose subject is global illumination. What is registered, nothing else."""


def register() -> None:
    from . import engine, headless, preferences, properties, ui

    for part in (preferences, properties, engine, ui, headless):
        part.register()


def unregister() -> None:
    from . import engine, headless, preferences, properties, ui

    for part in (headless, ui, engine, properties, preferences):
        part.unregister()
