"""Writing of scene files: TOML from which `mirrorfold.scenes.floor_plan.load_scene` reads the same scene."""

from __future__ import annotations

from pathlib import Path

import tomli_w
from pydantic import TypeAdapter

from mirrorfold.errors import InputError
from mirrorfold.io.files import check_output, written_atomically
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.solids import Scene3D


def write_scene(scene: Scene | Scene3D, path: Path) -> Path:
    """Write a scene file, and return its path.

    Every entry is written, defaults included, so that the file stays the same scene if defaults change. Points that a
    curve had in a file of its own are written into the scene file. Meshes and tables of directions stay in their files.

    Raises
    ------
    InputError
        If `scene` is no scene, the file cannot be written, or its name does not end in ``.toml``.
    OSError
        If the disk is full or fails; an older file stays as it was.
    """
    if not isinstance(scene, Scene | Scene3D):
        raise InputError(f"save: got a {type(scene).__name__}, expected a sweep, an image, a reconstruction or a scene")
    check_output(path, suffixes=(".toml",))
    content = TypeAdapter(type(scene)).dump_python(scene, mode="json", exclude_none=True)
    with written_atomically(path) as temporary:
        temporary.write_text(tomli_w.dumps(content), encoding="utf-8")
    return path
