"""In the mirror, or through it? Which echoes passed through a half-transparent wall, told by two polarizations.

What was reflected bears the wall's R^2, what passed through it T^2, and both differ between TE and TM, most near
Brewster's angle (`panes`). A wall counts as transparent where a mixture of both explains the echoes behind it better
than a mirror does, dielectric or metal; else nothing changes. What passed is taken out before mirrors and their order
are found once more: it hides nothing of what the mirror shows. Of what passed, as of what is seen directly, the first
echo in each line of sight is an object, and what lies behind it multiple scattering.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import xarray as xr
from scipy.special import expit

from mirrorfold.common.slabs import slab
from mirrorfold.common.types import Array, Index, Mask
from mirrorfold.common.windows import hann
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import Mirror
from mirrorfold.detection.views.spectra import independent, offsets, spectra, tapers
from mirrorfold.detection.views.view import View
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.half_transparent.panes import Pairs, Pane, find_pane
from mirrorfold.tree.half_transparent.wall_glints import Glints, measured
from mirrorfold.tree.lines_of_sight import Cover

EVIDENCE, AGAINST_METAL = 5.0, 15.0
"""Least logarithm of the odds of a transparent wall against one of its material that only reflects, and against one of
metal: the four numbers of a wall fit some noise, neighbouring echoes share much of their spectra, and a mirror may show
objects that are no metal."""

FEWEST = 3
"""Resolution cells with echoes behind a wall that can tell what it is."""

MOST_PAIRS = 150
"""So many echoes, evenly chosen, tell what a wall is; a volume has thousands, and its cells overlap."""

NOISE_LIMIT = 6.0
"""The limit that noise stays below, over its standard deviation, see `noise_limit`."""

SAME_LINE, SAME_WAY_DEG = 1.0, 10.0
"""A wall is the same one after its echoes were sorted, if it moved by less than so many cells, and turned by less than
this [degree]: walls that meet in a corner differ by far more."""

ANGLE_STEP = 1e-3
"""Over which a delay is differentiated [rad]."""

NEIGHBOURS = 1.5
"""Echoes no farther apart, in resolution cells, are decided together."""

UNDECIDED = 0.5
"""Probability where nothing tells."""

BY_POLARIZATION, BY_GEOMETRY = "polarization", "geometry"
"""By what it was decided which echoes passed through a wall; the latter is a guess."""


@dataclass(frozen=True, eq=False)
class Window:
    """A half-transparent wall, and what is seen behind it.

    Attributes
    ----------
    mirror : Mirror
    pane : Pane or None
        None where geometry alone tells what passed, see `mirrorfold.tree.half_transparent.guessed`, or nothing tells.
    echoes : Echoes
        Those that passed through it.
    place : (n, d) array [m]
        Where the objects that sent these echoes stand: without the delay and the shift of the wall.
    probability : (n,) array
        That they passed.
    tested : (m, d) array [m]
        Where all echoes behind the wall stand in the image ...
    passed : (m,) array
        ... and the probability of each that it passed.
    decided : str
        By what that was decided, `BY_POLARIZATION` or `BY_GEOMETRY`.
    """

    mirror: Mirror
    pane: Pane | None
    echoes: Echoes
    place: Array
    probability: Array
    tested: Array
    passed: Array
    decided: str


class Again(Protocol):
    """Steps 2 to 4 with some of the echoes, see `mirrorfold.tree.rounds.find_tree`."""

    def __call__(self, *, echoes: Echoes) -> Found: ...  # noqa: D102


def find_transparent(
    found: Found, view: View, images: Mapping[str, xr.DataArray], every: Echoes, *, again: Again
) -> Found:
    """Steps 2 to 4 once more without what passed through walls; the same as before where no wall is transparent.

    Parameters
    ----------
    found : Found
        With all echoes taken for reflected ones.
    view : View
        Of one of the images.
    images : mapping of str to DataArray
        Complex, by polarization, "TE" and "TM".
    every : Echoes
        All echoes of the view.
    again : callable
    """
    windows = []
    for index, chain in enumerate(found.sight.chain):
        if len(chain) != 1 or (mirror := found.tree.mirrors[chain[0]].line) is None or mirror.curved:
            continue
        window = look_through(found, view, images, index, mirror)
        if window is not None:
            windows.append(window)
    return taken_out(found, windows, view, every, again)


def taken_out(found: Found, windows: Sequence[Window], view: View, every: Echoes, again: Again) -> Found:
    """Steps 2 to 4 once more without what passed through windows; the same as before where there are none."""
    if not windows:
        return found
    gone = np.isin(_key(every), np.concatenate([_key(window.echoes) for window in windows]))
    result = again(echoes=every.take(~gone)) if gone.any() else found
    return result._replace(windows=tuple(_seen(_moved(window, result), view) for window in windows))


def look_through(
    found: Found, view: View, images: Mapping[str, xr.DataArray], index: int, mirror: Mirror
) -> Window | None:
    """What is seen behind a mirror, sorted; None if nothing tells that it is transparent.

    Where metal would serve as well, what is behind may be either: it is all taken for reflected, with doubt.
    """
    echoes = found.echoes
    crossing = found.sight.crossing[index][echoes.direction]
    behind = echoes.strong & (echoes.range > crossing + view.object_depth(echoes.range))
    others = np.delete(found.sight.crossing, index, axis=0)[:, echoes.direction]
    behind &= ~(others < crossing).any(axis=0)
    echoes = echoes.take(behind)
    brightest, cell = _cells(view, echoes)
    if brightest.size < FEWEST:
        return None
    pairs = pairs_of(view, images, echoes.take(brightest), mirror)
    pane = find_pane(pairs.some(MOST_PAIRS))
    known = pane.against_metal >= AGAINST_METAL
    if pane.against_alike < EVIDENCE or not (known or pane.evidence >= EVIDENCE):
        return None
    glints = None
    if known and view.dimensions == 2:  # what a beam of a scan meets has a depth of its own, and is no glint
        glints = glints_of(view, images, echoes.take(brightest), pairs)
        pane = measured(glints, pane)
    if pane.evidence < EVIDENCE:
        return None
    passed = np.full(len(echoes), UNDECIDED)
    through = np.zeros(len(echoes), dtype=bool)
    if known:
        odds, neither = pairs.log_odds(pane)
        if glints is not None:
            odds = glints.log_odds(pane)
        passed = expit(agreed_odds(view.in_cells(echoes.position[brightest]), odds))[cell]
        through = passed > UNDECIDED
        # Echoes like neither, behind objects that passed, are multiple scattering between these and the wall's back.
        clear = Cover.of(echoes.take(through), view).clear(echoes.range, echoes.direction, echoes.amplitude)
        behind_it = neither[cell] & ~through & ~clear
        passed[behind_it], through = UNDECIDED, through | behind_it
    seen = echoes.take(through)
    place = placed(view, seen.position, mirror, pane, pairs.wavenumber)
    return Window(
        mirror, pane if known else None, seen, place, passed[through], echoes.position, passed, BY_POLARIZATION
    )


def agreed_odds(place: Array, odds: Array) -> Array:
    """Logarithms of the odds of echoes (n,) with those of their neighbours, at places (n, d) in resolution cells.

    Echoes close together are mostly those of one object, and passed or were reflected as a whole.
    """
    near = np.abs(place[:, None] - place).max(axis=-1) <= NEIGHBOURS
    return np.asarray(near @ odds)


def _cells(view: View, echoes: Echoes) -> tuple[Index, Index]:
    """The brightest echo of each resolution cell, (m,), and the cell of each echo, (n,)."""
    return view.brightest(echoes.position, echoes.amplitude), view.cell_numbers(echoes.position)


def pairs_of(view: View, images: Mapping[str, xr.DataArray], echoes: Echoes, mirror: Mirror) -> Pairs:
    """Echoes behind a wall in both polarizations."""
    te, tm = (spectra(view, images[name], echoes.position) for name in ("TE", "TM"))
    return Pairs(
        te=te,
        tm=tm,
        angle=incidence(view, echoes.position, mirror),
        wavenumber=offsets(images["TE"]),
        noise=(echoes.noise / (NOISE_LIMIT * echoes.amplitude)) ** 2,
        independent=independent(view, images["TE"]),
        cell=view.range_cell,
    )


def glints_of(view: View, images: Mapping[str, xr.DataArray], echoes: Echoes, pairs: Pairs) -> Glints:
    """The same echoes, of which any may be glints."""
    te, tm = (spectra(view, images[name], echoes.position, whole=True) for name in ("TE", "TM"))
    return Glints(pairs, te, tm, tapers(images["TE"]), view.in_cells(echoes.position))


def incidence(view: View, position: Array, mirror: Mirror) -> Array:
    """Angles [rad] at which lines of sight through places (n, d) [m] meet a mirror, (n,)."""
    sight = position - view.radar
    sight = sight / np.linalg.norm(sight, axis=1)[:, None]
    return np.asarray(np.arccos(np.clip(np.abs(sight @ mirror.normal), 0.0, 1.0)))


def placed(view: View, position: Array, mirror: Mirror, pane: Pane, wavenumber: Array) -> Array:
    """Where objects stand that are seen through a wall at places (n, d) [m] of the image.

    The wall makes the way longer by a length L that depends on the angle of incidence t. An array focuses on a place as
    much farther, and ``dL/dt`` aside, away from the normal.
    """
    angle = incidence(view, position, mirror)
    away = position - view.radar
    sight = away / np.linalg.norm(away, axis=1)[:, None]
    inward = mirror.inward(view)
    aside = sight - (sight @ inward)[:, None] * inward
    # Across the line of sight, away from the normal, where the angle of incidence grows.
    across = aside - np.sum(aside * sight, axis=1)[:, None] * sight
    size = np.linalg.norm(across, axis=1)[:, None]
    across = np.where(size > 0.0, across / np.maximum(size, np.finfo(float).tiny), 0.0)
    late = lateness(pane, angle, wavenumber)
    slope = (lateness(pane, angle + ANGLE_STEP, wavenumber) - late) / ANGLE_STEP
    return np.asarray(position - late[:, None] * sight - slope[:, None] * across)


def lateness(pane: Pane, angle: Array, wavenumber: Array) -> Array:
    """By how much [m] what is seen through a wall seems farther away, at angles of incidence (n,) [rad].

    The delay of the middle of the pulse: the mean slope of the phase of T over the band, with the weights of its power.
    """
    wall = pane.permittivity, pane.thickness, wavenumber, angle[:, None]
    passed = slab(*wall, "TE", rms_height=pane.rms_height)[1]
    step = wavenumber[1] - wavenumber[0]
    turn = np.sum(passed[:, 1:] * np.conj(passed[:, :-1]) * hann(wavenumber.size - 1), axis=1)
    return np.asarray(-np.angle(turn) / step)


def _key(echoes: Echoes) -> Array:
    """A number for each echo by its place along its line of sight, (n,)."""
    return np.asarray(echoes.direction + 1j * echoes.range)


def _moved(window: Window, found: Found) -> Window:
    """The window with its mirror as it was found anew; the nearest one in line of sight, if it stands there."""
    old = window.mirror
    lines = [node.line for node in found.tree.mirrors if node.line is not None and not node.line.curved]
    near = [line for line in lines if abs(float(line.normal @ old.normal)) > np.cos(np.radians(SAME_WAY_DEG))]
    if not near:
        return window
    best = min(near, key=lambda line: abs(float(line.beside(old.center))))
    cell = float(found.sight.view.cell_at(old.center))
    return replace(window, mirror=best) if abs(float(best.beside(old.center))) <= SAME_LINE * cell else window


def _seen(window: Window, view: View) -> Window:
    """The window with only the first object along each line of sight through it."""
    echoes = window.echoes
    if not len(echoes):
        return window
    clear: Mask = Cover.of(echoes, view).clear(echoes.range, echoes.direction, echoes.amplitude)
    return replace(window, echoes=echoes.take(clear), place=window.place[clear], probability=window.probability[clear])
