"""Two walls are folded where they are long in resolution cells, whatever the frequency."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.reproducing.experiments import frequency
from mirrorfold.reproducing.findings import Findings
from mirrorfold.reproducing.parts.quality_table import quality_table
from mirrorfold.reproducing.parts.two_walls_family import MOST_RX, Setting, noise_power
from mirrorfold.reproducing.work import Work

pytestmark = [pytest.mark.slow, pytest.mark.replay]


@pytest.fixture(scope="module")
def found() -> Findings:
    return frequency.run(Work(quick=True))


def test_the_low_end_finds_not_both_walls_for_want_of_bandwidth(found):
    """At 60 GHz a bandwidth of 2 GHz is a cell of 7 cm: one of the walls is not found; with 10 GHz both are."""
    assert found.numbers["share_60_ghz_both_walls"] == 0.0
    for walls in ("fixed_60", "share_100", "share_150"):
        assert found.numbers[f"{walls}_ghz_both_walls"] == 1.0
    assert found.numbers["fixed_60_ghz_f_cells"] > 0.8
    assert found.numbers["share_150_ghz_f_cells"] > 0.8


def test_quality_rises_with_frequency(found):
    at = [found.numbers[f"share_{f}_ghz_f_2cm"] for f in (60, 100, 150)]
    assert np.all(np.diff(at) > 0.0)
    assert found.numbers["share_150_ghz_f_5cm"] > found.numbers["share_150_ghz_f_2cm"]


def test_full_waves_find_the_same_walls(found):
    waves = found.data.where(found.data["group"] == "full waves", drop=True)
    assert float(waves["both_walls"].min()) == 1.0
    assert found.numbers["waves_minus_rays_both_walls"] == 0.0
    assert -0.4 < found.numbers["waves_minus_rays_f_cells"] < 0.1


def test_scenes_are_the_same_for_all_radars():
    low, high = (Setting(frequency=f, bandwidth=0.034 * f).scene(3) for f in (80e9, 450e9))
    assert [surface.name for surface in low.surface] == [surface.name for surface in high.surface]
    for one, other in zip(low.surface, high.surface, strict=True):
        np.testing.assert_array_equal(one.sample(0.01)[0], other.sample(0.01)[0])


@pytest.mark.parametrize("middle", [60e9, 300e9, 1000e9])
def test_arrays_fill_the_aperture_without_grating_lobes(middle):
    array = Setting(frequency=middle, bandwidth=10e9).scene(0).array
    for place in (array.tx_position, array.rx_position):
        assert np.ptp(place[:, 0]) == pytest.approx(0.08)
    assert array.pitch <= 0.5 * 299792458.0 / (middle + 5e9) * (1 + 1e-9)
    assert len(array.rx_position) <= MOST_RX


def test_noise_is_that_of_friis_and_the_image_of_the_radar():
    """0 dBm and 20 dBi twice over a mirror at 1 m at 300 GHz return -48 dBm; noise is -114 dBm."""
    signal = 0.5
    assert 10 * np.log10(signal / noise_power(300e9)) == pytest.approx(-48.0 + 114.0, abs=0.3)


def test_table_of_a_cliff_is_a_cliff():
    rows = [
        {"wall_cells": cells, "cell_m": 1.0 / cells, "shown": float(cells > 10), "f_cells": float(cells > 10),
         "f_2cm": 0.02 * cells, "f_5cm": 0.05 * cells, "mirrored_db": 0.0, "frequency": cells, "bandwidth": 1.0,
         "aperture": 1.0, "seed": 0, "object_correlation": 1.0}
        for cells in np.geomspace(5.0, 19.9, 60)
    ]  # fmt: skip
    table = quality_table(rows)
    assert table["found"]["mean"][0] == 0.0
    assert table["found"]["mean"][-1] == 1.0
    # The F-score that was put in is the distance in cells.
    np.testing.assert_allclose(table["close"]["mean"], table["close"]["at"], rtol=0.05)
