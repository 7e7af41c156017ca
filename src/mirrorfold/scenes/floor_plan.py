"""Scenes: the surfaces, the array and the band of a simulation, and the ground truth of a score.

A scene file is TOML; `load_scene` reads it and reports everything that is wrong with it at once.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from mirrorfold.common.arguments import wrong_kind
from mirrorfold.common.decibels import TRUTH_COLOUR
from mirrorfold.common.reading import check_file, named_file, parsed, quoting_nothing_outside, read_text
from mirrorfold.common.slabs import Polarization
from mirrorfold.common.svg import Stroke, card, picture
from mirrorfold.errors import InputError
from mirrorfold.scenes.arrays import STRICT, Band, LinearArray
from mirrorfold.scenes.materials import Substance, permittivity, warn_if_extrapolated
from mirrorfold.scenes.messages import Entries, plain, say_plainly
from mirrorfold.scenes.surfaces import (
    Arc,
    Circle,
    Curve,
    Polyline,
    Roughness,
    Segment,
    Surface,
    check_names,
)

if TYPE_CHECKING:
    from mirrorfold.scenes.solids import Scene3D


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Scene:
    """A scene in the floor plan: all that a simulation needs, and the ground truth that a score compares with.

    Attributes
    ----------
    name : str
    dimensions : int
        2.
    array : LinearArray
    band : Band
    surface : tuple of Segment, Polyline, Arc, Circle or Curve
        In the order of the file; may be empty.
    polarization : {"TE", "TM", "both"}, default "TE"
        Polarization that the radar transmits and receives: E along the vertical axis ("TE"), E in the floor plan
        ("TM"), or one after the other.
    """

    name: str
    dimensions: Literal[2] = 2
    array: LinearArray
    band: Band
    surface: tuple[Annotated[Surface, Field(discriminator="kind")], ...] = ()
    polarization: Polarization | Literal["both"] = "TE"

    def __post_init__(self) -> None:
        for surface in self.surface:
            if getattr(surface, "thickness", None) is not None:
                permittivity(surface.material, [self.band.start, self.band.stop])
            else:
                warn_if_extrapolated(surface.material, [self.band.start, self.band.stop])
        check_names(self.surface)

    def _repr_html_(self) -> str:
        """Picture of the floor plan with the main facts, for notebooks."""
        strokes = [
            Stroke(piece, TRUTH_COLOUR, label=surface.name)
            for surface in self.surface
            for piece in surface.pieces(0.02)
        ]
        positions = np.concatenate([self.array.tx_position, self.array.rx_position])
        facts = [
            ("surfaces", ", ".join(surface.name for surface in self.surface) or "none"),
            ("antennas", f"{len(self.array.tx_position)} transmitters, {len(self.array.rx_position)} receivers"),
            ("aperture", f"{np.ptp(positions, axis=0).max() * 1e3:.3g} mm"),
            ("band", f"{self.band.start / 1e9:g} to {self.band.stop / 1e9:g} GHz, {self.band.points} frequencies"),
        ]
        return card(self.name, picture(strokes, positions.mean(axis=0), title=f"floor plan of {self.name}"), facts)


MOST_POINTS = 100_000
"""Largest number of points of a curve in a file: on a wall of ten metres they are a tenth of a millimetre apart."""


@quoting_nothing_outside()
def load_scene(path: str | Path) -> Scene | Scene3D:
    """Read a scene file.

    Raises
    ------
    InputError
        The message lists every mistake in the file with its place.
    """
    if not isinstance(path, str | Path):
        raise wrong_kind("load_scene", path, "the path of a scene file; mf.parse_scene takes its content as a dict")
    path = Path(path)
    text = read_text(path, "give the path of a scene file")
    content = parsed(text, "TOML", str(path), "correct it or start from an example scene")
    return parse_scene(_with_files_beside(_with_points_from_files(content, path), path), source=str(path))


def _with_files_beside(content: dict[str, Any], path: Path) -> dict[str, Any]:
    """The content of a scene file, with the paths of meshes and tables of directions made relative to its folder.

    A path that does not exist there stays as it is, relative to the folder in which the program runs.
    """

    def found(entry: Any, name: str) -> Any:
        if not isinstance(entry, dict) or not isinstance(entry.get(name), str):
            return entry
        beside = os.path.join(path.parent, entry[name])  # `Path.exists` fails where a name is too long
        return {**entry, name: beside} if os.path.exists(beside) else entry

    surfaces, scanner = content.get("surface"), content.get("scanner")
    if isinstance(surfaces, list):
        content = {**content, "surface": [found(surface, "path") for surface in surfaces]}
    if not isinstance(scanner, dict) or not isinstance(scanner.get("directions"), str):
        return content
    named_file(path, scanner["directions"], "scanner.directions")  # it is read with the rest of the scene
    return {**content, "scanner": found(scanner, "directions")}


def _with_points_from_files(content: dict[str, Any], path: Path) -> dict[str, Any]:
    """The content of a scene file, with the points of curves read from the files that it names.

    Raises
    ------
    InputError
        If such a file is missing, or does not consist of two columns of numbers.
    """
    surfaces = content.get("surface")
    if not isinstance(surfaces, list):
        return content
    read = []
    for index, surface in enumerate(surfaces):
        if isinstance(surface, dict) and surface.get("kind") == "curve" and isinstance(surface.get("file"), str):
            place = f"{path}: surface[{index}].file"
            if "points" in surface:
                raise InputError(f"{place} is given beside points; leave out one of the two")
            points = _read_points(named_file(path, surface["file"], f"surface[{index}].file"), place)
            surface = {name: value for name, value in surface.items() if name != "file"} | {"points": points}
        read.append(surface)
    return {**content, "surface": read}


def _read_points(path: Path, place: str) -> list[list[float]]:
    """The rows x, y [m] of an .npy or a .csv file; the latter may have one line of headings.

    Raises
    ------
    InputError
        If the file cannot be read, or has another format.
    """
    expected = "expected an .npy or .csv file with one x and y [m] per row"
    if path.suffix not in (".npy", ".csv"):
        raise InputError(f"{place} is {path.name!r}, {expected}; convert it")
    try:
        check_file(path, expected)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None
    try:
        if path.suffix == ".npy":
            points = np.load(path, allow_pickle=False, mmap_mode="r")
        else:
            lines = read_text(path, expected).splitlines()
            headed = bool(lines) and any(letter.isalpha() and letter not in "eE" for letter in lines[0])
            points = np.loadtxt(lines, delimiter=",", ndmin=2, skiprows=int(headed))
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error).splitlines()[0]
        raise InputError(f"{place}: {path} cannot be read ({reason}); {expected}") from None
    if points.ndim != 2 or points.shape[1] != 2 or points.dtype.kind not in "fiu":
        raise InputError(f"{place}: {path} holds an array of shape {points.shape}, {expected}")
    if len(points) > MOST_POINTS:
        raise InputError(f"{place}: {path} holds {len(points)} points, expected at most {MOST_POINTS}; give fewer")
    return np.asarray(points, dtype=float).tolist()


def parse_scene(content: dict[str, Any], source: str = "scene") -> Scene | Scene3D:
    """A scene, in two or three dimensions, from a dict with the content of a scene file.

    Parameters
    ----------
    content : dict
        As `tomllib` returns it: ``{"name": ..., "array": {...}, "band": {...}, "surface": [{...}, ...]}``; lengths [m],
        frequencies [Hz] and angles [degree] are numbers, or texts with a unit such as ``"300 GHz"``.
    source : str
        Name of the scene, or of its file, in messages.

    Returns
    -------
    Scene or Scene3D

    Raises
    ------
    InputError
        The message lists every mistake with its place.
    """
    if not isinstance(content, dict):
        raise wrong_kind(source, content, "a dict with the content of a scene file")
    entries, scene = _ENTRIES, Scene  # type: tuple[Entries, Any]
    if content.get("dimensions") == 3:
        from mirrorfold.scenes import solids

        entries, scene = solids.ENTRIES, solids.Scene3D
    try:
        return TypeAdapter(scene).validate_python(content)
    except ValidationError as error:
        raise plain(error, source, entries) from None


def as_scene(scene: Any) -> Scene | Scene3D:
    """A scene from a scene, the path of a scene file, or a dict with the content of one.

    Raises
    ------
    InputError
        If it is none of these, or has mistakes.
    """
    if isinstance(scene, str | Path):
        return load_scene(scene)
    if isinstance(scene, dict):
        return parse_scene(scene, source="scene")
    if isinstance(scene, Scene) or getattr(type(scene), "__name__", "") == "Scene3D":
        return scene
    raise wrong_kind("scene", scene, "a scene, the path of a scene file, or a dict with the content of one")


_ENTRIES = Entries.of((Segment, Polyline, Arc, Circle, Curve), (Scene, Band, LinearArray, Roughness, Substance))
say_plainly(Scene, _ENTRIES)
