"""Errors of the antennas' positions: how they change level and place of a point's image, after none to three folds.

The samples are computed for the places where the antennas really stand, and focused for the places where they should
stand. Random errors cost level. Errors that all positions share move the point.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light
from scipy.interpolate import RectBivariateSpline
from scipy.optimize import minimize

import mirrorfold as mf
from mirrorfold.common.types import Array
from mirrorfold.reproducing.parts.hall import CHAINS, PITCH, START, STOP, drawn, unfolding

COMMON = {"scale": 1e-3, "turned": np.radians(0.1), "cable": 1e-3}
"""Errors that all positions share: relative error of a step; angle between the two stages, which should be parallel
[rad]; length of the cable that was not removed, there and back [m]."""

EFFECTS = {
    "random": "random",
    "scale": "steps 0.1 % too long",
    "turned": "one stage turned by 0.1 degree",
    "cable": "1 mm of cable too much",
}
"""The kinds of errors, and their names in tables."""

FREQUENCIES = 201
"""Number of frequencies: unambiguous up to a range of 3 m."""

HALF, PIXELS = 0.035, 41
"""Half the side of the image around the point [m], and its pixels along a side."""


def antenna_errors(seeds: Iterable[int], spreads: Sequence[float], *, elements: int, trials: int) -> xr.Dataset:
    """Level and place of a point, imaged as if all antennas stood where they should.

    The point is seen in line of sight and by way of one to three mirrors. Each path to the point is as long as the
    straight line from the antenna to the point's mirror image, so the samples are computed from the mirror images.
    Transmitters and receivers stand on stages of their own.

    Parameters
    ----------
    seeds : iterable of int
        Seeds of the places of the target.
    spreads : sequence of float [m]
        Standard deviations of random errors of each coordinate.
    elements : int
        Number of positions of each stage.
    trials : int
        Number of draws of random errors.

    Returns
    -------
    Dataset
        `level_db`, relative to exact positions; `shift` of the folded point and the shift that is `predicted` [m]
        (draw, effect, spread, trial, folds). Errors that all positions share have one size and one trial.
    """
    seeds = list(seeds)
    shape = (len(seeds), len(EFFECTS), len(spreads), trials, len(CHAINS))
    level, shift, predicted = (np.full(shape, np.nan) for _ in range(3))
    for row, seed in enumerate(seeds):
        mirrors, target = drawn(seed)
        for folds, chain in enumerate(CHAINS):
            fold = unfolding(mirrors, chain)
            ghost = fold.inverse(target)
            nominal = _nominal(elements)
            exact, at = _peak(ghost, nominal, nominal, nominal, 0.0)
            for column, effect in enumerate(EFFECTS):
                for size in range(len(spreads) if effect == "random" else 1):
                    for trial in range(trials if effect == "random" else 1):
                        random = np.random.default_rng([seed, size, trial])
                        tx, rx, cable = _displaced(effect, elements, spreads[size], random)
                        found, place = _peak(ghost, nominal, tx, rx, cable)
                        where = row, column, size, trial, folds
                        level[where] = 20.0 * np.log10(found / exact)
                        shift[where] = np.linalg.norm(fold(place) - fold(at))
                        predicted[where] = _predicted(effect, elements, spreads[size], ghost)
    dims = ("draw", "effect", "spread", "trial", "folds")
    return xr.Dataset(
        {
            "level_db": (dims, level, {"units": "dB"}),
            "shift": (dims, shift, {"units": "m"}),
            "predicted": (dims, predicted, {"units": "m"}),
        },
        {"effect": list(EFFECTS), "spread": ("spread", list(spreads), {"units": "m"}), "draw": seeds},
        {"elements": elements},
    )


def _nominal(elements: int) -> Array:
    """Where the antennas should stand, (n, 3) [m]."""
    place = np.zeros((elements, 3))
    place[:, 0] = PITCH * (np.arange(elements) - 0.5 * (elements - 1))
    return place


def _displaced(effect: str, elements: int, spread: float, random: np.random.Generator) -> tuple[Array, Array, float]:
    """Where transmitters and receivers really stand, (n, 3) [m] each; and the unknown cable, there and back [m]."""
    tx, rx = _nominal(elements), _nominal(elements)
    if effect == "random":
        tx[:, :2] += spread * random.standard_normal((elements, 2))
        rx[:, :2] += spread * random.standard_normal((elements, 2))
    elif effect == "scale":
        tx[:, 0] *= 1.0 + COMMON["scale"]
        rx[:, 0] *= 1.0 + COMMON["scale"]
    elif effect == "turned":
        rx = np.column_stack([np.cos(COMMON["turned"]) * rx[:, 0], np.sin(COMMON["turned"]) * rx[:, 0], rx[:, 2]])
    return tx, rx, COMMON["cable"] if effect == "cable" else 0.0


def _peak(ghost: Array, nominal: Array, tx: Array, rx: Array, cable: float) -> tuple[float, Array]:
    """Amplitude and place (2,) [m] of the peak in the image of a point.

    Parameters
    ----------
    ghost : (2,) array [m]
        The point, or its mirror image.
    nominal : (n, 3) array [m]
        Positions of transmitters and of receivers for which the image is focused.
    tx, rx : (n, 3) arrays [m]
        Positions with which the samples are computed.
    cable : float [m]
        Additional length of all paths.
    """
    frequency = np.linspace(START, STOP, FREQUENCIES)
    wavenumber = 2.0 * np.pi * frequency[:, None] / speed_of_light
    there, back = (np.exp(-1j * wavenumber * np.linalg.norm(np.append(ghost, 0.0) - place, axis=1)) for place in
                   (tx, rx))  # fmt: skip
    s = there[:, :, None] * back[:, None, :] * np.exp(-1j * wavenumber * cable)[:, :, None]
    sweep = mf.make_sweep(s.astype(np.complex64), frequency=frequency, tx_position=nominal, rx_position=nominal)
    side = np.linspace(-HALF, HALF, PIXELS)
    image = np.abs(mf.focus(sweep, x=ghost[0] + side, y=ghost[1] + side).values.astype(complex))
    power = RectBivariateSpline(side, side, image**2)
    first = np.unravel_index(image.argmax(), image.shape)
    top = float(image.max()) ** 2
    found = minimize(lambda at: -power(*at, grid=False) / top, [side[first[0]], side[first[1]]], method="Nelder-Mead",
                     options={"xatol": 1e-7, "fatol": 1e-10})  # fmt: skip
    return float(np.sqrt(-found.fun * top)), ghost + found.x[::-1]


def _predicted(effect: str, elements: int, spread: float, ghost: Array) -> float:
    """Predicted shift of the point [m].

    * Random errors with standard deviation s of N antennas, evenly spaced along the length L, turn the direction of
      one way (out or back), fitted by least squares, by ``s sqrt(12 / N) / L``, and move the point in range by
      ``s / sqrt(N)``. The shift is that of the mean of both ways.
    * Steps that are too long by the share e move the sine u of the point's direction to ``u (1 + e)``.
    * A stage that is turned by the angle a turns its own way by a, and the mean of both ways by ``a / 2``.
    * A cable of length d, there and back, moves the point away by ``d / 2``.
    """
    way = float(np.linalg.norm(ghost))
    u = ghost[0] / way
    cosine = np.sqrt(1.0 - u**2)
    if effect == "random":
        return float(spread * np.hypot(way * np.sqrt(6.0 / elements) / (elements * PITCH) / cosine,
                                       np.sqrt(0.5 / elements)))  # fmt: skip
    if effect == "scale":
        return float(way * COMMON["scale"] * abs(u) / cosine)
    return float(0.5 * way * COMMON["turned"] if effect == "turned" else 0.5 * COMMON["cable"])
