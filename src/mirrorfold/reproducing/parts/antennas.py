"""Errors of the antennas' positions: what they do to the image of a point, after any number of folds."""

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
"""Errors that all positions share: relative error of a step; angle of one stage against the other [rad]; length [m] of
cable that was not taken off, there and back."""

EFFECTS = {
    "random": "random",
    "scale": "steps 0.1 % too long",
    "turned": "one stage turned by 0.1 degree",
    "cable": "1 mm of cable too much",
}
"""What is wrong with the positions."""

FREQUENCIES = 201
"""Unambiguous up to 3 m."""

HALF, PIXELS = 0.035, 41
"""The picture about the point [m]."""


def antenna_errors(seeds: Iterable[int], spreads: Sequence[float], *, elements: int, trials: int) -> xr.Dataset:
    """Level and place of a point, imaged as if all antennas stood where they were meant to.

    The point is seen in line of sight and in one to three mirrors by its images, of which each antenna is as far away
    as the way is long. Transmitters and receivers stand on stages of their own.

    Parameters
    ----------
    seeds : iterable of int
        Of the places of the target.
    spreads : sequence of float [m]
        Standard deviations of random errors of each coordinate.
    elements : int
        Positions of each stage.
    trials : int
        Of random errors.

    Returns
    -------
    Dataset
        `level_db`, relative to exact positions; `shift` of the folded point and what is `predicted` for it [m]
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
    """Where the antennas are meant to stand, (n, 3) [m]."""
    place = np.zeros((elements, 3))
    place[:, 0] = PITCH * (np.arange(elements) - 0.5 * (elements - 1))
    return place


def _displaced(effect: str, elements: int, spread: float, random: np.random.Generator) -> tuple[Array, Array, float]:
    """Where transmitters and receivers really stand, (n, 3) [m]; and cable that nobody knows of, both ways [m]."""
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
    """Amplitude and place [m] of the image of a point, measured where the antennas are and focused where they should.

    Parameters
    ----------
    ghost : (2,) array [m]
    nominal, tx, rx : (n, 3) arrays [m]
    cable : float [m]
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
    """How far the point should be off [m].

    Random errors s of N antennas, spaced evenly along the length L, turn the direction of each way, by least squares,
    by ``s sqrt(12 / N) / L``, and move it in range by ``s / sqrt(N)``; the mean of both ways counts. Steps that are
    too long by the part e are focused at the sine ``u (1 + e)``; a stage turned by a turns its own way by a, and the
    mean of both by half of it. A cable of length d moves a point away by d / 2.
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
