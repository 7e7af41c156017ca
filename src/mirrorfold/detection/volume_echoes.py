"""Step 2 in three dimensions, first half: the echoes in a raster volume as a cloud of points.

Everything is judged beam by beam: a beam's echoes are the runs of its range profile that stand above the noise. Where
neighbouring beams see the same surface, those count whose axis passes near it.
"""

from __future__ import annotations

import numba
import numpy as np

from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array
from mirrorfold.detection.echoes import Echoes, brightest_of, reference_echo
from mirrorfold.detection.volume_view import VolumeView

THRESHOLD_DB = -26.0
"""Echoes of objects reach this far below the robust reference: Lambert's law takes 15 dB at 80 degrees from the normal,
and speckle fades by as much as 10 dB."""

RUN_DB = -12.0
"""An echo's run of samples ends where its amplitude falls this far below its peak: speckle fades by as much."""

RIDGE_DB = -9.0
"""An echo this far below the one that a neighbouring beam sees at the same range is the edge of that beam's: at 0.7
beam radii the two-way pattern has fallen by as much."""

MOST_ECHOES = 24
"""In one beam; the strongest count."""


def find_runs(view: VolumeView, *, threshold_db: float = THRESHOLD_DB) -> Echoes:
    """All echoes above the noise, strong above a threshold [dB] relative to the reference echo.

    Their ranges are the centres of power of the runs, finer than a sample.
    """
    cell = max(1, round(0.5 * view.range_cell / view.dr))
    columns, rows = view.shape
    beams = np.zeros((columns, rows * MOST_ECHOES), dtype=np.int64)
    found = np.zeros((columns, rows * MOST_ECHOES, 2))
    counts = np.zeros(columns, dtype=np.int64)

    def column(i: int) -> None:
        counts[i] = _runs_of(
            view.amplitude, i, np.float32(view.floor), np.float32(10.0 ** (RUN_DB / 20.0)),
            np.float32(10.0 ** (RIDGE_DB / 20.0)), view.side_lobes, cell, beams[i], found[i],
        )  # fmt: skip

    for_each(column, range(columns))
    beam = np.concatenate([beams[i, :n] + i * rows for i, n in enumerate(counts)])
    values = np.concatenate([found[i, :n] for i, n in enumerate(counts)])
    range_: Array = view.range[0] + view.dr * values[:, 0]
    gain = np.interp(range_, view.range, view.gain)
    amplitude = values[:, 1] * gain
    reference = reference_echo(brightest_of(beam, amplitude))
    threshold = reference * 10.0 ** (threshold_db / 20.0)
    return Echoes.found(
        view.points(range_, beam), range_, beam, amplitude, np.ones(beam.size), view.floor * gain, threshold, reference
    )


def find_voxels(view: VolumeView, *, threshold_db: float) -> Echoes:
    """Every sample above a threshold [dB] relative to the brightest one, as published."""
    level = view.amplitude.reshape(-1, view.range.size) * view.gain
    brightest = float(level.max())
    threshold = brightest * 10.0 ** (threshold_db / 20.0)
    beam, sample = np.nonzero((level >= threshold) & (level > 0.0))
    range_ = view.range[sample]
    return Echoes.pixels(view.points(range_, beam), range_, beam, np.ones(beam.size), brightest, threshold)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _runs_of(amplitude, column, floor, run, ridge, lobes, cell, beams, found):  # type: ignore[no-untyped-def]
    """Echoes of all beams of one azimuth: elevation index, fractional range index and peak amplitude of each.

    The strongest sample of a beam begins a run that goes on, both ways, as long as no more than `cell` samples lie
    below ``run`` times the peak; the next run begins at the strongest sample that is left and no side lobe of the runs
    before it.
    """
    edges = np.zeros((MOST_ECHOES, 2), dtype=np.int64)
    brightness = np.zeros(MOST_ECHOES, dtype=np.float32)
    columns, rows, size = amplitude.shape
    taken = np.zeros(size, dtype=np.bool_)
    count = 0
    for j in range(rows):
        profile = amplitude[column, j]
        taken[:] = False
        candidates = np.flatnonzero(profile > floor)
        order = candidates[np.argsort(-profile[candidates])]
        here = runs = 0
        for k in order:
            if taken[k]:
                continue
            if here == MOST_ECHOES or runs == MOST_ECHOES:
                break
            side_lobe = False
            for m in range(runs):
                away = max(edges[m, 0] - k, k - edges[m, 1])
                side_lobe = side_lobe or profile[k] < brightness[m] * lobes[max(away, 1) - 1]
            if side_lobe:
                continue
            low = max(run * profile[k], 0.5 * floor)
            first, gap, n = k, 0, k
            while n > 0 and gap <= cell and not taken[n - 1]:
                n -= 1
                gap = gap + 1 if profile[n] < low else 0
                if gap == 0:
                    first = n
            last, gap, n = k, 0, k
            while n + 1 < size and gap <= cell and not taken[n + 1]:
                n += 1
                gap = gap + 1 if profile[n] < low else 0
                if gap == 0:
                    last = n
            power = moment = 0.0
            for n in range(first, last + 1):
                power += profile[n] * profile[n]
                moment += n * profile[n] * profile[n]
            for n in range(max(first - cell, 0), min(last + cell + 1, size)):
                taken[n] = True
            edges[runs, 0], edges[runs, 1], brightness[runs] = first, last, profile[k]
            runs += 1
            brightest = profile[k]
            for a in range(max(column - 1, 0), min(column + 2, columns)):
                for b in range(max(j - 1, 0), min(j + 2, rows)):
                    for n in range(max(k - cell, 0), min(k + cell + 1, size)):
                        brightest = max(brightest, amplitude[a, b, n])
            if profile[k] < ridge * brightest:
                continue
            beams[count] = j
            found[count, 0] = moment / power
            found[count, 1] = profile[k]
            count += 1
            here += 1
    return count
