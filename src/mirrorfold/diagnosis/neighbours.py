"""Elements with phases of their own, told by their neighbours.

Two antennas less than a wavelength apart receive nearly the same echoes. The product of their samples, summed over all
frequencies and partners,

    R_i = sum s_i conj(s_{i+1}),

has the phase ``k u d`` of the mean direction u of the echoes, with the distance d. Along a row of equal steps it
changes slowly from element to element, whatever the scene is. If elements have phases of their own, from cables,
switches or a drift between the stops of a stage, or if their samples are in another order than their positions, the
magnitude of R may stay, but its phase jumps. This needs no wavefront, and holds on lines, gentle arcs and rows of
planar arrays; where antennas stand farther apart, or in unequal steps, nothing is claimed.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.diagnosis.findings import PLACES, Finding
from mirrorfold.sweep import antenna_positions, is_monostatic, wave_speed

LARGEST_STEP = 1.0
"""Largest distance between neighbours, in wavelengths, twice that of an antenna which sends and receives: farther apart
they receive different speckle."""

SAME_STEP = 0.05
"""Largest difference between two successive steps, as a share of a step: so much may an arc turn."""

FEWEST = 10
"""Smallest number of pairs of successive steps for a judgement."""

LEAST_COHERENCE = 0.1
"""Smallest median of ``|R_i|`` over the power of both neighbours. Where it is less, echoes come from all sides."""

ABOVE_NOISE = 3.0
"""The same, relative to one over the root of the number of samples of an element; of noise alone it is 0.83."""

STEADY = 0.5
"""Smallest steadiness ``|sum R_i* R_{i+1}| / sum |R_i R_{i+1}|`` of correct elements. In random sweeps of ten kinds of
arrays it was at least 0.89, mostly above 0.99, and with random phases at most 0.35."""

SURE = 0.95
"""Certainty of a finding."""

ENOUGH_SAMPLES = 10_000
"""Number of samples of an element that suffice; where there are more, every second, third ... frequency is taken."""


def phase_findings(sweep: xr.Dataset) -> list[Finding]:
    """The finding that elements of a valid sweep, of pairs or of one moving antenna, have phases of their own."""
    moving = is_monostatic(sweep)
    wavelength = wave_speed(sweep) / float(sweep["frequency"].mean())
    names = ("position",) if moving else ("tx", "rx")
    s = sweep["s"].values.reshape(-1, *sweep["s"].shape[-len(names) - 1 :])[0]
    s = s[:: max(1, s[:, 0].size // ENOUGH_SAMPLES)]
    unsteady = []
    for axis, (name, places) in enumerate(zip(names, antenna_positions(sweep), strict=False)):
        samples = np.moveaxis(s, 1 + axis, 0).reshape(len(places), -1)
        steadiness = _steadiness(samples, places, LARGEST_STEP * wavelength / (2.0 if moving else 1.0))
        if steadiness is not None and steadiness < STEADY:
            unsteady.append(PLACES[name])
    if not unsteady:
        return []
    what = (
        f"Neighbouring {' and '.join(unsteady)} measure the same echoes with phases that jump from one to the next: "
        "they have phases of their own, from cables, switches or a drift, or are in another order than their positions."
    )
    remedy = (
        "check the order of the positions; then measure a small sphere, and calibrate with --sphere and --sphere-at, "
        "which removes the phases"
    )
    return [Finding("element-phases", what, SURE, remedy, by_command=False)]


def _steadiness(s: NDArray[np.complexfloating], places: NDArray[np.float64], longest: float) -> float | None:
    """How steady the phase between neighbours is along a row, from 0 to 1; None where the row cannot tell.

    `s` (elements, samples) are all samples of each element at `places` (elements, 3) [m], and `longest` [m] the largest
    distance of neighbours.
    """
    step = np.diff(places, axis=0)
    length = np.linalg.norm(step, axis=1)
    usable = (np.linalg.norm(np.diff(step, axis=0), axis=1) <= SAME_STEP * length[1:]) & (length[1:] > 0.0)
    usable &= length[1:] <= longest
    if np.count_nonzero(usable) < FEWEST:
        return None
    power = np.array([float(np.vdot(row, row).real) for row in s])
    product = np.array([np.vdot(after, row) for row, after in pairwise(s)])
    norm = np.sqrt(power[:-1] * power[1:])
    product = np.divide(product, norm, out=np.zeros(len(norm), complex), where=norm > 0.0)
    least = max(LEAST_COHERENCE, ABOVE_NOISE / np.sqrt(s.shape[1]))
    turn = (product[1:] * product[:-1].conj())[usable]
    if np.median(np.sqrt(np.abs(turn))) < least:
        return None
    return float(np.abs(turn.sum()) / np.abs(turn).sum())
