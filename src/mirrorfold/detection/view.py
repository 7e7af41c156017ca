"""The radar's own view: amplitude along straight lines of sight, of an image or of a volume.

Steps 2 to 6 of the algorithm work on this. A line of sight is a column of an image in polar coordinates, or a beam of
a scanner; all that differs between the floor plan and space stands behind the methods below and those of a mirror
(`mirrorfold.detection.mirror`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.errors import InputError

if TYPE_CHECKING:
    from mirrorfold.detection.echoes import Echoes


DEVIATION = 0.3
"""Standard deviation of an echo's power about its place, in half-amplitude widths of the resolution cell: of the main
lobe of the Hann window, and of a Gaussian beam there and back."""


class View(ABC):
    """What every view knows. Lines of sight are numbered from 0; `direction` is such a number.

    Attributes
    ----------
    radar : (d,) array [m]
        Where the radar stands.
    range : (nr,) array [m]
        Uniform, rising.
    wavelength : float [m]
        In the middle of the band; infinite where it is not known.
    range_cell : float [m]
        Width of an echo in range, between half-amplitude points.
    normalization : str
        How the spreading with range was undone.
    """

    radar: Array
    range: Array
    range_cell: float
    wavelength: float
    normalization: str

    @property
    @abstractmethod
    def sight(self) -> Array:
        """Unit vectors of all lines of sight, (n, d)."""

    @abstractmethod
    def locate(self, points: ArrayLike) -> tuple[Array, Index, Mask]:
        """Range [m] and nearest direction of points (..., d) [m], and whether they lie inside the view."""

    @abstractmethod
    def within(self, points: Array, aside: Array | float) -> tuple[Index, Index]:
        """Every pair of a point (n, d) and a direction less than the angle `aside` [rad] from it, each (pairs,)."""

    @abstractmethod
    def beside(self, range_: Array, direction: Index) -> tuple[Index, ...]:
        """Directions to all sides of each point, so far away that its beam still reaches over."""

    @abstractmethod
    def in_cells(self, points: Array) -> Array:
        """Coordinates of points (n, d) in units of the resolution cell, (n, d)."""

    @abstractmethod
    def cell(self, range_: Array | float) -> Array:
        """Diagonal of the resolution cell [m] at that range: how large the echo of a small object is.

        Whatever is a length in the steps after imaging is a multiple of this, so that any radar is served alike.
        """

    @abstractmethod
    def cross_cell(self, points: Array) -> Array:
        """Width of the resolution cell square to the line of sight [m] at points (n, d), between half amplitudes."""

    @abstractmethod
    def object_depth(self, range_: Array) -> Array:
        """How far [m] behind the first echo of an object others may be the object's own, at that range."""

    @abstractmethod
    def looks_at(self, echoes: Echoes) -> Mask:
        """Which directions the radar surely looks into, (n,): beyond its echoes, antennas may be deaf."""

    @property
    @abstractmethod
    def covered_angle(self) -> float:
        """How far [rad] to either side of its own direction an object hides what is behind it."""

    @property
    @abstractmethod
    def cross_angle(self) -> float:
        """Angle [rad] that the radar resolves."""

    @property
    def dimensions(self) -> int:
        """2 for the floor plan, 3 for space."""
        return self.radar.size

    @property
    def dr(self) -> float:
        """Range step [m]."""
        return float(self.range[1] - self.range[0])

    def cell_at(self, point: Array) -> float:
        """Diagonal of the resolution cell [m] at a point (d,)."""
        return float(self.cell(float(np.linalg.norm(point - self.radar))))

    def extents(self, points: Array) -> Callable[[Array], Array]:
        """What tells the `extent` at points (n, d) of any unit vectors."""
        offset, cross = points - self.radar, self.cross_cell(points)
        sight = offset.T / np.maximum(np.linalg.norm(offset, axis=1), np.finfo(float).tiny)

        def extent(along: Array) -> Array:
            cosine = np.minimum(np.abs(along.T @ sight), 1.0)
            return np.hypot(self.range_cell * cosine, cross * np.sqrt(1.0 - cosine**2)).T

        return extent

    def extent(self, points: Array, along: Array) -> Array:
        """Width of the resolution cell [m] at points (n, d) along a unit vector, (n,), or each of (d, m), (n, m)."""
        return self.extents(points)(along)

    def points(self, range_: Array, direction: Index) -> Array:
        """Positions (n, d) [m] at ranges [m] in directions."""
        return self.radar + range_[..., None] * self.sight[direction]

    def meets(self, normal: Array, center: Array) -> Array:
        """Range [m] at which each line of sight meets an endless line or plane, (n,); infinite where it does not."""
        with np.errstate(divide="ignore", invalid="ignore"):
            range_ = float((center - self.radar) @ normal) / (self.sight @ normal)
        return np.where(range_ > 0.0, range_, np.inf)


def check_samples(image: xr.DataArray, dims: tuple[str, ...], source: str = "image") -> None:
    """Refuse what is no image of these dimensions, with finite values on a regular grid, 4 or more along each."""
    if not isinstance(image, xr.DataArray) or image.dims != dims:
        found = getattr(image, "dims", type(image).__name__)
        many = f"; choose one, image.isel({found[0]}=0)" if found[1:] == dims else ""
        raise InputError(f"{source}: has dimensions {found}, expected an image with dimensions {dims}{many}")
    for name in dims:
        if name not in image.coords or image.sizes[name] < 4:
            raise InputError(f"{source}: axis {name} needs a coordinate [m or degree] with at least 4 pixels")
        step = np.diff(image[name].values.astype(float))
        if not np.isfinite(step).all() or step.mean() <= 0 or np.ptp(step) > 1e-3 * step.mean():
            raise InputError(
                f"{source}: the coordinate {name} does not rise in equal steps; resample to a regular grid"
            )
    if image.dtype.kind not in "cfiu":
        raise InputError(f"{source}: holds values of type {image.dtype}, expected real or complex amplitudes")
    missing = int(np.count_nonzero(~np.isfinite(image.values)))
    if missing:
        raise InputError(
            f"{source}: {missing} of {image.size} pixels are not finite (NaN or infinite); mask them with 0"
        )
