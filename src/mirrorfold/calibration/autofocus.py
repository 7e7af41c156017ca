"""Autofocus: small errors of the elements' positions, estimated from the measurement itself and removed as delays.

The brightest points of the image serve as guide stars. If all positions were right, the contributions of all pairs to a
guide star would have the same phase. So the delays of the elements are found that bring the contributions to all guide
stars into phase, as far as possible: phase-gradient autofocus (Wahl, Eichel, Ghiglia and Jakowatz, IEEE Trans. Aerosp.
Electron. Syst. 30, 1994), here for two arrays. The delays are kept only if the entropy of the image falls.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter

from mirrorfold.calibration.record import by_blocks, checked_pairs, recorded, with_samples
from mirrorfold.calibration.reflectors import positions
from mirrorfold.common.arguments import whole_number
from mirrorfold.common.types import Array, Complex
from mirrorfold.common.windows import hann
from mirrorfold.errors import InputError
from mirrorfold.focusing import focus
from mirrorfold.focusing.grid import default_grid
from mirrorfold.focusing.problem import pixel_axis
from mirrorfold.sweep import wave_speed, wavenumber

GUIDES = 32
"""Number of guide stars: so many that the echoes beside them average out, so few that all of them are bright."""

ROUNDS = 4
"""Largest number of rounds; each chooses new guide stars in the sharper image of the round before."""

ITERATIONS = 30
"""Alternations between transmitters and receivers in each round."""

PIXELS = 300_000
"""Largest number of pixels of the image in which guide stars are chosen."""

TOLERANCE = 1e-2
"""Relative error of that image."""

SEPARATION = 5
"""Distance in pixels, along x and along y, within which a guide star is the brightest point."""


def autofocus(
    sweep: xr.Dataset,
    *,
    x: ArrayLike | None = None,
    y: ArrayLike | None = None,
    guides: int = GUIDES,
    progress: Callable[[int, int], None] | None = None,
) -> xr.Dataset:
    """Remove those small delays of the elements from the sweep that make its image sharpest.

    Errors beyond a quarter of a wavelength, and those that shift or tilt the whole image, cannot be found this way.

    Parameters
    ----------
    sweep : xarray.Dataset
    x, y : 1D arrays [m], optional
        The region of the guide stars, as for `mirrorfold.focus`; by default everything that the array sees.
    guides : int, default 32
        Number of guide stars.
    progress : callable, optional
        Called as ``progress(done, total)`` after every image; there may be fewer images than the total.

    Returns
    -------
    xarray.Dataset
        With the removed delays in the attrs `autofocus_tx_delay` and `autofocus_rx_delay` [m], and in its history the
        entropy and the contrast of the image before and after. Where nothing can be gained, only the history changes.

    Raises
    ------
    InputError
        If the sweep has less than three transmitters and less than three receivers, or its image is empty.
    """
    sweep = checked_pairs(sweep, "sweep")
    tx, rx = positions(sweep)
    if max(len(tx), len(rx)) < 3:
        raise InputError("autofocus: the sweep has less than three elements, whose delays cannot be told from a shift")
    guides = whole_number("guides", guides, lowest=1)
    own_x, own_y = guide_grid(sweep)
    grid = pixel_axis(own_x if x is None else x, "x"), pixel_axis(own_y if y is None else y, "y")
    k = wavenumber(sweep)
    centre = float(k.mean())
    report = progress or (lambda done, total: None)
    before = amplitude = _image(sweep, *grid)
    report(1, ROUNDS + 1)
    best, tx_total, rx_total = sweep, np.zeros(len(tx)), np.zeros(len(rx))
    for done in range(ROUNDS):
        stars = _guide_stars(amplitude, *grid, guides)
        contribution = _contributions(best, stars)
        tx_delay, rx_delay = _delays(contribution, centre)
        tx_delay, rx_delay = _without_shift(tx_delay, tx), _without_shift(rx_delay, rx)
        turns = [np.exp(1j * k[:, None] * delay) for delay in (tx_delay, rx_delay)]
        turned = by_blocks(best["s"].values, partial(_turned, *turns))
        tried = best.assign(s=best["s"].copy(data=turned))
        sharper = _image(tried, *grid)
        report(done + 2, ROUNDS + 1)
        if not entropy(sharper) < entropy(amplitude):
            break
        best, amplitude = tried, sharper
        tx_total += tx_delay
        rx_total += rx_delay
    change = (
        f"entropy {entropy(before):.4g} to {entropy(amplitude):.4g}, "
        f"contrast {contrast(before):.4g} to {contrast(amplitude):.4g}"
    )
    if best is sweep:
        return recorded(sweep, f"autofocus: nothing to be gained, {change}")
    largest = 1e6 * max(np.abs(tx_total).max(), np.abs(rx_total).max())
    found = with_samples(sweep, best["s"].values, f"autofocus: delays of up to {largest:.3g} um removed, {change}")
    return found.assign_attrs(autofocus_tx_delay=tx_total, autofocus_rx_delay=rx_total)


def _turned(
    tx_turn: Complex, rx_turn: Complex, samples: NDArray[np.complexfloating], some: slice
) -> NDArray[np.complexfloating]:
    """Samples (frequencies, tx, rx) of `some` frequencies, times the phase factors of both elements.

    The phase factors are (frequencies, tx) and (frequencies, rx), for all frequencies.
    """
    return np.asarray(samples * (tx_turn[some, :, None] * rx_turn[some, None, :]))


def guide_grid(sweep: xr.Dataset) -> tuple[Array, Array]:
    """Pixels x and y [m] of the image in which guide stars are chosen: everything that the array sees.

    Raises
    ------
    InputError
        If the sweep is none of pairs.
    """
    frequency = checked_pairs(sweep, "autofocus")["frequency"].values.astype(float)
    return default_grid(frequency, *positions(sweep), wave_speed(sweep), maximum_pixels=PIXELS)


def entropy(amplitude: NDArray[np.floating]) -> float:
    """Entropy ``-sum p ln p`` of an image, with each pixel's share p of the power; small for a sharp image."""
    power = np.abs(amplitude).astype(float).ravel() ** 2
    share = power[power > 0] / power.sum()
    return float(-np.sum(share * np.log(share)))


