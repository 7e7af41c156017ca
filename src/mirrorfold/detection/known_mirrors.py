"""Mirrors that are known or drawn: lines on the unfolded image in the place of detected ones.

The file of such mirrors is JSON: ``{"mirrors": [{"start": [x, y], "end": [x, y]}, ...]}`` in metres, in the coordinates
of the unfolded image, where a mirror seen through another is a ghost itself.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mirrorfold.detection.image_echoes import Echoes
from mirrorfold.detection.image_view import PolarImage
from mirrorfold.detection.lines import _fill
from mirrorfold.detection.mirror import Mirror, line_cell
from mirrorfold.errors import InputError

Array = NDArray[np.float64]

SHORTEST = 1e-3
"""A given mirror shorter than this [m] has no direction to speak of."""

LARGEST_COUNT = 1000
"""More mirrors than this are no room but a mistake."""

SAMPLES = 64
"""Places along a line where the image tells how strong it is."""


def check_lines(lines: ArrayLike, source: str = "mirrors") -> Array:
    """Given mirrors as an array of their two ends, (mirrors, 2, 2) [m].

    Raises
    ------
    InputError
        If they are not pairs of points of two finite numbers each, or a mirror has no length; `source` names them.
    """
    try:
        ends = np.array(lines, dtype=float)
    except (TypeError, ValueError):
        ends = np.array(np.nan)
    if ends.shape[:1] == (0,):
        return np.empty((0, 2, 2))
    if ends.shape[1:] != (2, 2) or ends.ndim != 3:
        found = "something else" if ends.ndim == 0 else f"an array of shape {ends.shape}"
        raise InputError(f"{source}: expected for each mirror its two ends of two numbers [m], got {found}")
    if len(ends) > LARGEST_COUNT:
        raise InputError(f"{source}: holds {len(ends)} mirrors, expected at most {LARGEST_COUNT}")
    for number, (start, end) in enumerate(ends):
        if not np.isfinite([start, end]).all():
            raise InputError(f"{source}: mirror {number} has an end that is not finite, expected numbers in metres")
        if np.linalg.norm(end - start) < SHORTEST:
            raise InputError(f"{source}: mirror {number} has no length; give two different ends, or leave it out")
    return ends


def read_lines(path: str | Path) -> Array:
    """Read a file of mirrors.

    Parameters
    ----------
    path : path
        JSON, see above.

    Returns
    -------
    (mirrors, 2, 2) array [m]

    Raises
    ------
    InputError
        If the file is missing, is not JSON, or holds something else.
    """
    path = Path(path)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: does not exist; give a JSON file of mirrors") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); give a JSON file of mirrors") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is not JSON ({str(error).splitlines()[0]}); expected {EXAMPLE}") from None
    mirrors = content.get("mirrors") if isinstance(content, dict) else None
    if not isinstance(mirrors, list):
        raise InputError(f"{path}: holds no list 'mirrors'; expected {EXAMPLE}")
    for number, mirror in enumerate(mirrors):
        if not isinstance(mirror, dict) or not {"start", "end"} <= set(mirror):
            raise InputError(f"{path}: mirror {number} has no 'start' and 'end'; expected {EXAMPLE}")
    return check_lines([[mirror["start"], mirror["end"]] for mirror in mirrors], str(path))


EXAMPLE = '{"mirrors": [{"start": [0.4, 1.6], "end": [0.6, 0.9]}]}'


def write_lines(lines: ArrayLike, path: str | Path) -> Path:
    """Write a file of mirrors that `read_lines` reads back to the last bit; returns its path."""
    ends = check_lines(lines)
    rows: list[dict[str, Any]] = [{"start": start.tolist(), "end": end.tolist()} for start, end in ends]
    path = Path(path)
    path.write_text(json.dumps({"mirrors": rows}, indent=2) + "\n", encoding="utf-8")
    return path


def given_mirrors(lines: Array, echoes: Echoes, polar: PolarImage) -> list[Mirror]:
    """Lines as mirrors, with what the image says of each.

    Parameters
    ----------
    lines : (mirrors, 2, 2) array [m]
    echoes : Echoes
    polar : PolarImage

    Returns
    -------
    list of Mirror
        Strength is the median amplitude of the echoes on the line, or of the image along it where there are none.
        Their errors are not known: NaN.
    """
    mirrors = []
    for start, end in lines:
        line = Mirror(start, end, angle_error=np.nan, offset_error=np.nan)
        across, _ = line_cell(polar, echoes.position, line.direction)
        position = line.along(echoes.position)
        on_it = (np.abs(line.beside(echoes.position)) <= across) & (position >= 0.0) & (position <= line.length)
        if on_it.any():
            strength = float(np.median(echoes.amplitude[on_it]))
        else:
            along = start + np.linspace(0.0, 1.0, SAMPLES)[:, None] * (end - start)
            strength = float(np.median(polar.at(*polar.to_polar(along))))
        fill = _fill(echoes.position[on_it], line, polar)
        mirrors.append(Mirror(start, end, strength, np.nan, np.nan, fill))
    return mirrors
