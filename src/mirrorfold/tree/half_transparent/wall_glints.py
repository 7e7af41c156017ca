"""A half-transparent wall measured by the glints behind it: of these not only the ratio of TE to TM is known.

What a rough object sends back has a spectrum of its own, and only the ratio of TE to TM tells of the wall (`panes`).
The glint of a smooth object has none: an arc, an edge or the vertex of a corner is a point, which sends all frequencies
back alike, up to its delay and a slow power of frequency. What its spectrum shows is the wall: the fringes of R^2 or
T^2 between its front and back face, in either polarization. So every echo may be a glint that the wall reflected or let
pass, or that of a rough object, of which only the ratio counts; one wall explains all, over angle and frequency.

The clearest glints agree with this model to 1 % of their amplitude, also where faces are rough, others only as well as
their neighbours let them. So the error of each echo has a scale of its own, of which nothing is known beforehand, and
the likelihood is averaged over this scale (Jeffreys, Theory of Probability, 3rd ed., 1961, section 3.4): good echoes
tell much, and bad ones little.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import gammaln

from mirrorfold.common.slabs import both_polarizations
from mirrorfold.common.types import Array
from mirrorfold.tree.half_transparent.panes import (
    MOST_ODDS,
    OTHER,
    PERMITTIVITY,
    THICKEST,
    THINNEST,
    Pairs,
    Pane,
    Spectra,
    best_mixture,
    covariance,
    parallel_misfit,
)

SCALES = 10.0 ** np.arange(-4.0, -0.4, 0.5)
"""Power of the errors of an echo over its own, from 1 % of the amplitude, what the model of plane waves leaves out
(`mirrorfold.simulation.rays.slabs`), to no agreement."""

STEEPEST = -2.0
"""Power of frequency by which glints change at most: by the spreading of line sources, and by roughness."""

POWERS = 0.0, 0.5 * STEEPEST, STEEPEST
"""Powers that are tried."""

UNLIKE = np.log(10.0) / 20.0 * np.array([0.3, 1.0, 3.0])
"""By so much [neper and rad] glints of TE and TM may be unlike, but for a sign: of conductors little, beside a rough
surface more."""

LEVELS = np.log(10.0) / 20.0 * 40.0
"""Span of the levels of TM against TE [neper] if nothing is known of them."""

DELAYS = np.arange(-1.5, 1.51, 0.1)
"""Delays of a glint against the place of its echo, in range cells: a ridge is seldom sampled where it is highest."""

MOST = 40
"""So many of the brightest echoes measure the wall."""

OVERLAP = 4.0, 1.5
"""Echoes whose windows overlap, in range cells and beam widths, count as one."""

TRIED, STEP = 12, 0.4
"""Permittivities that are tried first, and the step of the phase of one way through the wall and back [rad]."""

FACES = (0.03, 0.0), (0.02, 0.2)
"""Loss tangents, and heights of the faces' roughness times the wavenumber, that are tried first."""

STARTS, LAST = 24, 8
"""Trials from which the likelihood is climbed a little, and to the top."""

SMALL_HEIGHT = 0.6
"""Roughest faces, height times wavenumber: of glass, so rough a back face leaves 3 % of the coherent wave."""

TURNS = -2, -1, 1, 2
"""Walls that differ from the best by so many turns of the phase are tried once more: the coarse trials miss some."""

LEAST_BEND = 0.01
"""Least second derivative of the likelihood over the units of `_Climb`, ten of which cover what walls may be."""

