"""The transmitters and the receivers of a sweep as apertures: their windows, beams and grating lobes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mirrorfold.common.types import Array
from mirrorfold.detection.views.image_view import LARGEST_SINE

SAME_PLACE = 1e-3
"""Elements closer than this share of the shortest wavelength count as one place: their phases do not differ."""

MAIN_LOBE, LIKE_THE_MAIN_ONE = 2.0, 0.75
"""Half-width of the main lobe under a Hann window, in wavelengths over the aperture; and the height, relative to the
main lobe, from which on another lobe cannot be distinguished from the main one."""

BAND_SAMPLES, ABOVE_FULL = 9, 2.0
"""Number of frequencies at which lobes are computed; and the least height of a lobe that counts, in side lobes of a
full aperture, which are never taken for echoes."""

STEPS_A_LOBE = 4
"""Number of steps of frequency in which a lobe wanders by its own width, where its mean over the band is taken."""

LOBE_SAMPLES = 1_000_000
"""Number of phases of lobes that are computed at once; bounds the memory."""


class Aperture(NamedTuple):
    """The transmitters, or the receivers, with weights that lower the side lobes of bright glints.

    The `weight` (n,) of elements at `position` (n, 3) [m] is a Hann window along the aperture's principal axis;
    elements at the same place share its weight. `places` counts the different places, `centre` (3,) [m] is their mean.
    """

    position: Array
    weight: Array
    centre: Array
    places: int

    @classmethod
    def of(cls, position: Array, wavelength: float) -> Aperture:
        """The aperture of elements at positions (n, 3) [m]; `wavelength` [m] says which of them coincide."""
        distance = SAME_PLACE * wavelength
        rounded, place, count = np.unique(np.rint(position / distance), axis=0, return_inverse=True, return_counts=True)
        place, places = place.ravel(), rounded * distance
        centre = places.mean(axis=0)
        # `np.unique` sorts the places, so that the principal axis does not depend on the order of the elements.
        along = (places - centre) @ _axis(places - centre)
        # The window reaches half a mean pitch beyond the outermost places, so that none of them has the weight zero.
        length = max(float(np.ptp(along)), distance)
        margin = 0.5 * length / np.unique(np.rint(along / distance)).size
        share = (along - along.min() + margin) / (np.ptp(along) + 2.0 * margin)
        return cls(position, (np.sin(np.pi * share) ** 2 / count)[place], centre, count.size)

    @property
    def along(self) -> Array:
        """Places of the elements along the principal axis, from the centre, (n,) [m]."""
        offset = self.position - self.centre
        return offset @ _axis(offset)

    def beam(self, k: float, sine: Array) -> Array:
        """Amplitude of the beam, relative to its peak, in directions whose u differs from its own by `sine`, (m,)."""
        along = self.along
        parts = np.array_split(sine, 1 + sine.size * along.size // LOBE_SAMPLES)  # bounds the memory
        level = np.concatenate([np.abs(np.exp(1j * k * np.outer(part, along)) @ self.weight) for part in parts])
        return level / self.weight.sum()


def _axis(offset: Array) -> Array:
    """The principal axis of positions (n, 3) about their centre, a unit vector."""
    return np.linalg.svd(offset, full_matrices=False)[2][0]


def grating_lobe(aperture: Aperture, k: float) -> float:
    """Height of an aperture's largest grating lobe at the wavenumber k [rad/m], relative to the main lobe.

    Zero if there is none. Lobes nearly as high as the main lobe do not count, such as those of antennas more than a
    wavelength apart: they cannot be distinguished from it.
    """
    length = float(np.ptp(aperture.along)) * k / (2.0 * np.pi)  # in wavelengths
    if length < 1.0:
        return 0.0
    level = aperture.beam(k, np.arange(MAIN_LOBE / length, 2.0 * LARGEST_SINE, 0.5 / length))
    lobes = level[1:-1][(level[1:-1] >= level[:-2]) & (level[1:-1] >= level[2:])]
    return float(lobes.max(initial=0.0, where=lobes < LIKE_THE_MAIN_ONE))


def beside_main_lobe(sides: list[Aperture], k: Array, sine: Array) -> Array:
    """Amplitude, relative to an echo, of its lobe in the image at directions whose u differs by `sine`, (n,).

    This is the product of the beams of both apertures, the `sides`, unweighted, as in an image all antennas count
    alike. The largest product over the band of wavenumbers `k` [rad/m] is taken, for grating lobes wander with the
    wavelength. It is set to zero where it is not well above the side lobes of full apertures of the same lengths L in
    wavelengths, ``1 / (pi L u)`` for each aperture.
    """
    some = np.linspace(float(k[0]), float(k[-1]), BAND_SAMPLES)
    level = _lobes(sides, some, sine).max(axis=0)
    lengths = [float(np.ptp(side.along)) * some[0] / (2.0 * np.pi) for side in sides]
    full = np.prod([1.0 / np.maximum(np.pi * length * np.abs(sine), 1.0) for length in lengths], axis=0)
    return np.where(level > ABOVE_FULL * full, level, 0.0)


def wandering_lobes(sides: list[Aperture], k: Array, sine: Array, weights: Array, beyond: Array) -> Array:
    """Amplitude, relative to an echo, of its lobe in the image of the whole band, (m, n).

    A lobe wanders as the wavelength changes. So each direction holds it in a part of the band only: it is lower there
    than at a single frequency, and longer in range. It is looked at `sine` (n,) aside of the echo, in u, and `beyond`
    (m,) [m] farther away than the echo, or nearer; `sides` and `k` are as in `beside_main_lobe`, and `weights` (w,) are
    those of the image over the band.
    """
    length, band = max(float(np.ptp(side.along)) for side in sides), float(k[-1] - k[0])
    wanders = band * length / (2.0 * np.pi) * float(np.abs(sine).max(initial=0.0))  # in widths of a lobe
    share = np.linspace(0.0, 1.0, max(BAND_SAMPLES, int(np.ceil(STEPS_A_LOBE * wanders)) + 1))
    weight = np.interp(share, np.linspace(0.0, 1.0, weights.size), weights)
    lobe = _lobes(sides, float(k[0]) + share * band, sine)
    return np.abs(np.exp(2j * band * np.outer(beyond, share)) * weight @ lobe) / weight.sum()


def _lobes(sides: list[Aperture], k: Array, sine: Array) -> Array:
    """Product of the beams of both apertures, unweighted, at wavenumbers (m,) and differences in u (n,): (m, n)."""
    sides = [side._replace(weight=np.ones(len(side.position))) for side in sides]
    return np.stack([np.prod([side.beam(float(one), sine) for side in sides], axis=0) for one in k])
