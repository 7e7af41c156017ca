"""Delay, gain and phase of every element, from the echo of a sphere or another point-like reflector.

Transmitter i, receiver k, and a reflector with the path length d_ik over it give at the wavenumber k_m the sample

``S[m, i, k] = a[m] g_i h_k exp(-j k_m (d_ik + t_i + r_k))``

with the delays t, r as path lengths [m] and complex gains g, h. Only the sums t_i + r_k can be observed; the common
part is divided equally, so that the mean of t equals the mean of r. The displacement of an element's phase centre shows
as a delay that depends on the direction. With the reflector at several places it can be separated from other delays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from mirrorfold.calibration.common_delay import fit_reflectors
from mirrorfold.calibration.delays import Fit
from mirrorfold.calibration.record import by_blocks, check_same_axes, checked_pairs, history, with_samples
from mirrorfold.calibration.reflectors import positions
from mirrorfold.common.arguments import boolean, wrong_kind
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.sweep import ambiguous_range, wavenumber

LARGEST_ERROR = 5e-3
"""Largest difference between one element's delay and the others' that is searched by default [m]; also the largest
difference between the antenna positions of a sweep and those of a calibration for it."""

CALIBRATION = "an ElementCalibration, as estimate_elements and load_elements return"
"""Description of an element calibration in messages."""

ROUNDING = 1e-9
"""Rounding error of stated positions [m]: another element must be closer to a position by more than this before the
order of the antennas is taken to be wrong."""

OFFSET_CONDITION = 1e-3
"""Smallest singular value of the directions to the reflectors, as a share of the largest, along which a phase-centre
offset is estimated. Along others, noise would give offsets of centimetres."""


@dataclass(frozen=True, eq=False)
class ElementCalibration:
    """Delays, gains and phase-centre offsets of all elements of an array.

    Attributes
    ----------
    tx_delay, rx_delay : (tx,) and (rx,) arrays [m]
        Path length that the element adds. Each includes half of the path length that all pairs share, such as cables.
    tx_gain, rx_gain : (tx,) and (rx,) complex arrays
        Gains relative to the median element.
    tx_offset, rx_offset : (tx, 3) and (rx, 3) arrays [m]
        From the stated position to the phase centre; zero if the reflector was measured at one place only.
    tx_valid, rx_valid : (tx,) and (rx,) arrays of bool
        Whether the reflector's echo showed in the element's pairs; an element without it has the mean delay of the
        others.
    tx_position, rx_position : (tx, 3) and (rx, 3) arrays [m]
        The stated positions, by which the array is recognised.
    residual : float [m]
        Root mean square of what the delays leave unexplained, over the valid pairs.
    """

    tx_delay: Array
    rx_delay: Array
    tx_gain: NDArray[np.complex128]
    rx_gain: NDArray[np.complex128]
    tx_offset: Array
    rx_offset: Array
    tx_valid: NDArray[np.bool_]
    rx_valid: NDArray[np.bool_]
    tx_position: Array
    rx_position: Array
    residual: float

    @property
    def common_delay(self) -> float:
        """Path length that all pairs share [m], that of the cables, known modulo the period ``c / df`` of the sweep."""
        return float(self.tx_delay[self.tx_valid].mean() + self.rx_delay[self.rx_valid].mean())


def estimate_elements(
    sweep: xr.Dataset | Sequence[xr.Dataset],
    *,
    at: ArrayLike | Sequence[ArrayLike],
    radius: float = 0.0,
    largest_error: float = LARGEST_ERROR,
    largest_common: float | None = None,
) -> ElementCalibration:
    """Estimate delays, gains and phase-centre offsets of all elements, from a point-like reflector at known places.

    First the delay that all pairs share is found, see `mirrorfold.calibration.common_delay`. Medians over the pairs
    then give first values of every element's delay, and these are refined until the element's samples add up to the
    largest sum. Pairs that do not fit count less. If the elements have no phases of their own, the phase of the carrier
    refines the delays further. Single channels that are dead or wrong, and other echoes that arrive more than a range
    cell later, do no harm.

    Parameters
    ----------
    sweep : xarray.Dataset, or several
        Sweeps of the reflector, best with the background subtracted; one for each place.
    at : (2,) or (3,) [m], or several
        The middle of the sphere, in each of the sweeps.
    radius : float [m], default 0
        Of the sphere.
    largest_error : float [m], default 5 mm
        Largest difference between the delay of an element and that of the others.
    largest_common : float [m], optional
        Largest delay that all pairs share, such as what is left of cables. By default any delay, so that metres of
        cable are found too, modulo the period ``c / df`` of the sweep, which makes no difference in images.

    Returns
    -------
    ElementCalibration

    Raises
    ------
    InputError
        If the sweeps are not of the same array, or the reflector's echo does not show.
    """
    found = fit_reflectors(sweep, at, radius, largest_error=largest_error, largest_common=largest_common)
    for number, (other, *_) in enumerate(found[1:], 2):
        check_same_axes(found[0][0], other, f"sweep {number}")
    tx, rx = positions(found[0][0])
    fits, centres = [fit for *_, fit in found], [centre for _, centre, _ in found]
    tx_valid = np.all([fit.tx_valid for fit in fits], axis=0)
    rx_valid = np.all([fit.rx_valid for fit in fits], axis=0)
    offsets = _resolve_offsets(fits, tx, rx, centres)
    tx_gain = np.mean([fit.tx_gain for fit in fits], axis=0)
    rx_gain = np.mean([fit.rx_gain for fit in fits], axis=0)
    return ElementCalibration(
        tx_delay=np.where(tx_valid, offsets[0], offsets[0][tx_valid].mean()),
        rx_delay=np.where(rx_valid, offsets[1], offsets[1][rx_valid].mean()),
        tx_gain=np.where(tx_valid, tx_gain, 1.0),
        rx_gain=np.where(rx_valid, rx_gain, 1.0),
        tx_offset=np.where(tx_valid[:, None], offsets[2], 0.0),
        rx_offset=np.where(rx_valid[:, None], offsets[3], 0.0),
        tx_valid=tx_valid,
        rx_valid=rx_valid,
        tx_position=tx,
        rx_position=rx,
        residual=float(np.sqrt(np.mean([fit.residual**2 for fit in fits]))),
    )


def apply_elements(sweep: xr.Dataset, calibration: ElementCalibration, *, gains: bool = True) -> xr.Dataset:
    """Remove the elements' delays and gains from a sweep, and move the antenna positions to their phase centres.

    Parameters
    ----------
    sweep : xarray.Dataset
        A sweep of the array that was calibrated; all frames and polarizations are treated alike.
    calibration : ElementCalibration
    gains : bool, default True
        Remove the complex gains too, not only the delays.

    Returns
    -------
    xarray.Dataset

    Raises
    ------
    InputError
        If the array is another one, or has its antennas in another order, or the calibration has been applied before.
    """
    sweep, gains = checked_pairs(sweep, "sweep", several=True), boolean("gains", gains)
    if not isinstance(calibration, ElementCalibration):
        raise wrong_kind("calibration", calibration, CALIBRATION, reader="mf.calibrate.load_elements")
    tx, rx = positions(sweep)
    for name, mine, known in (("tx", tx, calibration.tx_position), ("rx", rx, calibration.rx_position)):
        if mine.shape != known.shape:
            raise InputError(
                f"the sweep has {len(mine)} {name} positions and the calibration {len(known)}; "
                "calibrate with a sweep of the same array"
            )
        apart = float(np.linalg.norm(mine - known, axis=1).max())
        if apart > LARGEST_ERROR:
            raise InputError(
                f"the {name} positions of sweep and calibration differ by up to {1e3 * apart:.3g} mm; "
                "calibrate with a sweep of the same array"
            )
        mine, known = mine - mine.mean(axis=0), known - known.mean(axis=0)
        other = cKDTree(known).query(mine)[0] < np.linalg.norm(mine - known, axis=1) - ROUNDING
        if other.any():
            raise InputError(
                f"the {name} position {int(np.argmax(other))} of the sweep is that of another element of the "
                "calibration; bring the antennas of both into one order"
            )
    step = _step(calibration, ambiguous_range(sweep), gains=gains)
    if step in history(sweep):
        raise InputError(f"the sweep has been through '{step}' before; give the sweep as it was measured")
    k = wavenumber(sweep)
    gain = calibration.tx_gain[:, None] * calibration.rx_gain if gains else 1.0

    def undone(part: NDArray[np.complexfloating], some: slice) -> NDArray[np.complexfloating]:
        turned = part * np.exp(1j * k[some, None] * calibration.tx_delay)[:, :, None]
        turned *= np.exp(1j * k[some, None] * calibration.rx_delay)[:, None, :]
        return np.asarray(turned / gain)

    s = by_blocks(sweep["s"].values, undone, axis=sweep["s"].get_axis_num("frequency"))
    moved = {
        name: (sweep[name].dims, place + offset, sweep[name].attrs)
        for name, place, offset in (
            ("tx_position", tx, calibration.tx_offset),
            ("rx_position", rx, calibration.rx_offset),
        )
    }
    return with_samples(sweep.assign_coords(moved), s, step)


def _step(calibration: ElementCalibration, ambiguous: float, *, gains: bool) -> str:
    """The line of the history for a calibration, applied to a sweep with this ambiguous range [m]."""
    common = calibration.common_delay
    sides = (calibration.tx_delay, calibration.tx_valid), (calibration.rx_delay, calibration.rx_valid)
    largest = max(float(np.abs(delay - delay[valid].mean()).max(initial=0.0)) for delay, valid in sides)
    away = max(float(np.abs(o).max(initial=0.0)) for o in (calibration.tx_offset, calibration.rx_offset))
    step = f"delays{' and gains' if gains else ''} of the elements removed, up to {1e3 * largest:.4g} mm"
    step += f", and {common:.6g} m of cable (modulo {2.0 * ambiguous:.6g} m)"
    return step + (f", phase centres moved by up to {1e3 * away:.4g} mm" if away > 0 else "")


def _resolve_offsets(
    fits: Sequence[Fit], tx: Array, rx: Array, centres: Sequence[Array]
) -> tuple[Array, Array, Array, Array]:
    """Delays t and phase-centre offsets delta from the delays of several fits, ``e_n = t - u_n . delta +- c_n``.

    The reflector at place n lies in the direction u_n from the element. An offset of the phase centre towards the
    reflector shortens the path. How a fit divides delays between transmitters and receivers is arbitrary, hence the
    constants ``c_n``, added to all transmitters and subtracted from all receivers.

    Returns the delays (tx,) and (rx,), and the offsets (tx, 3) and (rx, 3) [m].
    """
    if len(fits) == 1:
        return fits[0].tx_delay, fits[0].rx_delay, np.zeros_like(tx), np.zeros_like(rx)
    seen = [np.stack([fit.tx_delay for fit in fits]), np.stack([fit.rx_delay for fit in fits])]
    towards = [
        np.stack([(centre - antennas) / np.linalg.norm(centre - antennas, axis=1)[:, None] for centre in centres])
        for antennas in (tx, rx)
    ]
    share = np.zeros(len(fits))
    delay: list[Array] = []
    offset: list[Array] = []
    for _ in range(SHARING_ITERATIONS):
        delay, offset, left = [], [], []
        for measured, direction, sign in zip(seen, towards, (1.0, -1.0), strict=True):
            t, delta = _per_element(measured - sign * share[:, None], direction)
            delay.append(t)
            offset.append(delta)
            predicted = t - np.einsum("nia,ia->ni", direction, delta)
            left.append(np.median(measured - predicted, axis=1))
        share = 0.5 * (left[0] - left[1])
        share -= share.mean()
    return delay[0], delay[1], offset[0], offset[1]


SHARING_ITERATIONS = 20
"""Alternations between the delays and offsets of the elements and the constants ``c_n``, until neither changes."""


def _per_element(measured: Array, direction: Array) -> tuple[Array, Array]:
    """Delays t (elements,) and offsets delta (elements, 3) that fit ``e_n = t - u_n . delta`` best, per element.

    `measured` (places, elements) holds e, `direction` (places, elements, 3) u. Of several solutions with the same
    misfit, the offset is the smallest.
    """
    delay, offset = np.empty(measured.shape[1]), np.empty((measured.shape[1], 3))
    for element in range(measured.shape[1]):
        towards = direction[:, element]
        # A delay is the same for all places of the reflector; only the differences of the directions tell the offset.
        spread = towards - towards.mean(axis=0)
        inverse = np.linalg.pinv(spread, rcond=OFFSET_CONDITION)
        offset[element] = -inverse @ (measured[:, element] - measured[:, element].mean())
        delay[element] = np.mean(measured[:, element] + towards @ offset[element])
    return delay, offset
