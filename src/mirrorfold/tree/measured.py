"""Tests of echoes and mirrors that need the sweep: the image alone does not hold enough for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import xarray as xr

from mirrorfold.common.types import Array, Mask, Names
from mirrorfold.detection import Echoes, ImageView
from mirrorfold.errors import InputError
from mirrorfold.tree.explaining.corners import Corners
from mirrorfold.tree.explaining.half_shadows import Overhangs, half_shadows
from mirrorfold.tree.explaining.misplaced import Known, are_corners, confocal, misplaced
from mirrorfold.tree.explaining.waves import SweepWaves
from mirrorfold.tree.ordering import Order


@dataclass(frozen=True)
class Measured:
    """Measurements of the echoes of a view; a function is None where it is not available.

    * `explain`: why each of n echoes does not come from where the image shows it, (n,) str: mixed path, beyond the
      ambiguous range, grating lobe. Empty for echoes that do come from there.
    * `overhangs`: how far beyond their ends the mirrors of an order are met; see `half_shadows`.
    * `confocal_share`: the share of the energy of echoes at places (n, 2) [m] of the image, with amplitudes (n,), that
      came back the way it went, (n,); see `directions.confocal_share`.
    * `corners`: which places (n, 2) [m] of the image show right-angled corners, (n,); see `misplaced.are_corners`.

    The `vertices`, (c, 2) [m] each, are the places that were found to be corners; only `noted` measurements list them.
    """

    explain: Callable[[Echoes], Names] | None = None
    overhangs: Callable[[Order, Echoes], Overhangs] | None = None
    confocal_share: Callable[[Array, Array], Array] | None = None
    corners: Corners | None = None
    vertices: list[Array] = field(default_factory=list)

    def noted(self) -> Measured:
        """The same measurements, with an empty list `vertices` to which `corners` adds the places that it finds."""
        if self.corners is None:
            return self
        ask, vertices = self.corners, list[Array]()

        def corners(asked: Array) -> Mask:
            found = ask(asked)
            vertices.append(asked[found])
            return found

        return replace(self, corners=corners, vertices=vertices)

    def corner_attrs(self) -> dict[str, Array]:
        """The places of all corners that were noted, as attributes `corner_x` and `corner_y` [m]."""
        places = np.unique(np.concatenate([np.zeros((0, 2)), *self.vertices]), axis=0)
        return {f"corner_{axis}": place for axis, place in zip("xy", places.T, strict=True)} if len(places) else {}


Measurer = Callable[[ImageView], Measured]
"""A function that returns the measurements of each view of one image."""


def no_measurements(view: ImageView) -> Measured:
    """No measurements: for an image whose sweep is not at hand."""
    return Measured()


def measured_by_sweep(sweep: xr.Dataset) -> Measurer:
    """Measurements by the sweep that the image was focused from; each echo is measured once, for all views.

    Raises
    ------
    InputError
        If the sweep has other dimensions than (frequency, tx, rx), such as frames.
    """
    if sweep["s"].dims != ("frequency", "tx", "rx"):
        wanted = "expected (frequency, tx, rx); choose one frame or polarization"
        raise InputError(f"sweep: s has the dimensions {sweep['s'].dims}, {wanted}")
    tested: Known = {}
    ends: dict[tuple[float, ...], float] = {}
    waves = SweepWaves(sweep)

    def measure(view: ImageView) -> Measured:
        return Measured(
            explain=partial(misplaced, waves=waves, view=view, known=tested),
            overhangs=partial(half_shadows, waves=waves, known=ends),
            confocal_share=partial(confocal, waves=waves, view=view, known=tested),
            corners=partial(are_corners, waves=waves, view=view, known=tested),
        )

    return measure
