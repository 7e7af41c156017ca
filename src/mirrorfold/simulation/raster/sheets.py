"""Panels that waves pass through: what they reflect and let through, as waves that each go a way of their own.

Every term of Airy's sums (`mirrorfold.simulation.rays.slabs`) is a wave of its own, longer by L, which depends on the
angle of incidence t. The unfolded way stays straight, and what stands at its end seems to stand L farther and
``dL/dt`` aside, away from the normal of the panel: the direction from which the wave arrives follows from how its phase
changes along the scanner. Both are exact to first order; what is left out is of the order of ``(dL/dt)^2`` over the
length of the way, some micrometres.
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
from mirrorfold.simulation.rays.slabs import LEAST, Series, reflected, transmitted


@dataclass(frozen=True, eq=False)
class Wave:
    """What becomes of a wave on its way to points: one of several that arrive one after the other.

    Attributes
    ----------
    amplitude : (n,) complex array
    extra : (n,) array [m]
        By how much its way is longer than the straight one.
    aside : (n, 3) array [m]
        By how much the points seem to stand aside of it, in the unfolded view of the scanner.
    """

    amplitude: Complex
    extra: Array
    aside: Array

    @classmethod
    def straight(cls, points: int) -> Wave:
        """One that nothing has met."""
        return cls(np.ones(points, dtype=complex), np.zeros(points), np.zeros((points, 3)))

    def take(self, which: Mask | Index) -> Wave:
        """To some of the points."""
        return Wave(self.amplitude[which], self.extra[which], self.aside[which])


@dataclass(frozen=True, eq=False)
class Sheet:
    """A panel that waves pass through.

    Attributes
    ----------
    middle : Quad
        The rectangle halfway between its faces.
    front : int
        Number of the quad of its first face; the second follows.
    thickness : float [m]
    """

    middle: Quad
    front: int
    thickness: float

    def met(self, start: Array, end: Array) -> tuple[Index, Array]:
        """Which ways from starts to ends (n, 3) [m] lead through it, and the cosines of their angles to its normal."""
        way, normal = end - start, self.middle.normal
        before, along = (self.middle.center - start) @ normal, way @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            share = before / along
        which = np.flatnonzero((share > 0.0) & (share < 1.0))
        which = which[self.middle.holds(start[which] + share[which, None] * way[which])]
        return which, np.abs(along[which]) / np.linalg.norm(way[which], axis=1)


def sheet_of(scene: Scene3D, solid: Solid, first_quad: int) -> Sheet | None:
    """The panel as a sheet, its first face being the quad of that number; None for all that is opaque."""
    panel = scene.surface[solid.surface]
    if not isinstance(panel, Panel) or panel.thickness is None:
        return None
    one, other = solid.quads
    return Sheet(Quad(0.5 * (one.center + other.center), one.right, one.up, solid.surface), first_quad, panel.thickness)


def after_passing(
    scene: Scene3D, sheets: list[Sheet], start: Array, end: Array, turn: Array, frequency: float
) -> list[tuple[Index, list[Wave]]]:
    """What sheets let through of waves that go from starts to ends (n, 3) [m], sheet by sheet: which they meet.

    `turn` (3, 3) leads from the scene to the unfolded view.
    """
    found = []
    for sheet in sheets:
        which, cosine = sheet.met(start, end)
        if not which.size:
            continue
        finish, at = scene.surface[sheet.middle.surface], np.full((1, 1), frequency)
        series = transmitted(finish, at, cosine, named(scene.polarization))
        sight = end[which] - start[which]
        sight = sight / np.linalg.norm(sight, axis=1)[:, None]
        normal = np.sign(sight @ sheet.middle.normal)[:, None] * sheet.middle.normal
        towards = (cosine[:, None] * sight - normal) @ turn.T
        found.append((which, _waves(series, finish, sheet.thickness, cosine, towards, frequency, through=True)))
    return found


def after_reflection(
    scene: Scene3D, sheet: Sheet, normal: Array, sight: Array, cosine: Array, turn: Array, frequency: float
) -> list[Wave]:
    """What the face of a sheet with that normal reflects into directions (n, 3), and its back face behind it.

    `turn` leads from the scene behind the face to the unfolded view.
    """
    finish, at = scene.surface[sheet.middle.surface], np.full((1, 1), frequency)
    series = reflected(finish, at, cosine, named(scene.polarization))
    kept = np.sqrt(kept_share(finish))
    towards = (cosine[:, None] * sight - normal) @ turn.T
    # Ways are reflected in the face here, in the middle of the wall there.
    series = [(kept * amplitude, extra + sheet.thickness * cosine) for amplitude, extra in series]
    return _waves(series, finish, sheet.thickness, cosine, towards, frequency, through=False)


def _waves(
    series: Series, finish: Finish, thickness: float, cosine: Array, towards: Array, frequency: float, *, through: bool
) -> list[Wave]:
    """The waves of a series; `towards` (n, 3) is the direction in which the angle grows, of length sin t.

    A length ``N d q`` inside has the derivative ``-N d sin t cos t / q``, and the place of the slab that is left out,
    ``-d cos t``, ``d sin t``.
    """
    across = inside(permittivity(finish.material, frequency), np.arccos(np.clip(cosine, 0.0, 1.0))).real
    place = thickness if through else 0.0
    return [
        Wave(amplitude[0], extra, (place - (extra + place * cosine) * cosine / across**2)[:, None] * towards)
        for amplitude, extra in series
    ]


def one_after_another(waves: list[Wave], which: Index, later: list[Wave]) -> list[Wave]:
    """Waves (n,) of which some, `which` (m,), become later ones (m,); those that are too weak are left out."""
    found = []
    nothing = Wave(np.zeros(which.size, dtype=complex), np.zeros(which.size), np.zeros((which.size, 3)))
    for wave in waves:
        for number, more in enumerate(later or [nothing]):
            # Those that meet nothing go on, once.
            amplitude = wave.amplitude.copy() if number == 0 else np.zeros_like(wave.amplitude)
            extra, aside = wave.extra.copy(), wave.aside.copy()
            amplitude[which] = wave.amplitude[which] * more.amplitude
            extra[which] += more.extra
            aside[which] += more.aside
            found.append(Wave(amplitude, extra, aside))
    return [wave for wave in found if np.abs(wave.amplitude).max(initial=0.0) >= LEAST]


def there_and_back(waves: list[Wave]) -> list[Wave]:
    """What returns by the same ways: every pair of waves, at the mean of their lengths and directions."""
    found = []
    for number, out in enumerate(waves):
        for other, back in enumerate(waves[number:], start=number):
            twice = 1.0 if other == number else 2.0
            amplitude = twice * out.amplitude * back.amplitude
            found.append(Wave(amplitude, 0.5 * (out.extra + back.extra), 0.5 * (out.aside + back.aside)))
    loudest = max((float(np.abs(wave.amplitude).max(initial=0.0)) for wave in found), default=0.0)
    return [wave for wave in found if np.abs(wave.amplitude).max(initial=0.0) >= LEAST * loudest]


def strength(waves: list[Wave], points: int) -> NDArray[np.float64]:
    """Amplitude of the strongest of waves (n,), (n,)."""
    return np.max([np.abs(wave.amplitude) for wave in waves], axis=0, initial=0.0) if waves else np.zeros(points)
