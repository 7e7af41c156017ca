"""A sweep as a list of pairs of a transmitter and a receiver, whether it was measured by arrays or a moving antenna."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.types import Array
from mirrorfold.sweep.facts import antenna_positions, radar_position, wavenumber

LINE_WIDTH = 0.5
"""Half width, in wavelengths, of the row of elements that is picked from a planar array."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """Samples of pairs of a transmitter and a receiver.

    Attributes
    ----------
    s : (frequencies, pairs) complex array
    wavenumber : (frequencies,) array [rad/m]
        Rising.
    tx, rx : (tx, 3) and (rx, 3) arrays [m]
        Positions relative to the middle of the array.
    tx_of, rx_of : (pairs,) arrays of int
        Indices of each pair's transmitter in `tx` and receiver in `rx`.
    """

    s: NDArray[np.complexfloating]
    wavenumber: Array
    tx: Array
    rx: Array
    tx_of: NDArray[np.int64]
    rx_of: NDArray[np.int64]

    @property
    def wavelength(self) -> float:
        """Wavelength at mid-band [m]."""
        return float(2.0 * np.pi / self.wavenumber.mean())

    @property
    def axes(self) -> Array:
        """Unit vectors along the arrays and across them, (3, 3), however far the arrays stand from each other."""
        offsets = np.concatenate([self.tx - self.tx.mean(axis=0), self.rx - self.rx.mean(axis=0)])
        return np.asarray(np.linalg.svd(offsets, full_matrices=offsets.shape[0] < 3)[2])

    @property
    def moving(self) -> bool:
        """Whether each transmitter has one receiver, as one antenna, or two, that move: a step counts on both ways."""
        return np.array_equal(self.tx_of, self.rx_of)

    def scaled(self, factor: float) -> Pairs:
        """The same samples with all positions multiplied by a factor."""
        return replace(self, tx=factor * self.tx, rx=factor * self.rx)


def pairs_of(sweep: xr.Dataset) -> Pairs:
    """The pairs of a sweep ``s(frequency, tx, rx)``, or of one moving antenna, ``s(frequency, position)``.

    If the samples have further dimensions before these, such as polarization, the first entry of each is taken.
    """
    k, (tx, rx), origin = wavenumber(sweep), antenna_positions(sweep), radar_position(sweep)
    if "antenna_position" in sweep.variables:
        tx_of = rx_of = np.arange(len(tx))
        s = sweep["s"].values.reshape(-1, *sweep["s"].shape[-2:])[0]
    else:
        tx_of, rx_of = (index.ravel() for index in np.indices((len(tx), len(rx))))
        s = sweep["s"].values.reshape(-1, *sweep["s"].shape[-3:])[0].reshape(k.size, -1)
    return Pairs(s, k, tx - origin, rx - origin, tx_of, rx_of)


def on_a_line(pairs: Pairs) -> Pairs:
    """The pairs whose antennas stand on one line along the array; for a planar array, those of its middle row."""
    across = pairs.axes[1:]
    width = LINE_WIDTH * pairs.wavelength
    near = [_near_middle(places @ across.T, width) for places in (pairs.tx, pairs.rx)]
    if all(mask.all() for mask in near):
        return pairs
    keep = near[0][pairs.tx_of] & near[1][pairs.rx_of]
    return replace(pairs, s=pairs.s[:, keep], tx_of=pairs.tx_of[keep], rx_of=pairs.rx_of[keep])


def _near_middle(across: Array, width: float) -> NDArray[np.bool_]:
    """Which places (n, 2), given across the array, lie within a width of the row nearest to the middle; (n,)."""
    middle = across - np.median(across, axis=0)
    row = across[np.argmin(np.linalg.norm(middle, axis=1))]
    return np.asarray(np.abs(across - row).max(axis=1) <= width)
