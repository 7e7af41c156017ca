"""Antennas that stand kilometres apart are judged, or not, without filling the memory."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from mirrorfold.diagnosis import diagnose
from mirrorfold.diagnosis.wavefronts import wavefronts
from mirrorfold.sweep.pairs import pairs_of

LARGE = 1 << 30
"""More than the memory that any step of this takes [bytes]."""


@pytest.mark.parametrize("distance", [300.0, 3e4])
def test_the_memory_does_not_grow_with_the_distance_of_the_transmitters(sweep, distance):
    far = sweep.assign_coords(tx_position=sweep["tx_position"] + distance)
    tracemalloc.start()
    try:
        diagnose(far)
        assert tracemalloc.get_traced_memory()[1] < LARGE
    finally:
        tracemalloc.stop()


def test_an_array_with_so_large_gaps_has_no_wavefronts(sweep):
    places = sweep["tx_position"].values * [1.0, 0.0, 0.0]
    near = sweep.assign_coords(tx_position=(("tx", "axis"), places), rx_position=(("rx", "axis"), places))
    assert wavefronts(pairs_of(near), exchange=False) is not None
    far = near.assign_coords(rx_position=near["rx_position"] + np.array([0.0, 3e4, 0.0]))
    assert wavefronts(pairs_of(far), exchange=False) is None
