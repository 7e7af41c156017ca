"""The focusing problem: antennas, wavenumbers, weights and pixels of one focusing sum, in float64, without samples."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.constants import speed_of_light

from mirrorfold.common.arguments import expect_unit
from mirrorfold.common.statistics import mean_step
from mirrorfold.common.types import Array, Complex, Index
from mirrorfold.common.windows import window
from mirrorfold.errors import InputError

COINCIDENT_PHASE = 1e-5
"""Two antennas at the distance d stand at the same place if their phase difference k d [rad] is smaller than this."""


class UnsuitedError(Exception):
    """A fast algorithm cannot image this geometry, or would not be faster than the exact sum."""


@dataclass(frozen=True, eq=False)
class Problem:
    """The sum ``I(p) = sum_m,i,k a[m] w[i] v[k] S[m,i,k] exp(+j k_m (R_i(p) + R_k(p)))`` without the samples S.

    R_i(p) and R_k(p) are the distances of pixel p from transmitter i and receiver k.

    Attributes
    ----------
    k : (frequencies,) array [rad/m]
        Wavenumbers k_m, in uniform steps.
    tx, rx : (tx, 3), (rx, 3) arrays [m]
        Positions of the transmitters and of the receivers.
    taper : (frequencies,) complex array
        Weights a over frequency.
    tx_weight, rx_weight : (tx,), (rx,) complex arrays
        Weights w and v over the transmitters and the receivers.
    x, y, z : 1D arrays [m]
        Coordinates of the pixel grid: there is a pixel at every (x, y, z).
    monostatic : bool
        One moving antenna, or antennas that each receive only their own echoes: `tx` and `rx` list the same places,
        and the samples are ``S[m, i]``.
    """

    k: Array
    tx: Array
    rx: Array
    taper: Complex
    tx_weight: Complex
    rx_weight: Complex
    x: Array
    y: Array
    z: Array
    monostatic: bool = False

    @classmethod
    def usual(
        cls, frequency: Array, tx: Array, rx: Array, x: Array, y: Array, z: Array, *, monostatic: bool = False
    ) -> Problem:
        """The default sum of `focus`, at the speed of light: Hann taper over `frequency` [Hz], equal antennas."""
        return cls(
            k=2.0 * np.pi * frequency / speed_of_light,
            tx=tx,
            rx=rx,
            taper=window("hann", frequency.size, "taper"),
            tx_weight=window(None, len(tx), "apodization"),
            rx_weight=window(None, len(rx), "apodization"),
            x=x,
            y=y,
            z=z,
            monostatic=monostatic,
        )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Number of pixels along (z, y, x)."""
        return self.z.size, self.y.size, self.x.size

    @property
    def pixels(self) -> int:
        """Number of pixels."""
        return self.z.size * self.y.size * self.x.size

    @property
    def pairs(self) -> int:
        """Number of transmitter-receiver pairs."""
        return len(self.tx) if self.monostatic else len(self.tx) * len(self.rx)

    @property
    def data_shape(self) -> tuple[int, ...]:
        """Expected shape of the data of one frame."""
        return (self.k.size, len(self.tx)) if self.monostatic else (self.k.size, len(self.tx), len(self.rx))

    @property
    def coincident(self) -> bool:
        """Whether the transmitters stand at the places of the receivers, in the same order."""
        if self.tx.shape != self.rx.shape:
            return False
        return bool(np.abs(self.k).max() * np.abs(self.tx - self.rx).max() < COINCIDENT_PHASE)

    @property
    def key(self) -> bytes:
        """Hash of all attributes, the same for equal problems."""
        digest = hashlib.sha256(repr((self.monostatic, self.shape, self.data_shape)).encode())
        for part in (self.k, self.tx, self.rx, self.taper, self.tx_weight, self.rx_weight, self.x, self.y, self.z):
            digest.update(np.ascontiguousarray(part).tobytes())
        return digest.digest()

    def points(self, flat: NDArray[np.integer]) -> Array:
        """Coordinates (x, y, z) [m] of the pixels with these flat indices in (z, y, x) order, shape (n, 3)."""
        iz, iy, ix = np.unravel_index(flat, self.shape)
        return np.stack([self.x[ix], self.y[iy], self.z[iz]], axis=-1)

    @property
    def in_wavelengths(self) -> Problem:
        """The same sum with all lengths in mean wavelengths.

        The algorithms are given the problem in this form, so that radars and scenes which differ only in scale are
        treated alike.
        """
        turns = float(self.k.mean()) / (2.0 * np.pi)
        lengths = {name: getattr(self, name) * turns for name in ("tx", "rx", "x", "y", "z")}
        return replace(self, k=self.k / turns, **lengths)

    @property
    def antennas(self) -> int:
        """Number of antennas; where transmitters and receivers coincide, each place counts once."""
        return len(self.rx) if self.coincident else len(self.tx) + len(self.rx)

    @property
    def radar_position(self) -> Array:
        """Position of the radar [m], (3,): half way between the mean transmitter and the mean receiver."""
        return np.asarray(0.5 * (self.tx.mean(axis=0) + self.rx.mean(axis=0)))

    @property
    def middle_wavenumber(self) -> float:
        """Wavenumber k_c [rad/m] at the middle of the band."""
        return float(self.k[self.k.size // 2])

    @property
    def wavenumber_step(self) -> float:
        """Difference of neighbouring wavenumbers [rad/m]; zero for a single frequency."""
        return mean_step(self.k)

    def of(self, tx: Index, rx: Index) -> Problem:
        """The same sum over some of the antennas, given by their indices."""
        return replace(self, tx=self.tx[tx], rx=self.rx[rx], tx_weight=self.tx_weight[tx], rx_weight=self.rx_weight[rx])

    def reversed(self) -> Problem:
        """The same sum with transmitters and receivers exchanged."""
        return replace(self, tx=self.rx, rx=self.tx, tx_weight=self.rx_weight, rx_weight=self.tx_weight)

    def on(self, x: Array, y: Array, z: Array) -> Problem:
        """The same measurement on other pixels."""
        return replace(self, x=x, y=y, z=z)


def pixel_axis(values: ArrayLike, name: str) -> Array:
    """1D pixel coordinates [m] as float64; a single number is one pixel.

    Raises
    ------
    InputError
        If they are not a rising or falling row of finite numbers.
    """
    expect_unit(name, values, "m")
    try:
        held = np.asarray(values)
        axis = np.ascontiguousarray(held.astype(object) if held.dtype.kind in "mM" else held, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} holds values that are not numbers; give 1D pixel coordinates in metres") from None
    if axis.ndim != 1 or axis.size == 0:
        raise InputError(f"{name} has shape {axis.shape}, expected a 1D array of pixel coordinates in metres")
    if not np.isfinite(axis).all():
        raise InputError(f"{name} holds values that are not finite; give every pixel its coordinate in metres")
    steps = np.diff(axis)
    if axis.size > 1 and not ((steps > 0).all() or (steps < 0).all()):
        raise InputError(f"{name} is not sorted; give pixel coordinates that only rise (or only fall)")
    return axis
