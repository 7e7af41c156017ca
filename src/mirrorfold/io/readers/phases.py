"""The unit of phases, degrees or radians, from their name or their values."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import NDArray

MANY = 64
"""Smallest number of phases whose values tell the unit; fewer may lie close together by chance."""

SECTORS = 16
"""Number of sectors of the circle. Many phases in radians fall into all of them; phases in degrees with values as small
lie within a few degrees."""

ROUNDING = 0.01
"""Largest excess of rounded phases over the full circle [rad]."""


def phase_unit(name: str, values: NDArray) -> str | None:
    """The unit of phases, by their name, else by their values.

    Parameters
    ----------
    name : str
        Name of the variable, in lower case.
    values : array

    Returns
    -------
    {"degree", "radian"} or None
        None where neither tells it: all phases are small, and they are few or do not cover the circle.

    Examples
    --------
    >>> phase_unit("phase_deg", np.zeros(3)), phase_unit("phase", np.array([-170.0, 20.0]))
    ('degree', 'degree')
    >>> phase_unit("phase", np.linspace(-3.1, 3.1, 200)), phase_unit("phase", np.array([0.1, 0.3]))
    ('radian', None)
    """
    if re.search(r"deg(?:rees?)?(?![a-z])", name):
        return "degree"
    if re.search(r"rad(?:ians?)?(?![a-z])", name):
        return "radian"
    values = values[np.isfinite(values)]
    if np.abs(values).max(initial=0.0) > 2.0 * np.pi + ROUNDING:
        return "degree"
    sector = np.floor(values / (2.0 * np.pi) * SECTORS).astype(int) % SECTORS
    within = np.ptp(values) <= 2.0 * np.pi + ROUNDING if values.size else False
    return "radian" if values.size >= MANY and within and np.unique(sector).size == SECTORS else None
