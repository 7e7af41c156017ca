"""Half-transparent panels in a raster scan: the series of waves that each reflects and transmits.

Every term of Airy's sums (`mirrorfold.simulation.rays.slabs`) is treated as a wave of its own, whose path is longer by
an extra length L that depends on the angle of incidence t. The unfolded path stays straight. The point at its end
appears farther by L, and shifted sideways by ``dL/dt``, away from the normal of the panel, as the direction from which
a wave arrives follows from the change of its phase along the aperture. Both are exact to first order. The neglected
term is of the order of ``(dL/dt)^2`` over the length of the path, some micrometres.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.slabs import inside
from mirrorfold.common.types import Array, Complex, Index, Mask
from mirrorfold.scenes.materials import permittivity
from mirrorfold.scenes.solids import Finish, Panel, Scene3D
from mirrorfold.simulation.raster.meshes import Quad, Solid
from mirrorfold.simulation.raster.speckle import kept_share
from mirrorfold.simulation.rays.scatterers import named
from mirrorfold.simulation.rays.slabs import WEAKEST_WAVE, WaveSeries, reflected, transmitted


@dataclass(frozen=True, eq=False)
class Wave:
    """One of the waves that arrive at n points one after another, as half-transparent panels split a wave.

    Attributes
    ----------
    amplitude : (n,) complex array
        Product of the reflection and transmission coefficients on the way.
    extra : (n,) array [m]
        Length of the path minus that of the straight unfolded path.
    aside : (n, 3) array [m]
        Apparent sideways shift of the points, in the unfolded view of the scanner.
    """

    amplitude: Complex
    extra: Array
    aside: Array

    @classmethod
    def straight(cls, points: int) -> Wave:
        """The wave to n points before it has met anything: amplitude 1, no extra length, no shift."""
        return cls(np.ones(points, dtype=complex), np.zeros(points), np.zeros((points, 3)))

    def take(self, which: Mask | Index) -> Wave:
        """The wave to some of the points only."""
        return Wave(self.amplitude[which], self.extra[which], self.aside[which])


@dataclass(frozen=True, eq=False)
class HalfTransparentPanel:
    """A half-transparent panel.

    Attributes
    ----------
    middle : Quad
        The rectangle halfway between its two faces.
    front : int
        Number of the quad that is its first face; the second face has the next number.
    thickness : float [m]
    """

    middle: Quad
    front: int
    thickness: float

    def met(self, start: Array, end: Array) -> tuple[Index, Array]:
        """Indices of the paths from starts to ends (n, 3) [m] that cross the panel, and their cosines of incidence."""
        way, normal = end - start, self.middle.normal
        before, along = (self.middle.center - start) @ normal, way @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            share = before / along
        which = np.flatnonzero((share > 0.0) & (share < 1.0))
        which = which[self.middle.holds(start[which] + share[which, None] * way[which])]
        return which, np.abs(along[which]) / np.linalg.norm(way[which], axis=1)


def half_transparent_panel(scene: Scene3D, solid: Solid, first_quad: int) -> HalfTransparentPanel | None:
    """The half-transparent panel whose first face is quad number `first_quad`; None for opaque solids."""
    panel = scene.surface[solid.surface]
    if not isinstance(panel, Panel) or panel.thickness is None:
        return None
    one, other = solid.quads
    return HalfTransparentPanel(
        Quad(0.5 * (one.center + other.center), one.right, one.up, solid.surface), first_quad, panel.thickness
    )


def after_passing(
    scene: Scene3D, panels: list[HalfTransparentPanel], start: Array, end: Array, turn: Array, frequency: float
) -> list[tuple[Index, list[Wave]]]:
    """Waves that half-transparent panels let through, on straight paths from starts to ends (n, 3) [m].

    The matrix `turn` (3, 3) turns directions on this leg of the path into those of the unfolded view.

    Returns
    -------
    list of (index, list of Wave)
        For each panel that paths cross: the indices (m,) of these paths, and the transmitted waves to m points.
    """
    found = []
    for panel in panels:
        which, cosine = panel.met(start, end)
        if not which.size:
            continue
        finish, at = scene.surface[panel.middle.surface], np.full((1, 1), frequency)
        series = transmitted(finish, at, cosine, named(scene.polarization))
        sight = end[which] - start[which]
        sight = sight / np.linalg.norm(sight, axis=1)[:, None]
        normal = np.sign(sight @ panel.middle.normal)[:, None] * panel.middle.normal
        towards = (cosine[:, None] * sight - normal) @ turn.T
        found.append((which, _waves(series, finish, panel.thickness, cosine, towards, frequency, through=True)))
    return found


def after_reflection(
    scene: Scene3D,
    panel: HalfTransparentPanel,
    normal: Array,
    sight: Array,
    cosine: Array,
    turn: Array,
    frequency: float,
) -> list[Wave]:
    """Waves that a panel reflects, at its face with the given normal and at its back face, into directions (n, 3).

    `sight` (n, 3) are the unit vectors from the face to the points, `cosine` (n,) the cosines of incidence. The matrix
    `turn` (3, 3) turns directions on the leg from the face to the points into those of the unfolded view.
    """
    finish, at = scene.surface[panel.middle.surface], np.full((1, 1), frequency)
    series = reflected(finish, at, cosine, named(scene.polarization))
    kept = np.sqrt(kept_share(finish))
    towards = (cosine[:, None] * sight - normal) @ turn.T
    # Paths are reflected at the face here, but at the middle of the wall in `slabs`.
    series = [(kept * amplitude, extra + panel.thickness * cosine) for amplitude, extra in series]
    return _waves(series, finish, panel.thickness, cosine, towards, frequency, through=False)


def _waves(
    series: WaveSeries,
    finish: Finish,
    thickness: float,
    cosine: Array,
    towards: Array,
    frequency: float,
    *,
    through: bool,
) -> list[Wave]:
    """The waves of a series, with the extra length L of each and the sideways shift ``dL/dt``.

    `towards` (n, 3) is the direction in which the angle of incidence t grows, of length sin t. N passages of a slab
    with thickness d have the optical length ``N d q``, whose derivative is ``-N d sin t cos t / q``. The straight path
    across the slab that they replace on transmission, ``-d cos t``, has the derivative ``d sin t``.
    """
    across = inside(permittivity(finish.material, frequency), np.arccos(np.clip(cosine, 0.0, 1.0))).real
    place = thickness if through else 0.0
    return [
        Wave(amplitude[0], extra, (place - (extra + place * cosine) * cosine / across**2)[:, None] * towards)
        for amplitude, extra in series
    ]


def one_after_another(waves: list[Wave], which: Index, later: list[Wave]) -> list[Wave]:
    """Waves to n points after those to some of the points, `which` (m,), have met a panel.

    The panel splits each wave into the waves `later`, to m points. Waves whose amplitude is below `WEAKEST_WAVE` at
    every point are left out.
    """
    found = []
    nothing = Wave(np.zeros(which.size, dtype=complex), np.zeros(which.size), np.zeros((which.size, 3)))
    for wave in waves:
        for number, more in enumerate(later or [nothing]):
            # Waves to all other points go on unchanged, as part of the first of the later waves only.
            amplitude = wave.amplitude.copy() if number == 0 else np.zeros_like(wave.amplitude)
            extra, aside = wave.extra.copy(), wave.aside.copy()
            amplitude[which] = wave.amplitude[which] * more.amplitude
            extra[which] += more.extra
            aside[which] += more.aside
            found.append(Wave(amplitude, extra, aside))
    return [wave for wave in found if np.abs(wave.amplitude).max(initial=0.0) >= WEAKEST_WAVE]


def there_and_back(waves: list[Wave]) -> list[Wave]:
    """Waves out and back: each pair of one wave on the way out and one on the way back.

    A pair has the product of the amplitudes, and the mean of the extra lengths and of the sideways shifts. Pairs of two
    different waves count twice. Pairs below `WEAKEST_WAVE` times the strongest amplitude are left out.
    """
    found = []
    for number, out in enumerate(waves):
        for other, back in enumerate(waves[number:], start=number):
            twice = 1.0 if other == number else 2.0
            amplitude = twice * out.amplitude * back.amplitude
            found.append(Wave(amplitude, 0.5 * (out.extra + back.extra), 0.5 * (out.aside + back.aside)))
    loudest = max((float(np.abs(wave.amplitude).max(initial=0.0)) for wave in found), default=0.0)
    return [wave for wave in found if np.abs(wave.amplitude).max(initial=0.0) >= WEAKEST_WAVE * loudest]


def strength(waves: list[Wave], points: int) -> NDArray[np.float64]:
    """Magnitude of the strongest of the waves to each of n points, (n,)."""
    return np.max([np.abs(wave.amplitude) for wave in waves], axis=0, initial=0.0) if waves else np.zeros(points)
