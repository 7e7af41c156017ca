"""Compile kernels in a second process, while the first one does other work: only the first command takes that long.

Numba compiles one kernel after the other, on one core, and keeps the results on disk. So another process folds a small
sweep of its own; when the first process comes to the same kernels, it finds most of them there.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from mirrorfold.common.signals import ended_as_by_ctrl_c

if TYPE_CHECKING:
    import xarray as xr

    from mirrorfold.common.types import Array

BAND, FREQUENCIES = (290e9, 300e9), 151
"""Start and stop [Hz] and number of the frequencies of the small sweep."""

ANTENNAS, APERTURE = 81, 0.04
"""Number and extent [m] of its antennas, the same for transmitters and receivers: enough for the fast algorithms."""

WALL, THING = ((-0.1, 1.3), (0.6, 1.0)), ((0.35, 1.75), (0.5, 1.6))
"""Ends (x, y) [m] of the wall that it shows, and of the image of a thing in this wall."""

SPACING = 0.004
"""Distance [m] of the scatterers of both."""

POSTS, POST_SPACING, BRIGHT = ((-0.6, 1.0), (-0.9, 2.4)), 0.15, 10.0
"""Ends [m] of a row of posts, their distance [m], and how much brighter they are than the scatterers: bright echoes
apart from each other are searched for their copies."""


@contextmanager
def kernels_compiled_beside() -> Iterator[None]:
    """While the block runs, another process compiles the kernels that focus and fold a sweep of a floor plan.

    None is started where the kernels are compiled already or are never compiled, nor on a machine of one core.
    """
    from mirrorfold.common.kernels import is_compiled
    from mirrorfold.common.threads import cpu_count
    from mirrorfold.folding.drawing import draw_row  # the last one of a reconstruction

    if cpu_count() == 1 or is_compiled(draw_row):
        yield
        return
    quiet = subprocess.DEVNULL
    with subprocess.Popen([sys.executable, "-P", "-m", __name__], stdin=quiet, stdout=quiet, stderr=quiet) as other:
        try:
            yield
        finally:
            other.terminate()


def small_sweep() -> xr.Dataset:
    """A sweep of a rough wall, the image of a thing in it, and posts, as single scatterers."""
    import numpy as np
    from scipy.constants import speed_of_light

    import mirrorfold as mf

    random = np.random.default_rng(0)
    spaced = (WALL, SPACING), (THING, SPACING), (POSTS, POST_SPACING)
    lines = [_between(np.array(ends), spacing) for ends, spacing in spaced]
    place = np.concatenate(lines)
    amplitude = random.standard_normal(len(place)) + 1j * random.standard_normal(len(place))
    amplitude[-len(lines[-1]) :] *= BRIGHT
    antenna = np.zeros((ANTENNAS, 3))
    antenna[:, 0] = np.linspace(-0.5, 0.5, ANTENNAS) * APERTURE
    range_ = np.hypot(*(place[:, None] - antenna[:, :2]).transpose(2, 0, 1))
    frequency = np.linspace(*BAND, FREQUENCIES)
    s = np.empty((frequency.size, ANTENNAS, ANTENNAS), dtype=np.complex64)
    for i, one in enumerate(frequency):
        way = (np.exp(-2j * np.pi * one / speed_of_light * range_) / range_).astype(np.complex64)
        s[i] = (amplitude.astype(np.complex64)[:, None] * way).T @ way
    return mf.make_sweep(s, frequency=frequency, tx_position=antenna, rx_position=antenna)


def _between(ends: Array, spacing: float) -> Array:
    """Places (n, 2) [m] from one of two ends (2, 2) [m] to the other, `spacing` [m] apart."""
    import numpy as np

    count = round(float(np.hypot(*(ends[1] - ends[0]))) / spacing) + 1
    return ends[0] + np.linspace(0.0, 1.0, count)[:, None] * (ends[1] - ends[0])


def main() -> None:
    """Reconstruct the small sweep."""
    import mirrorfold as mf

    with ended_as_by_ctrl_c():
        mf.reconstruct(small_sweep())


if __name__ == "__main__":
    main()
