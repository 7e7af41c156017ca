"""A half-transparent wall, measured by the spectra of the glints behind it.

Two things of every echo depend on the wall. One is the ratio of TE to TM, which an object is assumed to leave as it
is, up to a factor near plus or minus one. It is compared where the wall has been taken out: TE is multiplied by what
the wall does to TM, and TM by what it does to TE, before echoes are cut out, so that all that goes to and fro in the
wall is still in place. The other is the spectrum, if the echo is a glint: an arc, an edge or the vertex of a corner is
a point, which returns all frequencies alike, up to its delay and a slow power of frequency. So the spectrum of a glint
shows the wall: the fringes of R^2 or T^2 from its front and back face. The wall may have reflected an echo or let it
pass. One wall explains all echoes, over angle and frequency.

The clearest echoes agree with this model to 0.1 % of their amplitude; others are disturbed by their neighbours. So the
error of each echo has a scale of its own. It is not known beforehand, and the likelihood is averaged over it (Jeffreys,
Theory of Probability, 3rd ed., 1961, section 3.4): good echoes then count much, and bad ones little.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.types import Array
from mirrorfold.tree.half_transparent.glint_likelihoods import Tables, likelihoods, tables
from mirrorfold.tree.half_transparent.panes import MOST_ODDS, OTHER_SHARE, Pairs, Pane, Spectra, best_mixture

STEEPEST = -2.0
"""Steepest power of frequency with which the amplitude of glints falls: by the spreading of line sources, and by
roughness."""

POWERS = 0.0, 0.5 * STEEPEST, STEEPEST
"""Powers of frequency that are tried."""

OVERLAP = 4.0, 1.5
"""Distance up to which the windows of echoes overlap, in range cells and beam widths: the powers of such
echoes share one weight."""


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
    whole, long : (2, n, m) complex arrays
        Spectra of whole echoes in TE and TM, and of long pieces around them.
    taper : (m,) array
        The window over frequency that is contained in these spectra.
    place : (n, d) array
        Places of the echoes, in range cells and beam widths.
    """

    pairs: Pairs
    whole: Spectra
    long: Spectra
    taper: Array
    place: Array

    def brightest(self, most: int) -> Glints:
        """The `most` echoes that rise highest above the noise."""
        which = np.sort(np.argsort(self.pairs.noise, kind="stable")[:most])
        return Glints(self.pairs.take(which), self.whole[:, which], self.long[:, which], self.taper, self.place[which])

    @cached_property
    def weight(self) -> Array:
        """Weight of each echo: its share of the power of all echoes that overlap with it, itself included, (n,)."""
        apart = np.abs(self.place[:, None] - self.place)
        near = (apart[..., 0] <= OVERLAP[0]) & (apart[..., 1:] <= OVERLAP[1]).all(axis=-1)
        power = 1.0 / self.pairs.noise
        return np.asarray(power / (near @ power))

    def likelihoods(self, walls: Walls, powers: tuple[float, ...] = POWERS, kinds: int = 2) -> Array:
        """Logarithms of the likelihoods of echoes that walls reflected, and of echoes that passed through, over that of
        arbitrary spectra, (kinds, w, n); with one of the two `kinds`, of reflected ones alone.
        """
        if powers not in self._tables:
            self._tables[powers] = tables(self.pairs, self.whole, self.long, self.taper, powers)
        return likelihoods(*walls, self._tables[powers], kinds)

    @cached_property
    def _tables(self) -> dict[tuple[float, ...], Tables]:
        """The `tables` that were made, by powers of frequency."""
        return {}

    def mixed(self, walls: Walls) -> tuple[Array, Array]:
        """Logarithm of the likelihood of a mixture of reflected, passed and other echoes, summed over echoes, (w,); and
        the share of passed echoes that makes it largest, (w,).
        """
        return self._mixed(*self.likelihoods(walls))

    def alone(self, walls: Walls) -> Array:
        """The same logarithm if no echo passed: all were reflected, or are others, (w,)."""
        return self._alone(*self.likelihoods(walls, kinds=1))

    def mixed_and_alone(self, walls: Walls) -> tuple[Array, Array]:
        """The logarithms of `mixed` and of `alone` for the middle one of the `POWERS` of frequency, (w,) each."""
        reflected, passed = self.likelihoods(walls, POWERS[1:2])
        return self._mixed(reflected, passed)[0], self._alone(reflected)

    def _mixed(self, reflected: Array, passed: Array) -> tuple[Array, Array]:
        return best_mixture(reflected, passed, np.log(OTHER_SHARE), lambda each: each @ self.weight)

    def _alone(self, reflected: Array) -> Array:
        return np.logaddexp(reflected, np.log(OTHER_SHARE)) @ self.weight

    def log_odds(self, pane: Pane) -> Array:
        """Logarithm of the odds that each echo passed through the wall, against reflection, (n,)."""
        reflected, passed = self.likelihoods(Walls.of(pane))[:, 0]
        return np.clip(passed + np.log(pane.share) - reflected - np.log1p(-pane.share), -MOST_ODDS, MOST_ODDS)
