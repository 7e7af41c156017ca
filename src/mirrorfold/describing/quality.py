"""The F-score to expect for hidden objects, before anything is measured.

It is read from the table `expected_quality.json`, which ``mirrorfold reproduce frequency`` makes from random scenes of
two walls, simulated by rays. The table splits the hidden F-score into three factors. The first is the chance that the
wall that shows the hidden objects is found; it depends on the length of the wall in resolution cells. The second is the
share of its echoes that are then folded to within a distance of the truth; it depends on this distance in resolution
cells. The third is the loss of F-score behind walls that mirror less power.
"""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np
from scipy.constants import speed_of_light

from mirrorfold.common.records import Number, Record, fact
from mirrorfold.scoring.figures import NEAR, WIDE

TABLE = "expected_quality.json"
"""Name of the shipped table."""


class ExpectedQuality(Record):
    """The hidden F-score to expect behind one wall, and its standard error over scenes."""

    cell_m: float = fact("diagonal of the resolution cell at the way by one bounce")
    wall_cells: float = fact("length of the wall in resolution cells where it stands")
    wall_found: Number = fact("chance that the wall shows them at all; None outside of what was tried")
    wall_found_error: Number
    f_score_2cm: Number
    f_score_2cm_error: Number
    f_score_5cm: Number
    f_score_5cm_error: Number
    f_score_cells: Number = fact("at 1.5 resolution cells")
    f_score_cells_error: Number


def cell_diagonal(frequency: float, bandwidth: float, aperture: float, range: float) -> float:
    """Diagonal of the resolution cell [m], ``sqrt((c / 2B)^2 + (lambda r / D)^2)``.

    Parameters
    ----------
    frequency, bandwidth : float [Hz]
        Middle and width of the band.
    aperture : float [m]
    range : float [m]
        Length of the whole path, one way, bounces at walls included.
    """
    return float(np.hypot(speed_of_light / (2.0 * bandwidth), speed_of_light / frequency * range / aperture))


def expected_quality(
    *,
    frequency: float,
    bandwidth: float,
    aperture: float,
    range: float,
    wall_range: float,
    wall: float = 1.0,
    mirrored_db: float | None = 0.0,
    table: dict[str, Any] | None = None,
) -> ExpectedQuality:
    """The hidden F-score to expect for objects of 10 to 40 cm that one wall shows.

    ``F(d) = mirrored(m) found(w / c_w) close(d / c)`` with the level m that the wall mirrors, its length w, the
    diagonals c_w and c of the resolution cell at the wall and at the hidden objects, and the distance d from the truth
    up to which a point counts as right. The factors are tables, interpolated over the level [dB], and over the
    logarithms of both ratios.

    Parameters
    ----------
    frequency, bandwidth : float [Hz]
        Middle and width of the band.
    aperture : float [m]
        Length of the transmitting array, and of the receiving one.
    range : float [m]
        Length of the path from the radar by way of the wall to the hidden objects.
    wall_range : float [m]
        Distance of the wall.
    wall : float [m], default 1
        Length of the wall.
    mirrored_db : float [dB], optional
        Share of the power that the wall mirrors; None if it mirrors nothing.
    table : dict, optional
        A table like `expected_quality.json`, which is the default.

    Returns
    -------
    ExpectedQuality
        With None where the cell, the wall or its reflection are outside the range of the table.

    Examples
    --------
    >>> sharp = expected_quality(frequency=295e9, bandwidth=10e9, aperture=0.08, range=3.0, wall_range=2.0)
    >>> dim = expected_quality(frequency=100e9, bandwidth=10e9, aperture=0.08, range=3.0, wall_range=2.0)
    >>> sharp.f_score_2cm > dim.f_score_2cm
    True
    """
    known = _shipped() if table is None else table
    cell = cell_diagonal(frequency, bandwidth, aperture, range)
    wall_cells = wall / cell_diagonal(frequency, bandwidth, aperture, wall_range)
    found = _product(_of_loss(known["mirrored"], mirrored_db), _interpolated(known["found"], wall_cells))
    close_in_cells = known["close_in_cells"]
    pairs = (
        found,
        *(_product(found, _interpolated(known["close"], limit / cell)) for limit in (NEAR, WIDE)),
        _product(found, (close_in_cells["mean"], close_in_cells["standard_error"])),
    )
    names = ("wall_found", "f_score_2cm", "f_score_5cm", "f_score_cells")
    facts: dict[str, float | None] = {}
    for name, pair in zip(names, pairs, strict=True):
        facts[name], facts[f"{name}_error"] = (None, None) if pair is None else (round(pair[0], 4), round(pair[1], 4))
    return ExpectedQuality(cell_m=cell, wall_cells=wall_cells, **facts)


def _interpolated(curve: dict[str, list[float]], value: float) -> tuple[float, float] | None:
    """Mean and standard error of a curve at a value, interpolated over its logarithm; None outside the valid range."""
    at = curve["at"]
    if not curve["valid"][0] <= value <= curve["valid"][1]:
        return None
    mean, error = (float(np.interp(np.log(value), np.log(at), curve[name])) for name in ("mean", "standard_error"))
    return mean, error


def _of_loss(curve: dict[str, list[float]], level_db: float | None) -> tuple[float, float] | None:
    """Mean and standard error of the factor of the F-score for a wall that mirrors this share of the power [dB].

    None where the share is below the range of the table.
    """
    if level_db is None or level_db < curve["at"][0]:
        return None
    mean, error = (float(np.interp(level_db, curve["at"], curve[name])) for name in ("mean", "standard_error"))
    return mean, error


def _product(one: tuple[float, float] | None, other: tuple[float, float] | None) -> tuple[float, float] | None:
    """Product of two means and its standard error; None where one of the means is unknown."""
    if one is None or other is None:
        return None
    return one[0] * other[0], float(np.hypot(one[0] * other[1], one[1] * other[0]))


@cache
def _shipped() -> dict[str, Any]:
    """The table that is part of the package."""
    found: dict[str, Any] = json.loads(files("mirrorfold.describing").joinpath(TABLE).read_text(encoding="utf-8"))
    return found
