"""Reflected by a half-transparent wall, or passed through it: the echoes are sorted with two polarizations.

A reflected echo is multiplied by R^2 of the wall, an echo that passed through it by T^2. Both differ between TE and TM,
most near Brewster's angle (`panes`). A wall counts as transparent if a mixture of reflected and passed echoes explains
the echoes behind it better than a mirror does, dielectric or metal; otherwise nothing changes. Echoes that passed are
taken out, and mirrors and their order are found once more, for such echoes hide nothing of what the mirror shows. As in
direct view, the first passed echo in each line of sight is an object, and later ones are multiple scattering.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree
from scipy.special import expit, logit

from mirrorfold.common.geometry import unit, unit_or_zero
from mirrorfold.common.slabs import slab
from mirrorfold.common.types import ROOT, Array, Mask
from mirrorfold.common.windows import hann
from mirrorfold.detection import Echoes, Mirror, View
from mirrorfold.detection.echoes import noise_limit
from mirrorfold.detection.views.spectra import LONG_CELLS, WHOLE_CELLS, independent, spectra, tapers, wavenumbers
from mirrorfold.tree.assignment import Found, Pass
from mirrorfold.tree.half_transparent.doubts import passage_by_polarization
from mirrorfold.tree.half_transparent.panes import Pairs, Pane, find_pane
from mirrorfold.tree.half_transparent.wall_glints import Glints
from mirrorfold.tree.half_transparent.wall_posterior import measured_pane
from mirrorfold.tree.lines_of_sight import Cover

EVIDENCE, AGAINST_METAL = 5.0, 15.0
"""Least logarithm of the odds of a transparent wall: against a wall of the same kind that only reflects, and against a
metal mirror. They are above zero because the four numbers of a wall also fit some noise, neighbouring echoes share much
of their spectra, and a mirror may show objects that are not of metal."""

FEWEST = 3
"""Least number of resolution cells with echoes behind a wall from which its material can be found."""

MOST_PAIRS = 150
"""Largest number of echoes, evenly chosen, from which a wall is found: a volume has thousands, and its cells
overlap."""

SAME_LINE, SAME_WAY_DEG = 1.0, 10.0
"""A wall that is found once more after its echoes were sorted is the same if it moved by at most this many resolution
cells, and turned by less than this [degree]: walls that meet in a corner differ by far more."""

ANGLE_STEP = 1e-3
"""Step over which a delay is differentiated by the angle of incidence [rad]."""

NEIGHBOURS = 1.5
"""Largest distance of echoes that are decided together, in resolution cells."""

UNDECIDED = 0.5
"""Probability of an echo that is not decided."""

BY_POLARIZATION, BY_GEOMETRY = "polarization", "geometry"
"""The evidence by which the echoes of a wall were sorted; geometry gives a guess only."""


@dataclass(frozen=True, eq=False)
class TransparentWall:
    """A half-transparent wall, and the echoes behind it.

    Attributes
    ----------
    mirror : Mirror
    pane : Pane or None
        The wall's material. None if echoes were sorted by geometry alone, see
        `mirrorfold.tree.half_transparent.guessed`, or not at all.
    echoes : Echoes
        Echoes that passed through the wall.
    place : (n, d) array [m]
        True places of their objects: without the delay and the shift aside that the wall causes.
    probability : (n,) array
        Probability of each that it passed.
    tested : (m, d) array [m]
        Places in the image of all echoes behind the wall.
    passed : (m,) array
        Probability of each of these that it passed.
    decided : str
        The evidence by which they were sorted, `BY_POLARIZATION` or `BY_GEOMETRY`.
    """

    mirror: Mirror
    pane: Pane | None
    echoes: Echoes
    place: Array
    probability: Array
    tested: Array
    passed: Array
    decided: str


def find_transparent(
    found: Found,
    view: View,
    images: Mapping[str, xr.DataArray],
    every: Echoes,
    *,
    full_pass: Pass,
    walls: Mask | None = None,
) -> Found:
    """Steps 2 to 4 once more without the echoes that passed through walls; unchanged if none did.

    `found` takes all echoes behind walls for reflected ones. The `images` are complex, by polarization, "TE" and "TM";
    `view` is that of one of them, and `every` are all of its echoes. Where mirrors are given, `walls` (n,) marks those
    of walls.
    """
    tested = (look_through(found, view, images, *each) for each in flat_walls(found))
    passed_by = [wall for wall in tested if wall is not None and (wall.pane is not None or len(wall.echoes))]
    return taken_out(found, passed_by, view, every, full_pass, walls)


def with_doubts(found: Found, view: View, images: Mapping[str, xr.DataArray]) -> Found:
    """The result with how likely it is that each echo behind a flat wall in line of sight passed through it.

    Echoes that only the last pass has found are among them. Those that were taken out, because they more likely passed,
    count as before.
    """
    walls = {id(wall.mirror): wall for wall in found.transparent_walls}
    for index, mirror in flat_walls(found):
        wall, echoes = walls.get(id(mirror)), echoes_behind(found, view, index)
        if wall is not None:
            echoes = echoes.joined(wall.echoes)
        if not len(echoes):
            continue
        bright = echoes.take(view.brightest(echoes.position, echoes.amplitude))
        pairs = pairs_of(view, images, bright, mirror)
        if wall is not None and wall.pane is not None:
            passed = sorted_by(wall.pane, echoes, view, pairs, glints_of(view, images, bright, pairs))[0]
        else:
            doubt, none = doubted(echoes, view, pairs, mirror), np.zeros(0, dtype=np.intp)
            passed = doubt.passed
            if wall is None:  # nothing is taken out any more
                wall = replace(doubt, echoes=echoes.take(none), place=doubt.place[none], probability=np.zeros(0))
        walls[id(mirror)] = replace(wall, tested=echoes.position, passed=passed)
    return found._replace(transparent_walls=tuple(walls.values()))


def flat_walls(found: Found) -> list[tuple[int, Mirror]]:
    """The flat mirrors in line of sight, and their numbers."""
    mirrors, direct = found.sight.mirrors, np.flatnonzero(found.sight.parent == ROOT).tolist()
    return [(index, mirrors[index]) for index in direct if not mirrors[index].curved]


def taken_out(
    found: Found,
    transparent_walls: Sequence[TransparentWall],
    view: View,
    every: Echoes,
    full_pass: Pass,
    walls: Mask | None = None,
) -> Found:
    """Steps 2 to 4 once more without the echoes that passed through these walls; unchanged if there are none."""
    if not transparent_walls:
        return found
    gone = np.isin(_key(every), np.concatenate([_key(wall.echoes) for wall in transparent_walls]))
    kept = {} if walls is None else {"walls": walls[~gone]}
    result = full_pass(echoes=every.take(~gone), **kept) if gone.any() else found
    anew = [_with_new_mirror(wall, result) for wall in transparent_walls]
    return result._replace(transparent_walls=tuple(_first_objects(wall, view) for wall in anew))


def look_through(
    found: Found, view: View, images: Mapping[str, xr.DataArray], index: int, mirror: Mirror
) -> TransparentWall | None:
    """Sort the echoes behind a mirror; None if there are too few.

    If the wall is not known to be half transparent, its echoes are sorted by the probability of `doubted`.
    """
    echoes = echoes_behind(found, view, index)
    brightest = view.brightest(echoes.position, echoes.amplitude)
    if brightest.size < FEWEST:
        return None
    pairs = pairs_of(view, images, echoes.take(brightest), mirror)
    pane = find_pane(pairs.take(pairs.evenly(MOST_PAIRS)))
    if pane.against_alike < EVIDENCE or pane.against_metal < AGAINST_METAL:
        return doubted(echoes, view, pairs, mirror)
    glints = glints_of(view, images, echoes.take(brightest), pairs)
    if glints is not None:
        pane = measured_pane(glints, pane)
    if pane.evidence < EVIDENCE:
        return doubted(echoes, view, pairs, mirror)
    passed, neither = sorted_by(pane, echoes, view, pairs, glints)
    through = passed > UNDECIDED
    # Echoes like neither kind, behind objects that passed, are multiple scattering between object and wall.
    clear = Cover.of(echoes.take(through), view).clear(echoes.range, echoes.direction, echoes.amplitude)
    behind_it = neither & ~through & ~clear
    passed[behind_it], through = UNDECIDED, through | behind_it
    seen = echoes.take(through)
    place = placed(view, seen.position, mirror, pane, pairs.wavenumber)
    return TransparentWall(mirror, pane, seen, place, passed[through], echoes.position, passed, BY_POLARIZATION)


def sorted_by(pane: Pane, echoes: Echoes, view: View, pairs: Pairs, glints: Glints | None) -> tuple[Array, Mask]:
    """Probability that echoes behind a known wall passed through it; and which are likelier neither, (n,) each.

    `pairs` and `glints` are of the brightest of the echoes.
    """
    brightest, cell = view.brightest(echoes.position, echoes.amplitude), view.cell_numbers(echoes.position)
    odds, neither = pairs.log_odds(pane)
    if glints is not None:
        odds = glints.log_odds(pane)
    return expit(agreed_odds(view.in_cells(echoes.position[brightest]), odds))[cell], neither[cell]


def doubted(echoes: Echoes, view: View, pairs: Pairs, mirror: Mirror) -> TransparentWall:
    """A mirror with how likely it is that each of some echoes behind it passed through; `pairs` are of the brightest.

    Nothing is known of a wall that may be half transparent: the echoes that more likely passed stay where they are.
    """
    brightest, cell = view.brightest(echoes.position, echoes.amplitude), view.cell_numbers(echoes.position)
    place, some = view.in_cells(echoes.position[brightest]), pairs.evenly(MOST_PAIRS)
    window, each = passage_by_polarization(pairs.take(some))
    nearest = cKDTree(place[some]).query(place)[1]
    passed = (window * expit(agreed_odds(place, logit(each)[nearest], mean=True)))[cell]
    through = echoes.take(passed > UNDECIDED)
    own = passed[passed > UNDECIDED]
    return TransparentWall(mirror, None, through, through.position, own, echoes.position, passed, BY_POLARIZATION)


def echoes_behind(found: Found, view: View, index: int) -> Echoes:
    """The strong echoes behind a mirror whose lines of sight meet no other mirror before."""
    echoes = found.echoes
    crossing = found.sight.crossing[index][echoes.direction]
    behind = echoes.strong & (echoes.range > crossing + view.object_depth(echoes.range))
    others = np.delete(found.sight.crossing, index, axis=0)[:, echoes.direction]
    return echoes.take(behind & ~(others < crossing).any(axis=0))


def agreed_odds(place: Array, odds: Array, *, mean: bool = False) -> Array:
    """Logarithms of the `odds` of echoes, (n,), summed over each echo and its neighbours; `place` (n, d) is in cells.

    Echoes close together are mostly of one object, which passed or was reflected as a whole. The `mean` counts
    neighbours, which share much of their spectra, as one echo.
    """
    near = np.abs(place[:, None] - place).max(axis=-1) <= NEIGHBOURS
    return near @ odds / (near.sum(axis=1) if mean else 1.0)


def pairs_of(view: View, images: Mapping[str, xr.DataArray], echoes: Echoes, mirror: Mirror) -> Pairs:
    """Spectra of echoes behind a wall in both polarizations, and what is needed to judge them."""
    te, tm = (spectra(view, images[name], echoes.position) for name in ("TE", "TM"))
    limit = noise_limit(1.0, images["TE"].size)  # in standard deviations of the real part, of which noise has two
    return Pairs(
        te=te,
        tm=tm,
        angle=incidence(view, echoes.position, mirror),
        wavenumber=wavenumbers(images["TE"]),
        noise=2.0 * (echoes.noise / (limit * echoes.amplitude)) ** 2,
        independent=independent(view, images["TE"]),
        cell=view.range_cell,
    )


def glints_of(view: View, images: Mapping[str, xr.DataArray], echoes: Echoes, pairs: Pairs) -> Glints | None:
    """The same echoes with the spectra of whole echoes and of long pieces, for what measures the wall.

    None in a scan: what a beam meets has a depth of its own there, and is no glint.
    """
    if view.dimensions != 2:
        return None
    whole, long = (
        np.stack([spectra(view, images[name], echoes.position, flat_cells=flat) for name in ("TE", "TM")])
        for flat in (WHOLE_CELLS, LONG_CELLS)
    )
    return Glints(pairs, whole, long, tapers(images["TE"]), view.in_cells(echoes.position))


def incidence(view: View, position: Array, mirror: Mirror) -> Array:
    """Angles [rad] at which lines of sight through places (n, d) [m] meet a mirror, (n,)."""
    return np.arccos(np.clip(np.abs(unit(position - view.radar) @ mirror.normal), 0.0, 1.0))


def placed(view: View, position: Array, mirror: Mirror, pane: Pane, wavenumber: Array) -> Array:
    """True places (n, d) [m] of objects that are seen through a wall at places (n, d) [m] of the image.

    The wall lengthens the path by a length L that depends on the angle of incidence t. An array therefore focuses the
    echo at a place farther away by L, and shifted by ``dL/dt`` aside, away from the normal.
    """
    angle, sight, inward = incidence(view, position, mirror), unit(position - view.radar), mirror.inward(view)
    aside = sight - (sight @ inward)[:, None] * inward
    # Unit vectors across the line of sight, away from the normal: there the angle of incidence grows.
    across = unit_or_zero(aside - np.sum(aside * sight, axis=1)[:, None] * sight)
    late = lateness(pane, angle, wavenumber)
    slope = (lateness(pane, angle + ANGLE_STEP, wavenumber) - late) / ANGLE_STEP
    return position - late[:, None] * sight - slope[:, None] * across


def lateness(pane: Pane, angle: Array, wavenumber: Array) -> Array:
    """Length [m] by which objects appear farther away through a wall, at angles of incidence (n,) [rad].

    This is the delay of the middle of the pulse: the mean slope of the phase of T over the band, weighted with power.
    """
    wall = pane.permittivity, pane.thickness, wavenumber, angle[:, None]
    passed = slab(*wall, "TE", rms_height=pane.rms_height)[1]
    step = wavenumber[1] - wavenumber[0]
    turn = np.sum(passed[:, 1:] * np.conj(passed[:, :-1]) * hann(wavenumber.size - 1), axis=1)
    return -np.angle(turn) / step


def _key(echoes: Echoes) -> Array:
    """A complex number that identifies each echo, from its direction and range, (n,)."""
    return echoes.direction + 1j * echoes.range


def _with_new_mirror(wall: TransparentWall, found: Found) -> TransparentWall:
    """The wall with its mirror as it was found anew: the nearest one in line of sight, if it is at the same place."""
    old = wall.mirror
    near = [
        line for _, line in flat_walls(found) if abs(float(line.normal @ old.normal)) > np.cos(np.radians(SAME_WAY_DEG))
    ]
    if not near:
        return wall
    best = min(near, key=lambda line: abs(float(line.beside(old.center))))
    cell = float(found.sight.view.cell_at(old.center))
    return replace(wall, mirror=best) if abs(float(best.beside(old.center))) <= SAME_LINE * cell else wall


def _first_objects(wall: TransparentWall, view: View) -> TransparentWall:
    """The wall with only the first object along each line of sight through the wall."""
    echoes = wall.echoes
    clear: Mask = Cover.of(echoes, view).clear(echoes.range, echoes.direction, echoes.amplitude)
    return replace(wall, echoes=echoes.take(clear), place=wall.place[clear], probability=wall.probability[clear])
