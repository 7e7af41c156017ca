"""Scenes: the surfaces, the array and the band of a simulation, and the ground truth of a score.

A scene file is TOML; `load_scene` reads it and reports everything that is wrong with it at once.
"""

from __future__ import annotations

import tomllib
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass

from mirrorfold.common.decibels import TRUTH_COLOUR
from mirrorfold.common.svg import Stroke, card, picture
from mirrorfold.errors import InputError
from mirrorfold.scenes.arrays import STRICT, Band, LinearArray
from mirrorfold.scenes.surfaces import (
    Arc,
    Circle,
    Curve,
    Polyline,
    Roughness,
    Segment,
    Surface,
)

if TYPE_CHECKING:
    from mirrorfold.scenes.solids import Scene3D


@dataclass(frozen=True, config=STRICT, kw_only=True)
class Scene:
    """Everything that a simulation needs to know, and a score compares with.

    Attributes
    ----------
    name : str
    dimensions : int
        2.
    array : LinearArray
    band : Band
    surface : tuple of Segment, Polyline, Arc, Circle or Curve
        In the order of the file; may be empty.
    """

    name: str
    dimensions: Literal[2] = 2
    array: LinearArray
    band: Band
    surface: tuple[Annotated[Surface, Field(discriminator="kind")], ...] = ()

    def __post_init__(self) -> None:
        names = [surface.name for surface in self.surface]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"surface names must differ, but {', '.join(map(repr, twice))} is used more than once")

    def _repr_html_(self) -> str:
        """The floor plan and the facts, for notebooks."""
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


def load_scene(path: str | Path) -> Scene | Scene3D:
    """Read a scene file.

    Raises
    ------
    InputError
        With every mistake in the file and its place.
    """
    path = Path(path)
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give the path of a scene file") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: is not valid TOML ({error}); correct it or start from an example scene") from None
    return parse_scene(_with_points_from_files(content, path), source=str(path))


def _with_points_from_files(content: dict[str, Any], path: Path) -> dict[str, Any]:
    """The content of a scene file, with the points that curves keep in files beside it.

    Raises
    ------
    InputError
        If such a file is missing or does not hold two columns of numbers.
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
            points = _read_points(path.parent / surface["file"], place)
            surface = {name: value for name, value in surface.items() if name != "file"} | {"points": points}
        read.append(surface)
    return {**content, "surface": read}


def _read_points(path: Path, place: str) -> list[list[float]]:
    """The rows x, y [m] of an .npy or a .csv file; the latter may have one line of headings.

    Raises
    ------
    InputError
        If they cannot be read.
    """
    expected = "expected an .npy or .csv file with one x and y [m] per row"
    if path.suffix not in (".npy", ".csv"):
        raise InputError(f"{place} is {path.name!r}, {expected}; convert it")
    try:
        if path.suffix == ".npy":
            points = np.load(path, allow_pickle=False)
        else:
            lines = path.read_text(encoding="utf-8").splitlines()
            headed = bool(lines) and any(letter.isalpha() and letter not in "eE" for letter in lines[0])
            points = np.loadtxt(lines, delimiter=",", ndmin=2, skiprows=int(headed))
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error).splitlines()[0]
        raise InputError(f"{place}: {path} cannot be read ({reason}); {expected}") from None
    if points.ndim != 2 or points.shape[1] != 2 or points.dtype.kind not in "fiu":
        raise InputError(f"{place}: {path} holds an array of shape {points.shape}, {expected}")
    return [[float(x), float(y)] for x, y in points]


def parse_scene(content: dict[str, Any], source: str = "scene") -> Scene | Scene3D:
    """A scene, of two dimensions or of three, from the content of a scene file, as `tomllib` returns it.

    Raises
    ------
    InputError
        With every mistake and its place; `source` names the file in the message.
    """
    kinds: tuple[str, ...] = _KINDS
    fields, scene = _FIELDS, Scene  # type: tuple[list[str], Any]
    if content.get("dimensions") == 3:
        from mirrorfold.scenes import solids

        kinds, fields, scene = solids.KINDS, solids.FIELDS, solids.Scene3D
    try:
        return TypeAdapter(scene).validate_python(content)
    except ValidationError as error:
        mistakes = [_explain(item, kinds, fields) for item in error.errors(include_url=False)]
        raise InputError(f"{source}: {'; '.join(mistakes)}") from None


def _explain(item: Any, kinds: tuple[str, ...], fields: list[str]) -> str:
    """One mistake in plain words, with its place such as ``surface[1].start``."""
    place = ""
    for part in item["loc"]:
        if isinstance(part, int):
            place += f"[{part}]"
        elif part not in kinds:
            place += f".{part}" if place else str(part)
    place = place or "file"
    found = item["input"]
    if item["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        close = get_close_matches(str(item["loc"][-1]), fields, n=1)
        hint = f"did you mean {close[0]!r}?" if close else "remove it"
        return f"{place} is not a known entry, {hint}"
    if item["type"] in ("missing", "missing_argument", "missing_keyword_only_argument"):
        return f"{place} is missing, add it"
    if item["type"] == "union_tag_invalid":
        return f"{place}.kind is {found.get('kind')!r}, expected one of {', '.join(kinds)}"
    if item["type"] == "union_tag_not_found":
        return f"{place}.kind is missing, expected one of {', '.join(kinds)}"
    if item["type"] == "value_error":
        return f"{place}: {item['ctx']['error']}"
    message = item["msg"].removeprefix("Input should be ")
    return f"{place} is {found!r}, expected {message}"


_KINDS = ("segment", "polyline", "arc", "circle", "curve")
_FIELDS = sorted(
    {
        name
        for cls in (Scene, Band, LinearArray, Roughness, Segment, Polyline, Arc, Circle, Curve)
        for name in cls.__dataclass_fields__
    }
)
