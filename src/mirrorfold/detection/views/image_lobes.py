"""Side lobes of echoes in an image: how bright they may be, and where.

The side lobes of a uniform array of D wavelengths have the envelope ``1 / (pi D u)``, one way. So the side lobes of an
echo of amplitude A reach ``A / ((pi D_tx du) (pi D_rx du))`` at the distance du in u. Those in range have the envelope
of the window over frequency, if it is known. If one array has gaps that the pairs with the other array fill, its
grating lobes are as high as its main lobe, and lie in the nulls of the other's beam. The lobes of the product then fall
only as ``1 / (pi D u)``, with D the length of the filled array.

The sum over an aperture leaves only what its two ends contribute, and each end keeps an echo at its own distance. So
the lobes in u lie on two circles, one about each end, and both have half of the amplitude. Where both arrays are
extended, the lobes have fallen to nothing before the circles separate. Where only one is, as in a synthetic aperture,
they fall as ``1 / (pi D u)``, and the circles are several range cells apart.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter1d

from mirrorfold.common.types import Array
from mirrorfold.common.windows import side_lobe_envelope

if TYPE_CHECKING:
    from mirrorfold.detection.views.image_view import ImageView

LOWEST_LOBE = 1e-5
"""Lower side lobes, relative to their echo, do not count: no instrument has a dynamic range of 100 dB."""

LOBE_CELLS = 1.5
"""Distance from an echo, in resolution cells, at which its side lobes begin."""

FARTHEST_FILLED = 1.5
"""Distance in u up to which the lobes of a filled array are claimed in full: at two its main lobe comes again."""


def side_lobes(view: ImageView) -> Array:
    """Amplitude that side lobes of brighter echoes may reach, (nr, nu).

    Both kinds are computed for intervals of distances, which begin at `LOBE_CELLS` and grow by 30 % each, and by 10 %
    in range, where lobes fall faster.
    """
    claim = np.zeros_like(view.amplitude)
    _claim_aside(claim, view.amplitude, view, 1.0)
    if view.one_way:
        for end in (-0.5 * view.glint, 0.5 * view.glint):
            from_end = np.zeros_like(claim)
            _claim_aside(from_end, view.from_along(end).amplitude, view, 0.5)
            from_end = maximum_filter1d(from_end, 3, axis=0)  # rows were rounded
            np.maximum(claim, from_end[view.row(view.distance_along(end)), np.arange(view.u.size)], out=claim)
    envelope = np.zeros(0)
    if view.window.size:
        distance = np.arange(view.range.size) * view.dr / view.range_unit
        envelope = side_lobe_envelope(view.window, distance)
    near = max(1, int(LOBE_CELLS * view.range_cell / view.dr + 1e-6))  # rounding may leave a whole number short
    while near < envelope.size and envelope[near] > LOWEST_LOBE:
        far = near + 2 * int(0.05 * near)
        _claim(claim.T, view.amplitude.T, near, far, float(envelope[near]))
        near = far + 1
    return claim


def _claim_aside(claim: Array, amplitude: Array, view: ImageView, share: float) -> None:
    """Raise `claim` (nr, nu), in place, to a `share` of the side lobes in u of an `amplitude` (nr, nu)."""
    near = max(1, int(LOBE_CELLS * view.u_cell / view.du + 1e-6))
    while near < view.u.size:
        far = max(near + 1, int(1.3 * near))
        tx, rx = (max(1.0, np.pi * length * near * view.du) for length in (view.aperture_tx, view.aperture_rx))
        fall = tx * rx
        if view.aperture_filled:  # of places half a wavelength apart, lobes rise again beyond u = 1
            aside = np.minimum([near * view.du, far * view.du], FARTHEST_FILLED)
            fall = min(fall, max(1.0, 2.0 * view.aperture_filled * float(np.sin(0.5 * np.pi * aside).min())))
        _claim(claim, amplitude, near, far, share / fall)
        near = far


def _claim(claim: Array, amplitude: Array, near: int, far: int, level: float) -> None:
    """Raise `claim` (n, m), in place, to `level` times the brightest `amplitude` (n, m) that lies `near` to `far`
    samples away along the last axis, on either side.
    """
    size, count = far - near + 1, claim.shape[1]
    # The filter looks at a sample, at size // 2 samples before it, and at the rest of its size after it.
    even = 1 - size % 2
    after, before = min(far - size // 2, count), min(near + size // 2, count)
    seen = np.pad(amplitude, ((0, 0), (0, 1))) if even else amplitude
    brightest = level * (seen if size == 1 else maximum_filter1d(seen, size, axis=1, mode="constant"))
    np.maximum(claim[:, after:], brightest[:, : count - after], out=claim[:, after:])
    np.maximum(claim[:, : count + even - before], brightest[:, before:], out=claim[:, : count + even - before])
