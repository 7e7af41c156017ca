"""A half-transparent wall, measured by the spectra of the glints behind it.

The echo of a rough object has an unknown spectrum, and only its ratio of TE to TM depends on the wall (`panes`). The
spectrum of the glint of a smooth object is known: an arc, an edge or the vertex of a corner is a point, which returns
all frequencies alike, up to its delay and a slow power of frequency. So the spectrum of a glint shows the wall: the
fringes of R^2 or T^2 from its front and back face, in each polarization. Every echo may be a glint or the echo of a
rough object, of which only the ratio is used, and the wall may have reflected it or let it pass. One wall explains all
echoes, over angle and frequency.

The clearest glints agree with this model to 1 % of their amplitude, also where faces are rough; others are disturbed by
their neighbours. So the error of each echo has a scale of its own. It is not known beforehand, and the likelihood is
averaged over it (Jeffreys, Theory of Probability, 3rd ed., 1961, section 3.4): good echoes then count much, and bad
ones little.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from mirrorfold.common.types import Array
from mirrorfold.tree.half_transparent.glint_likelihoods import Measured, Tables, likelihoods, tables
from mirrorfold.tree.half_transparent.panes import (
    MOST_ODDS,
    OTHER_SHARE,
    PERMITTIVITY,
    THICKEST,
    Pairs,
    Pane,
    Spectra,
    best_mixture,
    covariance,
    power_of,
)

STEEPEST = -2.0
"""Steepest power of frequency with which the amplitude of glints falls: by the spreading of line sources, and by
roughness."""

POWERS = 0.0, 0.5 * STEEPEST, STEEPEST
"""Powers of frequency that are tried."""

MOST = 40
"""Number of the brightest echoes from which the wall is measured."""

OVERLAP = 4.0, 1.5
"""Distance up to which the windows of echoes overlap, in range cells and beam widths: such echoes count as one."""

TRIED, STEP = 12, 0.4
"""Number of permittivities that are tried first; and step of the phase of one way through the wall and back [rad]."""

QUARTER_WAVE = np.pi
"""Phase of one way through the thinnest wall that is tried first, and back [rad]. A thinner one has no fringe."""

FACES = (0.03, 0.0), (0.02, 0.2)
"""Pairs of a loss tangent and a roughness of the faces (rms height times wavenumber) that are tried first."""

STARTS, LAST = 24, 8
"""Numbers of best trials from which the likelihood is maximised: with few steps, and to the peak."""

SMALL_HEIGHT = 0.6
"""Largest roughness of faces, rms height times wavenumber: such a back face of glass leaves 3 % of a coherent wave."""

TURNS = -2, -1, 1, 2
"""Whole turns of the phase by which further walls that are tried differ from the best: the coarse trials miss some."""

LEAST_BEND = 0.01
"""Least second derivative of the log-likelihood in the units of `_WallFit`: it limits standard errors to ten units,
which cover all possible walls."""


class Walls(NamedTuple):
    """Walls, (w,) arrays: relative permittivity, thickness [m], and rms height of the faces [m]."""

    permittivity: NDArray[np.complex128]
    thickness: Array
    rms_height: Array

    @classmethod
    def of(cls, pane: Pane) -> Walls:
        """A single one."""
        return cls(np.array([pane.permittivity]), np.array([pane.thickness]), np.array([pane.rms_height]))


@dataclass(frozen=True, eq=False)
class Glints:
    """Echoes behind a wall, any of which may be glints.

    Attributes
    ----------
    pairs : Pairs
    te, tm : (n, m) complex arrays
        Spectra of whole echoes.
    taper : (m,) array
        The window over frequency that is contained in these spectra.
    place : (n, d) array
        Places of the echoes, in range cells and beam widths.
    """

    pairs: Pairs
    te: Spectra
    tm: Spectra
    taper: Array
    place: Array

    def brightest(self, most: int) -> Glints:
        """The `most` echoes that rise highest above the noise."""
        which = np.sort(np.argsort(self.pairs.noise, kind="stable")[:most])
        return Glints(self.pairs.take(which), self.te[which], self.tm[which], self.taper, self.place[which])

    @cached_property
    def weight(self) -> Array:
        """Weight of each echo: one over the number of echoes that overlap with it, itself included, (n,)."""
        apart = np.abs(self.place[:, None] - self.place)
        near = (apart[..., 0] <= OVERLAP[0]) & (apart[..., 1:] <= OVERLAP[1]).all(axis=-1)
        return np.asarray(1.0 / near.sum(axis=1))

    def likelihoods(self, walls: Walls, powers: tuple[float, ...] = POWERS, kinds: int = 2) -> Array:
        """Logarithms of the likelihoods of echoes that walls reflected, and of echoes that passed through, over that of
        arbitrary spectra, (kinds, w, n); with one of the two `kinds`, of reflected ones alone.
        """
        if powers not in self._tables:
            pairs, whole = self.pairs, np.stack([self.te, self.tm])
            measured = Measured(
                whole=whole * self.taper,
                power=power_of(whole).sum(axis=(0, 2)),
                ratio=pairs.ratio,
                total=pairs.products.total,
                noise=pairs.noise,
                angle=pairs.angle,
                wavenumber=pairs.wavenumber,
                taper=self.taper,
                independent=pairs.independent,
                cell=pairs.cell,
            )
            self._tables[powers] = tables(measured, powers)
        return likelihoods(*walls, self._tables[powers], kinds)

    @cached_property
    def _tables(self) -> dict[tuple[float, ...], Tables]:
        """The `tables` that were made, by powers of frequency."""
        return {}

    def mixed(self, walls: Walls, powers: tuple[float, ...] = POWERS) -> tuple[Array, Array]:
        """Logarithm of the likelihood of a mixture of reflected, passed and other echoes, summed over echoes, (w,); and
        the share of passed echoes that makes it largest, (w,).
        """
        reflected, passed = self.likelihoods(walls, powers)
        return best_mixture(reflected, passed, np.log(OTHER_SHARE), lambda each: each @ self.weight)

    def alone(self, walls: Walls) -> Array:
        """The same logarithm if no echo passed: all were reflected, or are others, (w,)."""
        (reflected,) = self.likelihoods(walls, kinds=1)
        return np.asarray(np.logaddexp(reflected, np.log(OTHER_SHARE)) @ self.weight)

    def log_odds(self, pane: Pane) -> Array:
        """Logarithm of the odds that each echo passed through the wall, against reflection, (n,)."""
        reflected, passed = self.likelihoods(Walls.of(pane))[:, 0]
        return np.clip(passed + np.log(pane.share) - reflected - np.log1p(-pane.share), -MOST_ODDS, MOST_ODDS)


class _WallFit:
    """The likelihood of a wall as a function of four numbers, in units of about their errors: logarithm of
    permittivity, loss tangent, phase of one way through the wall and back, and roughness of the faces.
    """

    def __init__(self, glints: Glints) -> None:
        self.glints = glints
        self.wavenumber = float(glints.pairs.wavenumber.mean())
        self.sine = float(np.mean(np.sin(glints.pairs.angle) ** 2))
        self.scale = np.array([0.03, 0.005, 0.1, 0.03])

    def numbers(self, permittivity: float, loss: float, thickness: float, roughness: float) -> Array:
        """The four numbers of a wall of that permittivity, loss tangent, thickness [m] and roughness."""
        phase = 2.0 * self.wavenumber * thickness * np.sqrt(permittivity - self.sine)
        return np.array([np.log(permittivity), loss, phase, roughness]) / self.scale

    def turns(self, count: int) -> Array:
        """The change of the four numbers by so many turns of the phase."""
        return np.array([0.0, 0.0, 2.0 * np.pi * count, 0.0]) / self.scale

    def wall(self, numbers: Array) -> Walls:
        """The wall of four numbers. Negative losses and heights count as positive ones."""
        log, loss, phase, roughness = numbers * self.scale
        real = float(np.exp(np.clip(log, 0.0, 3.0)))
        thickness = phase / (2.0 * self.wavenumber * np.sqrt(max(real - self.sine, 0.1)))
        height = abs(roughness) / self.wavenumber
        return Walls(np.array([real * (1.0 - 1j * abs(loss))]), np.array([thickness]), np.array([height]))

    def cost(self, numbers: Array, *, opaque: bool = False) -> float:
        """Negative logarithm of the likelihood; with `opaque`, if no echo passed. Very large for impossible walls."""
        log, loss, phase, roughness = numbers * self.scale
        low, high = np.log(PERMITTIVITY[0] / 1.2), np.log(1.2 * PERMITTIVITY[1])
        if not (low < log < high and abs(loss) < 0.5 and phase > 0.0 and abs(roughness) < SMALL_HEIGHT):
            return 1e9
        wall = self.wall(numbers)
        return -float((self.glints.alone(wall) if opaque else self.glints.mixed(wall)[0])[0])

    def climbed(self, start: Array, steps: int, *, opaque: bool = False) -> tuple[float, Array]:
        """Maximise from a start: the logarithm of the likelihood, and the four numbers there."""
        corners = start + np.concatenate([np.zeros((1, 4)), np.diag([2.0, 1.0, 2.0, 1.0])])
        options = {"initial_simplex": corners, "maxfev": steps, "xatol": 0.02, "fatol": 0.02}
        found = minimize(partial(self.cost, opaque=opaque), start, method="Nelder-Mead", options=options)
        return -float(found.fun), found.x


def measured_pane(glints: Glints, pane: Pane) -> Pane:
    """The wall `pane` as the brightest echoes behind it measure it, with standard errors and evidence.

    Walls whose phases differ by whole turns are all tried, and the standard errors include those that are as likely.
    """
    glints = glints.brightest(MOST)
    fit = _WallFit(glints)
    # The likelihood has narrow peaks beside each other, one for every turn of the phase: each is searched by itself.
    best = [place for _, place in sorted((fit.climbed(start, 60) for start in _starts(fit)), key=_by_height)]
    beside = [best[0] + fit.turns(turns) for turns in TURNS]
    peaks = _distinct(sorted((fit.climbed(start, 250) for start in best[:LAST] + beside), key=_by_height))
    height, at = peaks[0]
    real, thickness = _eps_and_thickness(fit, at)
    spread = covariance(fit.cost, at, step=1.0, least=LEAST_BEND)
    slopes = np.stack([
        np.subtract(_eps_and_thickness(fit, at + step), _eps_and_thickness(fit, at - step)) / 2.0 for step in np.eye(4)
    ], axis=1)  # fmt: skip
    variance = np.diag(slopes @ spread @ slopes.T).copy()
    weight = np.exp([other - height for other, _ in peaks])
    for each, (_, place) in zip(weight / weight.sum(), peaks, strict=True):
        variance += each * np.square(np.subtract(_eps_and_thickness(fit, place), (real, thickness)))
    wall = fit.wall(at)
    opaque = max(fit.climbed(start, 100, opaque=True)[0] for _, start in peaks)
    return replace(
        pane,
        permittivity=complex(wall.permittivity[0]),
        thickness=thickness,
        rms_height=float(wall.rms_height[0]),
        permittivity_error=float(np.sqrt(variance[0])),
        thickness_error=float(np.sqrt(variance[1])),
        evidence=max(pane.evidence, height - opaque),
        share=float(glints.mixed(wall)[1][0]),
    )


def _by_height(peak: tuple[float, Array]) -> float:
    """Key for sorting peaks, the highest first."""
    return -peak[0]


def _distinct(peaks: list[tuple[float, Array]]) -> list[tuple[float, Array]]:
    """Those of sorted peaks that are more than a unit of `_WallFit` from each higher one."""
    found: list[tuple[float, Array]] = []
    for height, place in peaks:
        if all(np.abs(place - other).max() > 1.0 for _, other in found):
            found.append((height, place))
    return found


def _eps_and_thickness(fit: _WallFit, numbers: Array) -> tuple[float, float]:
    """Real part of the permittivity, and thickness [m]."""
    wall = fit.wall(numbers)
    return float(wall.permittivity[0].real), float(wall.thickness[0])


def _starts(fit: _WallFit) -> list[Array]:
    """The best starts from a coarse grid of walls: for each turn of the phase the two best ones that differ in
    permittivity.
    """
    glints, k = fit.glints, fit.wavenumber
    cell = glints.pairs.cell
    optical = np.arange(QUARTER_WAVE / (2.0 * k), THICKEST * cell, STEP / (2.0 * k))
    trials = np.array([
        (real, loss, width / np.sqrt(real), roughness)
        for real in np.geomspace(*PERMITTIVITY, TRIED) for loss, roughness in FACES for width in optical
    ])  # fmt: skip
    real, loss, thickness, roughness = trials.T.copy()
    height = glints.mixed(Walls(real * (1.0 - 1j * loss), thickness, roughness / k), POWERS[1:2])[0]
    turns = np.round(2.0 * k * trials[:, 2] * np.sqrt(trials[:, 0] - fit.sine) / (2.0 * np.pi))
    found: list[int] = []
    for turn in np.unique(turns):
        here = np.flatnonzero(turns == turn)
        first = here[height[here].argmax()]
        others = here[np.abs(np.log(trials[here, 0] / trials[first, 0])) > 0.1]
        found += [first, *others[height[others].argsort()[-1:]]]
    found = sorted(found, key=lambda index: -height[index])[:STARTS]
    return [fit.numbers(*trials[index]) for index in found]
