"""The scenes of experiments: those that come with the package, and floor plans made from numbers."""

from __future__ import annotations

from importlib.resources import files
from typing import Any

import mirrorfold as mf
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.solids import Scene3D


def shipped_plan(name: str) -> Scene:
    """A floor plan that comes with the package, by the name of its file without ``.toml``."""
    return _flat(mf.load_scene(_path(name)))


def shipped_solids(name: str) -> Scene3D:
    """A scene in three dimensions that comes with the package, by the name of its file without ``.toml``."""
    found = mf.load_scene(_path(name))
    if not isinstance(found, Scene3D):
        raise InputError(f"scene {name!r} has two dimensions, expected three")
    return found


def plan_scene(content: dict[str, Any]) -> Scene:
    """A floor plan from the content that its file would have."""
    return _flat(mf.parse_scene(content))


def random_scenes(count: int) -> str:
    """A number of random scenes, in words."""
    return f"{count} random scenes" if count > 1 else "one random scene"


def _path(name: str) -> str:
    return str(files("mirrorfold").joinpath("scenes", "shipped", f"{name}.toml"))


def _flat(scene: Scene | Scene3D) -> Scene:
    """The scene itself, after a check that it has two dimensions."""
    if not isinstance(scene, Scene):
        raise InputError(f"scene {scene.name!r} has three dimensions, expected two")
    return scene
