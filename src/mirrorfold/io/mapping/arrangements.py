"""From samples to a sweep, for each way in which antennas or beams are arranged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.io.mapping.model import Mapping
from mirrorfold.io.mapping.quantities import Quantities
from mirrorfold.io.readers.contents import check_memory
from mirrorfold.sweep import AXES

Array = NDArray[np.floating]

LEADING = ("polarization", "frame")
"""Axes of a sweep before frequency, in this order."""

SAME_PLACE = 1e-9
"""Largest distance of two antennas that are one [m], far below any wavelength."""

ANGLE_DIGITS = 6
"""Digits after the point to which angles [degree] must agree to be the same."""


@dataclass(frozen=True, eq=False)
class ArrangedSamples:
    """Samples with named axes, and the mapping and quantities from which the places or angles of these axes are read.

    Attributes
    ----------
    quantities : Quantities
    mapping : Mapping
    frequency : (n,) array [Hz]
    s : array
    dims : list of str
        The axes of `s`: leading ones, frequency, those of the arrangement.
    speed : float [m/s]
        Speed of the waves.
    attrs : dict
        Attributes of the sweep.
    """

    quantities: Quantities
    mapping: Mapping
    frequency: Array
    s: NDArray
    dims: list[str]
    speed: float
    attrs: dict[str, Any]

    def count(self, axis: str) -> int:
        """The number of samples along an axis."""
        return self.s.shape[self.dims.index(axis)]

    def check_count(self, found: int, name: str, axis: str) -> None:
        """Refuse a number of places or angles that differs from the number of samples along an axis."""
        expected = self.count(axis)
        if found != expected:
            raise self.quantities.fail(
                f"there are {found} places of {name} and {expected} samples along {axis!r}; correct one"
            )

    def sweep(self, s: NDArray, axes: tuple[str, ...], coords: dict[str, Any], attrs: dict[str, Any]) -> xr.Dataset:
        """The sweep of samples over the leading axes, frequency and `axes`."""
        coords = {"frequency": ("frequency", self.frequency, {"units": "Hz"}), **coords}
        if any(name.endswith("_position") for name in coords):
            coords["axis"] = list(AXES)
        dims = (*self.dims[: self.dims.index("frequency") + 1], *axes)
        return xr.Dataset({"s": (dims, s.astype(np.complex64))}, coords=coords, attrs=self.attrs | attrs)


def _matrix(samples: ArrangedSamples) -> xr.Dataset:
    """The sweep of samples with axes for transmitters and receivers."""
    tx, rx = _arrays(samples)
    samples.check_count(len(tx), "tx", "tx")
    samples.check_count(len(rx), "rx", "rx")
    return samples.sweep(samples.s, ("tx", "rx"), _pair_coords(tx, rx), {})


def _arrays(samples: ArrangedSamples) -> tuple[Array, Array]:
    """Places of the transmitters and of the receivers [m], (tx, 3) and (rx, 3)."""
    mapping = samples.mapping
    tx, rx = mapping.tx or mapping.elements, mapping.rx or mapping.elements
    assert tx is not None
    assert rx is not None
    counts = [samples.count(axis) if axis in samples.dims else None for axis in ("tx", "rx")]
    return samples.quantities.places(tx, "tx", counts[0]), samples.quantities.places(rx, "rx", counts[1])


def _pair_coords(tx: Array, rx: Array) -> dict[str, Any]:
    """Coordinates of a sweep of pairs."""
    return {
        "tx_position": (("tx", "axis"), tx, {"units": "m"}),
        "rx_position": (("rx", "axis"), rx, {"units": "m"}),
    }


def _pairs(samples: ArrangedSamples) -> xr.Dataset:
    """The sweep of a list of channels, as a full matrix; pairs that were not measured are zero, and marked."""
    pairs, quantities = samples.mapping.pairs, samples.quantities
    assert pairs is not None
    tx, rx = _arrays(samples)
    index = []
    for row, places, name in ((pairs.tx, tx, "tx"), (pairs.rx, rx, "rx")):
        numbers = quantities.row(row, f"pairs.{name}", "number", samples.count("pair"))
        samples.check_count(numbers.size, f"pairs.{name}", "pair")
        whole = np.rint(numbers).astype(int) - pairs.base
        bad = np.flatnonzero((whole < 0) | (whole >= len(places)) | (np.rint(numbers) != numbers))
        if bad.size:
            first, last = pairs.base, pairs.base + len(places) - 1
            raise quantities.fail(
                f"pairs.{name} holds {numbers[bad[0]]:g} as number {bad[0]}, expected whole numbers from {first} to "
                f"{last}; correct it, or the base"
            )
        index.append(whole)
    reciprocal = samples.mapping.reciprocal
    if reciprocal and not (tx.shape == rx.shape and np.allclose(tx, rx, rtol=0.0, atol=SAME_PLACE)):
        raise quantities.fail(
            "reciprocal is true, and transmitters and receivers stand at different places, so that no pair has the "
            "samples of another; leave it out, or give elements in place of tx and rx"
        )
    full, measured = fill_matrix(quantities, samples.s, index[0], index[1], (len(tx), len(rx)), reciprocal=reciprocal)
    coords = _pair_coords(tx, rx)
    if not measured.all():
        coords["measured"] = (("tx", "rx"), measured)
    return samples.sweep(full, ("tx", "rx"), coords, {})


def fill_matrix(
    quantities: Quantities,
    s: NDArray,
    tx: NDArray[np.integer],
    rx: NDArray[np.integer],
    shape: tuple[int, int],
    *,
    reciprocal: bool,
) -> tuple[NDArray, NDArray[np.bool_]]:
    """Samples (..., pairs) as a matrix (..., tx, rx), and which pairs were measured (tx, rx).

    Samples of pairs that were not measured are zero. With `reciprocal`, each pair also counts for the exchanged one.
    """
    numbers, counts = np.unique(tx * shape[1] + rx, return_counts=True)
    if (counts > 1).any():
        twice = divmod(int(numbers[counts > 1][0]), shape[1])
        raise quantities.fail(f"the pair of tx {twice[0]} and rx {twice[1]} (from zero) stands there twice; keep one")
    check_memory(quantities.contents.path, 16.0 * s.size / s.shape[-1] * shape[0] * shape[1], "its full matrix")
    full = np.zeros((*s.shape[:-1], *shape), dtype=np.complex64)
    measured = np.zeros(shape, dtype=bool)
    if reciprocal:
        full[..., rx, tx] = s
        measured[rx, tx] = True
    full[..., tx, rx] = s
    measured[tx, rx] = True
    return full, measured


def _moving(samples: ArrangedSamples) -> xr.Dataset:
    """The sweep of one moving antenna; a motion compensation to reference ranges is undone."""
    mapping, quantities, s = samples.mapping, samples.quantities, samples.s
    assert mapping.antenna is not None
    antenna = quantities.places(mapping.antenna, "antenna", samples.count("position"))
    samples.check_count(len(antenna), "antenna", "position")
    coords = {"antenna_position": (("position", "axis"), antenna, {"units": "m"})}
    if mapping.compensation is None:
        return samples.sweep(s, ("position",), coords, {})
    reference = quantities.row(mapping.compensation.range, "compensation.range", "length", samples.count("position"))
    samples.check_count(reference.size, "compensation.range", "position")
    s = s * np.exp(-4j * np.pi / samples.speed * samples.frequency[:, None] * reference)
    done = [*samples.attrs["processing"], "motion compensation to a reference range undone"]
    return samples.sweep(s, ("position",), coords, {"processing": done})


def _raster(samples: ArrangedSamples) -> xr.Dataset:
    """The sweep of beams on a grid of azimuths and elevations, both made rising."""
    s, coords = samples.s, {}
    for at, name in ((-2, "azimuth"), (-1, "elevation")):
        angle = samples.quantities.row(getattr(samples.mapping, name), name, "angle", samples.count(name))
        samples.check_count(angle.size, name, name)
        if angle.size > 1 and np.all(np.diff(angle) < 0):
            angle, s = angle[::-1], np.flip(s, at)
        coords[name] = (name, angle, {"units": "degree"})
    return samples.sweep(s, ("azimuth", "elevation"), coords, {"origin": np.array(samples.mapping.origin)})


def _beams(samples: ArrangedSamples) -> xr.Dataset:
    """The sweep of a list of beams, put on the grid of their angles."""
    angles = []
    for name in ("azimuth", "elevation"):
        angle = samples.quantities.row(getattr(samples.mapping, name), name, "angle", samples.count("beam"))
        samples.check_count(angle.size, name, "beam")
        angles.append(angle)
    azimuth, elevation, full = grid_beams(samples.quantities, samples.s, *angles)
    coords = {
        "azimuth": ("azimuth", azimuth, {"units": "degree"}),
        "elevation": ("elevation", elevation, {"units": "degree"}),
    }
    return samples.sweep(full, ("azimuth", "elevation"), coords, {"origin": np.array(samples.mapping.origin)})


def grid_beams(quantities: Quantities, s: NDArray, azimuth: Array, elevation: Array) -> tuple[Array, Array, NDArray]:
    """Samples (..., beams) as (..., azimuth, elevation), with the angles [degree] of the grid.

    Raises
    ------
    InputError
        If the beams are not the points of a grid, each once.
    """
    columns, ix = np.unique(azimuth.round(ANGLE_DIGITS), return_inverse=True)
    rows, iy = np.unique(elevation.round(ANGLE_DIGITS), return_inverse=True)
    number = ix * rows.size + iy
    if np.unique(number).size != number.size:
        twice = int(np.flatnonzero(np.bincount(number) > 1)[0])
        raise quantities.fail(
            f"the beam at azimuth {columns[twice // rows.size]:g} and elevation {rows[twice % rows.size]:g} degrees "
            "stands there twice; keep one"
        )
    if number.size != columns.size * rows.size:
        raise quantities.fail(
            f"there are {number.size} beams with {columns.size} azimuths and {rows.size} elevations, expected all "
            f"{columns.size * rows.size}; measure the missing ones, or leave out incomplete rows"
        )
    full = np.empty((*s.shape[:-1], columns.size, rows.size), dtype=np.complex64)
    full[..., ix, iy] = s
    return columns, rows, full


ARRANGEMENTS: dict[tuple[str, ...], Callable[[ArrangedSamples], xr.Dataset]] = {
    ("tx", "rx"): _matrix,
    ("pair",): _pairs,
    ("position",): _moving,
    ("azimuth", "elevation"): _raster,
    ("beam",): _beams,
}
"""The possible axes beside frequency, in the order of a sweep, and the function that makes a sweep of each."""