BATCH = 100
"""Walls that are tried at once; bounds the memory."""


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
        The window over frequency that they bear.
    place : (n, d) array
        In range cells and beam widths.
    """

    pairs: Pairs
    te: Spectra
    tm: Spectra
    taper: Array
    place: Array

    def brightest(self, most: int) -> Glints:
        """So many of the echoes that rise highest above the noise."""
        which = np.sort(np.argsort(self.pairs.noise, kind="stable")[:most])
        return replace(
            self, pairs=self.pairs.take(which), te=self.te[which], tm=self.tm[which], place=self.place[which]
        )

    @cached_property
    def weight(self) -> Array:
        """One over the number of echoes that each overlaps with, (n,)."""
        apart = np.abs(self.place[:, None] - self.place)
        near = (apart[..., 0] <= OVERLAP[0]) & (apart[..., 1:] <= OVERLAP[1]).all(axis=-1)
        return np.asarray(1.0 / near.sum(axis=1))

    def likelihoods(self, walls: Walls, powers: tuple[float, ...] = POWERS) -> tuple[Array, Array]:
        """Logarithms of how much more likely echoes are, reflected by walls and passed through them, than any spectra
        would be, (w, n) each.
        """
        eps, thickness, height = (each[:, None, None] for each in walls)
        wave = self.pairs.wavenumber, self.pairs.angle[:, None]
        te, tm = both_polarizations(eps, thickness, *wave, rms_height=height)
        reflected, passed = (self._of_kind(a**2, b**2, powers) for a, b in zip(te, tm, strict=True))
        return reflected, passed

    def _of_kind(self, te: Spectra, tm: Spectra, powers: tuple[float, ...]) -> Array:
        """The same for echoes whose spectra bear (te, tm), (w, n)."""
        independent, noise = self.pairs.independent, self.pairs.noise
        misfit, unlike = self._glint(te, tm, powers)
        # Of two spectra, a glint leaves two amplitudes and a delay free; a rough object a whole spectrum, and a phase.
        glint = _averaged(misfit, noise, 2.0 * independent - 2.5, 2.5)
        spread = UNLIKE[:, None, None]
        glint += np.logaddexp.reduce(np.log(0.5 * LEVELS / spread**2) - 0.5 * unlike / spread**2) - np.log(UNLIKE.size)
        ratio = parallel_misfit(self.pairs.te, self.pairs.tm, te, tm)
        rough = _averaged(ratio, noise, independent - 0.5, independent + 0.5)
        return np.asarray(np.logaddexp(glint, rough) - np.log(2.0))

    def _glint(self, te: Spectra, tm: Spectra, powers: tuple[float, ...]) -> tuple[Array, Array]:
        """The share of the power that no glint at the best delay explains, and the square of how unlike its levels in
        TE and TM then are, (w, n) each.
        """
        law, turn = self._trials(powers)
        levels, explained = [], np.zeros(())
        for echo, wall in ((self.te, te), (self.tm, tm)):
            model = wall * self.taper
            power = np.repeat(np.abs(model) ** 2 @ (law.T**2), DELAYS.size, axis=-1)
            sent = (echo * np.conj(model)) @ turn
            explained = explained + np.abs(sent) ** 2 / power
            levels.append(sent / power)
        best = explained.argmax(axis=-1)[..., None]
        level_te, level_tm = (np.take_along_axis(level, best, axis=-1)[..., 0] for level in levels)
        difference = np.log(level_te / level_tm)
        phase = difference.imag - np.pi * np.round(difference.imag / np.pi)
        total = np.sum(np.abs(self.te) ** 2 + np.abs(self.tm) ** 2, axis=-1)
        misfit = 1.0 - _peak(explained.reshape(*explained.shape[:-1], len(powers), DELAYS.size)) / total
        return np.clip(misfit, 0.0, 1.0), difference.real**2 + phase**2

    def _trials(self, powers: tuple[float, ...]) -> tuple[Array, Spectra]:
        """Powers of frequency (powers, m), and them at all delays, (m, powers * delays)."""
        if powers not in self._tried:
            k = self.pairs.wavenumber
            middle = k.mean()
            law = (k / middle) ** np.array(powers)[:, None]
            waves = np.exp(2j * np.outer(k - middle, DELAYS * self.pairs.cell))
            self._tried[powers] = law, (law.T[:, :, None] * waves[:, None, :]).reshape(k.size, -1)
        return self._tried[powers]

    @cached_property
    def _tried(self) -> dict[tuple[float, ...], tuple[Array, Spectra]]:
        """What `_trials` has given, by the powers."""
        return {}

    def mixed(self, walls: Walls, powers: tuple[float, ...] = POWERS) -> tuple[Array, Array]:
        """Logarithm of the likelihood of a mixture of both kinds and of others, summed, (w,), and the share of what
        passed with which it is largest.
        """
        return best_mixture(*self.likelihoods(walls, powers), np.log(OTHER), lambda each: each @ self.weight)

    def alone(self, walls: Walls) -> Array:
        """The same where all was reflected, or is something else, (w,)."""
        return np.asarray(np.logaddexp(self.likelihoods(walls)[0], np.log(OTHER)) @ self.weight)

    def log_odds(self, pane: Pane) -> Array:
        """Logarithm of the odds of each echo that it passed through the wall instead of being reflected, (n,)."""
        reflected, passed = (kind[0] for kind in self.likelihoods(Walls.of(pane)))
        return np.clip(passed + np.log(pane.share) - reflected - np.log1p(-pane.share), -MOST_ODDS, MOST_ODDS)


def _averaged(misfit: Array, noise: Array, left: float, explained: float) -> Array:
    """Logarithm of the likelihood of a misfit (w, n), over that of any direction in as many dimensions, averaged over
    the scale of the error; so many complex dimensions are `left`, and so many `explained`.
    """
    variance = SCALES[:, None, None] + noise
    each = left * (np.log(left / variance) - misfit / variance)
    usual = np.log(SCALES.size) - gammaln(explained) + gammaln(left + explained)
    return np.asarray(np.logaddexp.reduce(each) - usual)


def _peak(values: Array) -> Array:
    """The largest of values (..., powers, delays) on parabolas through neighbouring delays, (...)."""
    at = np.clip(values.argmax(axis=-1), 1, values.shape[-1] - 2)[..., None]
    before, here, after = (np.take_along_axis(values, at + step, axis=-1)[..., 0] for step in (-1, 0, 1))
    bend = before - 2.0 * here + after
    beside = np.clip(0.5 * (before - after) / np.where(bend < 0.0, bend, -np.inf), -0.5, 0.5)
    return np.asarray(np.maximum(values.max(axis=-1), here - 0.25 * (before - after) * beside).max(axis=-1))


class _Climb:
    """The likelihood of a wall by numbers of the order of their errors: logarithm of the permittivity, loss tangent,
    phase of one way through the wall and back, and roughness of its faces.
    """

    def __init__(self, glints: Glints) -> None:
        self.glints = glints
        self.wavenumber = float(glints.pairs.wavenumber.mean())
        self.sine = float(np.mean(np.sin(glints.pairs.angle) ** 2))
        self.scale = np.array([0.03, 0.005, 0.1, 0.03])

    def numbers(self, permittivity: float, loss: float, thickness: float, roughness: float) -> Array:
        """The numbers of a wall."""
        phase = 2.0 * self.wavenumber * thickness * np.sqrt(permittivity - self.sine)
        return np.array([np.log(permittivity), loss, phase, roughness]) / self.scale

    def turns(self, count: int) -> Array:
        """How so many turns of the phase change the numbers."""
        return np.array([0.0, 0.0, 2.0 * np.pi * count, 0.0]) / self.scale

    def wall(self, numbers: Array) -> Walls:
        """The wall of such numbers, negative losses and heights being as good as positive ones."""
        log, loss, phase, roughness = numbers * self.scale
        real = float(np.exp(np.clip(log, 0.0, 3.0)))
        thickness = phase / (2.0 * self.wavenumber * np.sqrt(max(real - self.sine, 0.1)))
        height = abs(roughness) / self.wavenumber
        return Walls(np.array([real * (1.0 - 1j * abs(loss))]), np.array([thickness]), np.array([height]))

    def cost(self, numbers: Array, *, opaque: bool = False) -> float:
        """Negative logarithm of the likelihood, if anything passed or not; large outside of what walls may be."""
        log, loss, phase, roughness = numbers * self.scale
        low, high = np.log(PERMITTIVITY[0] / 1.2), np.log(1.2 * PERMITTIVITY[1])
        if not (low < log < high and abs(loss) < 0.5 and phase > 0.0 and abs(roughness) < SMALL_HEIGHT):
            return 1e9
        wall = self.wall(numbers)
        return -float((self.glints.alone(wall) if opaque else self.glints.mixed(wall)[0])[0])

    def climbed(self, start: Array, steps: int, *, opaque: bool = False) -> tuple[float, Array]:
        """The likelihood uphill of a start, and where."""
        corners = start + np.concatenate([np.zeros((1, 4)), np.diag([2.0, 1.0, 2.0, 1.0])])
        options = {"initial_simplex": corners, "maxfev": steps, "xatol": 0.02, "fatol": 0.02}
        found = minimize(partial(self.cost, opaque=opaque), start, method="Nelder-Mead", options=options)
        return -float(found.fun), found.x


def measured(glints: Glints, pane: Pane) -> Pane:
    """A wall that lets waves through, as the brightest echoes behind it measure it, and how surely it does.

    Walls whose phases differ by whole turns are each tried, and the standard errors hold all that are as likely.
    """
    glints = glints.brightest(MOST)
    climb = _Climb(glints)
    # Narrow peaks beside each other, one for every turn of the phase, are climbed one by one.
    best = [place for _, place in sorted((climb.climbed(start, 60) for start in _starts(climb)), key=_lower)]
    beside = [best[0] + climb.turns(turns) for turns in TURNS]
    peaks = _distinct(sorted((climb.climbed(start, 250) for start in best[:LAST] + beside), key=_lower))
    height, at = peaks[0]
    real, thickness = _figures(climb, at)
    spread = covariance(climb.cost, at, step=1.0, least=LEAST_BEND)
    slopes = np.stack([
        np.subtract(_figures(climb, at + step), _figures(climb, at - step)) / 2.0 for step in np.eye(4)
    ], axis=1)  # fmt: skip
    variance = np.diag(slopes @ spread @ slopes.T).copy()
    weight = np.exp([other - height for other, _ in peaks])
    for each, (_, place) in zip(weight / weight.sum(), peaks, strict=True):
        variance += each * np.square(np.subtract(_figures(climb, place), (real, thickness)))
    wall = climb.wall(at)
    opaque = max(climb.climbed(start, 100, opaque=True)[0] for _, start in peaks)
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


def _lower(peak: tuple[float, Array]) -> float:
    """Key by which peaks are sorted, the highest first."""
    return -peak[0]


def _distinct(peaks: list[tuple[float, Array]]) -> list[tuple[float, Array]]:
    """Those of sorted peaks that are more than a unit of `_Climb` from each higher one."""
    found: list[tuple[float, Array]] = []
    for height, place in peaks:
        if all(np.abs(place - other).max() > 1.0 for _, other in found):
            found.append((height, place))
    return found


def _figures(climb: _Climb, numbers: Array) -> tuple[float, float]:
    """Permittivity and thickness [m]."""
    wall = climb.wall(numbers)
    return float(wall.permittivity[0].real), float(wall.thickness[0])


def _starts(climb: _Climb) -> list[Array]:
    """Of walls on a coarse grid the two best, of different permittivity, for each turn of the phase."""
    glints, k = climb.glints, climb.wavenumber
    cell = glints.pairs.cell
    optical = np.arange(THINNEST * cell, THICKEST * cell, STEP / (2.0 * k))
    trials = np.array([
        (real, loss, width / np.sqrt(real), roughness)
        for real in np.geomspace(*PERMITTIVITY, TRIED) for loss, roughness in FACES for width in optical
    ])  # fmt: skip
    score = []
    for first in range(0, len(trials), BATCH):
        real, loss, thickness, roughness = trials[first : first + BATCH].T
        walls = Walls(real * (1.0 - 1j * loss), thickness, roughness / k)
        score.append(glints.mixed(walls, POWERS[1:2])[0])
    height = np.concatenate(score)
    turns = np.round(2.0 * k * trials[:, 2] * np.sqrt(trials[:, 0] - climb.sine) / (2.0 * np.pi))
    found: list[int] = []
    for turn in np.unique(turns):
        here = np.flatnonzero(turns == turn)
        first = here[height[here].argmax()]
        others = here[np.abs(np.log(trials[here, 0] / trials[first, 0])) > 0.1]
        found += [first, *others[height[others].argsort()[-1:]]]
    found = sorted(found, key=lambda index: -height[index])[:STARTS]
    return [climb.numbers(*trials[index]) for index in found]
