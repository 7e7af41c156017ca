"""What the sweep tells of echoes and mirrors that their image does not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import xarray as xr

from mirrorfold.common.types import Array, Names
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.tree.explaining.half_shadows import Hems, half_shadows
from mirrorfold.tree.explaining.misplaced import Known, confocal, misplaced
from mirrorfold.tree.ordering import Order


@dataclass(frozen=True)
class Measured:
    """What is told of the echoes of a view; each function is None where nothing tells.

    Attributes
    ----------
    explain : callable, optional
        Explains echoes (n,) that come from elsewhere, by mixed paths or from beyond the ambiguous range: (n,) str.
    beside : callable, optional
        What the antennas see past the ends of the mirrors of an order, see `half_shadows`.
    share : callable, optional
        How much of the energy of echoes at places (n, 2) [m] with amplitudes (n,) came back the way it went, (n,).
    """

    explain: Callable[[Echoes], Names] | None = None
    beside: Callable[[Order, Echoes], Hems] | None = None
    share: Callable[[Array, Array], Array] | None = None


Teller = Callable[[ImageView], Measured]
"""What is told of each view of one image."""


def nothing_measured(view: ImageView) -> Measured:
    """What is told of an image whose sweep is not at hand."""
    return Measured()


def told_by_sweep(sweep: xr.Dataset) -> Teller:
    """What the sweep tells that the image was focused from; each echo is measured once, whichever view shows it."""
    tested: Known = {}
    ends: dict[tuple[float, ...], float] = {}

    def told(view: ImageView) -> Measured:
        return Measured(
            explain=partial(misplaced, sweep=sweep, view=view, known=tested),
            beside=partial(half_shadows, sweep=sweep, known=ends),
            share=partial(confocal, sweep=sweep, view=view, known=tested),
        )

    return told
