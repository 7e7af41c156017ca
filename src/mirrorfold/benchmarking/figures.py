"""The figures that a benchmark reports of each score: their names, and whether more or less is better."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mirrorfold.common.records import Number

Score = Any


@dataclass(frozen=True)
class Figure:
    """A figure of a score.

    Attributes
    ----------
    name : str
        Name in files.
    label : str
        Name in tables and pictures, with the unit.
    read : callable
        Takes the figure from a score; None if it is undefined.
    high : bool
        Whether more is better.
    digits : int
        Number of decimals in tables.
    share : bool
        Whether the figure is a share, between 0 and 1.
    """

    name: str
    label: str
    read: Callable[[Score], Number]
    high: bool = True
    digits: int = 3
    share: bool = True


def _mirrors(score: Score, name: str) -> Number:
    """Mean error over the mirrors in line of sight that agree with a true surface; None if no mirror has this error."""
    own = (mirror.get(name) for mirror in score.mirrors if mirror.generation == 1 and mirror.surface is not None)
    errors = [error for error in own if error is not None]
    return float(np.mean(errors)) if errors else None


def _invented(figures: Any) -> float:
    """Number of cells of a centimetre with points far from every surface."""
    return float(round(figures.invented_fraction * figures.cells))


def _millimetres(metres: Number) -> Number:
    return None if metres is None else 1e3 * metres


def _percent(name: str) -> Callable[[Score], Number]:
    """Makes the function that reads a mean error of mirrors in line of sight, given as a share, in per cent."""

    def read(score: Score) -> Number:
        share = _mirrors(score, name)
        return None if share is None else 100.0 * share

    return read


FIGURES = {
    figure.name: figure
    for figure in (
        Figure("f_all", "F, all", lambda s: s.f_score_2cm),
        Figure("f_hidden", "F, hidden", lambda s: s.hidden.f_score_2cm),
        Figure("precision_hidden", "precision, hidden", lambda s: s.hidden.precision_2cm),
        Figure("completeness_hidden", "completeness, hidden", lambda s: s.hidden.completeness_2cm),
        Figure("f_all_cells", "F, all, in cells", lambda s: s.f_score_cells),
        Figure("f_hidden_cells", "F, hidden, in cells", lambda s: s.hidden.f_score_cells),
        Figure("precision_hidden_cells", "precision, hidden, in cells", lambda s: s.hidden.precision_cells),
        Figure("completeness_hidden_cells", "completeness, hidden, in cells", lambda s: s.hidden.completeness_cells),
        Figure("invented_cells", "invented cells", _invented, high=False, digits=1, share=False),
        Figure("angle_deg", "angle [deg]", lambda s: _mirrors(s, "angle_error_deg"), high=False, share=False),
        Figure("offset_mm", "offset [mm]", lambda s: _mirrors(s, "offset_error_mm"), high=False, digits=2, share=False),
        Figure("sides_right", "right sides", lambda s: s.get("sides_right")),
        Figure(
            "passed_mm", "passed [mm]", lambda s: _millimetres(s.get("passed_m")), high=False, digits=1, share=False
        ),
        Figure("sides_doubtful", "doubtful sides", lambda s: s.get("sides_doubtful"), high=False),
        *(
            Figure(f"{name}_percent", f"{name} [%]", _percent(f"{name}_error"), high=False, digits=2, share=False)
            for name in ("curvature", "permittivity", "thickness")
        ),
    )
}
"""All figures by name.

F-score, precision and completeness are at 2 cm; "in cells", they are at 1.5 resolution cells. Angle and offset are the
mean errors of mirrors in line of sight. Invented cells are cells of a centimetre with points more than 10 cm from any
surface. "Right sides" is the share of the echoes behind half-transparent walls, without doubtful ones, that are rightly
taken for reflected or for passed; "passed" is the median distance of passed echoes from the truth; "doubtful sides" is
the share of echoes that are left open. The errors of curvature, permittivity and thickness are means over the mirrors
in line of sight that have them.
"""

OFTEN_UNDEFINED = ("sides_right", "sides_doubtful", "passed_mm", "curvature_percent", "permittivity_percent",
                   "thickness_percent")  # fmt: skip
"""Figures that are defined only for curved mirrors or half-transparent walls."""


def shown_figures(usual: Sequence[str], results: Sequence[Any]) -> list[str]:
    """Names of the figures of a table: the usual ones, and those of `OFTEN_UNDEFINED` that some result defines."""
    return [*usual, *(name for name in OFTEN_UNDEFINED if any(one.figures[name].scenes for one in results))]