def contrast(amplitude: NDArray[np.floating]) -> float:
    """Contrast of an image: standard deviation over mean of the pixels' power; large for a sharp image."""
    power = np.abs(amplitude).astype(float) ** 2
    return float(power.std() / power.mean())


def _image(sweep: xr.Dataset, x: Array, y: Array) -> NDArray[np.floating]:
    """Amplitudes (y, x) of the image, times range to undo the spreading of waves, so that distant guide stars count."""
    return np.asarray(np.abs(focus(sweep, x=x, y=y, tolerance=TOLERANCE, normalization="r").values))


def _guide_stars(amplitude: NDArray[np.floating], x: Array, y: Array, count: int) -> Array:
    """Positions (stars, 3) [m] of the brightest maxima of an image; each is the maximum within `SEPARATION` pixels."""
    peak = (amplitude == maximum_filter(amplitude, 2 * SEPARATION + 1)) & (amplitude > 0)
    row, column = np.nonzero(peak)
    if row.size == 0:
        raise InputError("autofocus: the image is empty; give a region that holds echoes")
    order = np.argsort(amplitude[row, column])[::-1][:count]
    return np.column_stack([x[column[order]], y[row[order]], np.zeros(order.size)])


def _contributions(sweep: xr.Dataset, stars: Array) -> NDArray[np.complex128]:
    """Contribution of every pair to the image at every guide star, (stars, tx, rx)."""
    tx, rx = positions(sweep)
    s = sweep["s"].values
    k = wavenumber(sweep)
    taper = hann(k.size)
    found = np.empty((len(stars), len(tx), len(rx)), dtype=complex)
    for n, star in enumerate(stars):
        to_tx = np.exp(1j * k[:, None] * np.linalg.norm(star - tx, axis=1)).astype(np.complex64)
        to_rx = np.exp(1j * k[:, None] * np.linalg.norm(star - rx, axis=1)).astype(np.complex64)
        found[n] = np.einsum("mik,mi,mk->ik", s, taper[:, None].astype(np.float32) * to_tx, to_rx)
    return found


def _delays(contribution: NDArray[np.complex128], centre: float) -> tuple[Array, Array]:
    """Delays t (tx,) and r (rx,) [m] that make the guide stars brightest.

    They maximise ``sum over stars |sum_ik y_ik exp(j k (t_i + r_k))|^2`` with the contributions y (stars, tx, rx) and
    the wavenumber k at mid-band, `centre` [rad/m], in turn over the transmitters and over the receivers.
    """
    tx_turn = np.ones(contribution.shape[1], dtype=complex)
    rx_turn = np.ones(contribution.shape[2], dtype=complex)
    for _ in range(ITERATIONS):
        by_tx = contribution @ rx_turn
        star = by_tx @ tx_turn
        tx_turn = _unit(np.conj(np.conj(star) @ by_tx))
        by_rx = np.einsum("nik,i->nk", contribution, tx_turn)
        star = by_rx @ rx_turn
        rx_turn = _unit(np.conj(np.conj(star) @ by_rx))
    delays = []
    for turn in (tx_turn, rx_turn):
        phase = np.angle(turn * np.exp(-1j * np.angle(turn.sum())))
        delays.append(phase / centre)
    return delays[0], delays[1]


def _unit(value: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Phase factors of complex numbers; one for zero."""
    magnitude = np.abs(value)
    return np.where(magnitude > 0, value / np.where(magnitude > 0, magnitude, 1.0), 1.0)


def _without_shift(delay: Array, position: Array) -> Array:
    """Delays without their constant and their slope along the array, which only shift or tilt the image."""
    columns = np.column_stack([np.ones(len(delay)), position - position.mean(axis=0)])
    return np.asarray(delay - columns @ np.linalg.lstsq(columns, delay, rcond=1e-6)[0])
