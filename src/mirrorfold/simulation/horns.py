"""Horn antennas, simulated as rows of point sources.

A horn of width w radiates like its aperture field, ``cos(pi x / w)`` in the H-plane (Balanis, Antenna Theory, 4th ed.,
section 13.3). That field is sampled by point sources at most half a wavelength apart. All horns of an array share one
lattice of point sources: any solver simulates the lattice, and the samples of each horn are a weighted sum of those of
its sources. So the pattern acts in every path, reflected or not, and where the pitch is half a wavelength there are
hardly more sources than antennas. The pattern is that of the cosine to within a tenth of its peak.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light

from mirrorfold.scenes.arrays import LinearArray
from mirrorfold.scenes.floor_plan import Scene

HALF_WAVE_TOLERANCE = 0.01
"""Share of half a wavelength by which the spacing of the sources may exceed it: the grating lobe stays at endfire."""

Complex64 = NDArray[np.complex64]


def point_sources(scene: Scene) -> tuple[Scene, Callable[[Complex64], Complex64]]:
    """The scene with point sources in place of horns, and the function that sums their samples to those of the horns.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    scene : Scene
    gather : callable
        From samples (frequencies, sources, sources) to (frequencies, tx, rx).
    """
    receivers = scene.array if scene.array.rx is None else scene.array.rx
    if scene.array.horn is None and receivers.horn is None:
        return scene, lambda s: s
    shortest = speed_of_light / scene.band.stop
    tx, tx_weight = _lattice(scene.array, shortest)
    rx, rx_weight = _lattice(receivers, shortest)
    seen = replace(scene, array=replace(tx, rx=None if scene.array.rx is None else rx))

    def gather(s: Complex64) -> Complex64:
        return np.asarray(tx_weight @ s @ rx_weight.T, dtype=np.complex64)

    return seen, gather


def _lattice(array: LinearArray, wavelength: float) -> tuple[LinearArray, NDArray[np.float32]]:
    """Lattice of point sources for all horns of an array, and the weights of each horn, (antennas, sources).

    The weights of a horn sum to one.
    """
    if array.horn is None:
        return replace(array, rx=None), np.eye(len(array.present), dtype=np.float32)
    finer = max(1, int(np.ceil(array.pitch / (0.5 * wavelength) - HALF_WAVE_TOLERANCE)))
    spacing = array.pitch / finer
    aside = int(np.ceil(0.5 * array.horn / spacing)) - 1
    sources = (array.elements - 1) * finer + 1 + 2 * aside
    taper = np.cos(np.pi * spacing * np.arange(-aside, aside + 1) / array.horn)
    weight = np.zeros((array.elements, sources), dtype=np.float32)
    for element in range(array.elements):
        weight[element, element * finer : element * finer + taper.size] = taper / taper.sum()
    lattice = LinearArray(elements=sources, pitch=spacing, center=array.center, direction=array.direction)
    return lattice, weight[array.present]
