"""Step 2 in three dimensions, first half: the echoes in a raster volume, as a cloud of points.

The search goes beam by beam. Each unbroken run of samples above the noise in the range profile of a beam is one echo.
Neighbouring beams overlap, and see the same surface: an echo counts only in the beams whose axis passes near it, where
it is about as bright as in the neighbouring beams.
"""

from __future__ import annotations

import numpy as np

from mirrorfold.common.decibels import ratio_of
from mirrorfold.common.kernels import njit
from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array
from mirrorfold.detection.echoes import Echoes, brightest_of, reference_echo
from mirrorfold.detection.views.volume_view import VolumeView

THRESHOLD_DB = -26.0
"""Threshold [dB] of strong echoes, relative to the robust reference: at 80 degrees from the normal, Lambert's law makes
an echo 15 dB weaker, and speckle fades by as much as 10 dB."""

RUN_DB = -12.0
"""Level [dB], relative to its peak, at which the run of samples of an echo ends: speckle fades by as much."""

RIDGE_DB = -9.0
"""Least level [dB] of an echo, relative to the brightest sample that neighbouring beams hold at the same range. A
weaker one is the neighbour's echo at the edge of this beam: at 0.7 beam radii the two-way pattern has fallen by as
much."""

MOST_ECHOES = 24
"""Largest number of runs in one beam, counted from the strongest."""


def find_runs(view: VolumeView, *, threshold_db: float = THRESHOLD_DB) -> Echoes:
    """All echoes above the noise; those above a threshold [dB] relative to the reference echo are strong.

    The range of an echo is the centroid of power of its run of samples, and so finer than a sample.
    """
    cell = max(1, round(0.5 * view.range_cell / view.dr))
    columns, rows = view.shape
    beams = np.zeros((columns, rows * MOST_ECHOES), dtype=np.int64)
    found = np.zeros((columns, rows * MOST_ECHOES, 2))
    counts = np.zeros(columns, dtype=np.int64)

    def column(i: int) -> None:
        counts[i] = _runs_of(
            view.amplitude, i, np.float32(view.floor), np.float32(ratio_of(RUN_DB)),
            np.float32(ratio_of(RIDGE_DB)), view.side_lobes, cell, beams[i], found[i],
        )  # fmt: skip

    for_each(column, range(columns))
    beam = np.concatenate([beams[i, :n] + i * rows for i, n in enumerate(counts)])
    values = np.concatenate([found[i, :n] for i, n in enumerate(counts)])
    range_: Array = view.range[0] + view.dr * values[:, 0]
    gain = np.interp(range_, view.range, view.gain)
    amplitude = values[:, 1] * gain
    reference = reference_echo(brightest_of(beam, amplitude))
    threshold = reference * ratio_of(threshold_db)
    places, length = view.points(range_, beam), np.ones(beam.size)
    return Echoes.found(places, range_, beam, amplitude, length, view.floor * gain, threshold, reference)


def find_voxels(view: VolumeView, *, threshold_db: float) -> Echoes:
    """Echoes of the published algorithm: every sample above a threshold [dB] relative to the brightest sample."""
    level = view.amplitude.reshape(-1, view.range.size) * view.gain
    brightest = float(level.max())
    threshold = brightest * ratio_of(threshold_db)
    beam, sample = np.nonzero((level >= threshold) & (level > 0.0))
    range_ = view.range[sample]
    return Echoes.pixels(view.points(range_, beam), range_, beam, np.ones(beam.size), brightest, threshold)


@njit(makes_arrays=True, nogil=True, error_model="numpy")
def _runs_of(amplitude, column, floor, run, ridge, lobes, cell, beams, found):  # type: ignore[no-untyped-def]
    """Echoes of all beams of one azimuth: elevation index, fractional range index and peak amplitude of each.

    The strongest sample of a beam begins a run. The run goes on to both sides until more than `cell` samples in a row
    lie below ``run`` times its peak, or below half the noise floor. The next run begins at the strongest sample that is
    in no run yet, nor a side lobe of an earlier one. Each beam has at most `MOST_ECHOES` runs. A run is an echo if its
    peak is at least ``ridge`` times the largest amplitude that this beam and its neighbours hold within `cell` samples.
    """
    rows, size = amplitude.shape[1:]
    edges = np.zeros((MOST_ECHOES, 2), dtype=np.int64)
    brightness = np.zeros(MOST_ECHOES, dtype=np.float32)
    count = 0
    for j in range(rows):
        profile = amplitude[column, j]
        claimed = np.zeros(size, dtype=np.bool_)
        candidates = np.flatnonzero(profile > floor)
        runs = 0
        for k in candidates[np.argsort(-profile[candidates])]:
            if runs == MOST_ECHOES:
                break
            skipped = claimed[k]
            for m in range(runs):
                away = max(edges[m, 0] - k, k - edges[m, 1], 1)
                skipped |= profile[k] < brightness[m] * lobes[away - 1]
            if skipped:
                continue
            low = max(run * profile[k], 0.5 * floor)
            for side in range(2):
                edges[runs, side], gap, n = k, 0, k + 2 * side - 1
                while 0 <= n < size and gap <= cell and not claimed[n]:
                    gap = gap + 1 if profile[n] < low else 0
                    edges[runs, side] = n if gap == 0 else edges[runs, side]
                    n += 2 * side - 1
            first, last = edges[runs]
            claimed[max(first - cell, 0) : last + cell + 1] = True
            brightness[runs] = profile[k]
            runs += 1
            around = amplitude[max(column - 1, 0) : column + 2, max(j - 1, 0) : j + 2, max(k - cell, 0) : k + cell + 1]
            if profile[k] >= ridge * around.max():
                power = profile[first : last + 1].astype(np.float64) ** 2
                beams[count] = j
                found[count, 0] = first + (np.arange(power.size) * power).sum() / power.sum()
                found[count, 1] = profile[k]
                count += 1
    return count
