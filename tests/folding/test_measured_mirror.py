"""Measured waves with a mirror: an ultrasonic array on a block of aluminium, whose back wall shows a notch from below.

Places in mm. The notch stands at (6.7, 19.6); the back wall lies 40.8 deep, and shows the notch's underside at
(6.7, 59.1), 16 dB below the wall. The wall returns at 80, sent back by the array's own surface. A layer draws a copy
5.2 behind each echo that the wall sends back, some 20 dB below it.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.folding.confident import confident_points


@pytest.fixture(scope="module")
def found(shared_data):
    return mf.reconstruct(mf.import_data(shared_data / "arim/contact_notch_aluminium.mat", mapping="arim"))


def objects(found, bounces):
    """Places of objects seen by that many mirrors, folded and as in the image, (2, n, 2) [mm]."""
    table = confident_points(found)
    table = table.isel(point=(table["bounces"].values == bounces) & (table["surface"].values == "object"))
    return 1e3 * np.array([[table["x"], table["y"]], [table["x_initial"], table["y_initial"]]]).swapaxes(1, 2)


@pytest.mark.slow
def test_the_back_wall_is_the_only_mirror(found):
    table = found["mirrors"].to_dataset(inherit=False)
    assert table.sizes["mirror"] == 1
    (x0, y0), (x1, y1) = (1e3 * np.ravel([table[f"x{end}"], table[f"y{end}"]]) for end in (0, 1))
    assert abs(np.degrees(np.arctan((y1 - y0) / (x1 - x0)))) < 0.2
    assert 0.5 * (y0 + y1) == pytest.approx(40.8, abs=0.3)


@pytest.mark.slow
def test_the_notch_is_seen_from_below_and_nothing_is_made_of_copies(found):
    folded, image = objects(found, 1)
    assert len(folded)
    assert np.linalg.norm(image - [6.7, 59.1], axis=1).max() < 2.0
    assert np.linalg.norm(folded.mean(axis=0) - [6.7, 22.5]) < 1.0
    assert np.linalg.norm(folded - [6.7, 22.5], axis=1).max() < 2.0


@pytest.mark.slow
def test_the_notch_itself_and_the_far_corners_of_the_block_stay(found):
    direct, _ = objects(found, 0)
    for place in ([6.7, 19.6], [-52.6, 41.3], [65.3, 42.1]):
        assert np.linalg.norm(direct - place, axis=1).min() < 0.7


@pytest.mark.slow
def test_the_array_sees_its_own_surface(found):
    assert "the radar sees itself in mirror 0, 0.080" in found.attrs["remark"]
    for bounces in (0, 1):
        _, image = objects(found, bounces)
        assert not np.any((np.abs(image[:, 0]) < 16.0) & (image[:, 1] > 75.0))


@pytest.mark.slow
@pytest.mark.parametrize("pixel", [0.2, 0.25])
def test_rows_of_cars_seen_from_the_air_are_no_mirrors(shared_data, pixel):
    """One antenna that sends and hears: its side lobes fall as slowly as those of one array, not of two."""
    flight = mf.import_data(sorted((shared_data / "gotcha").glob("*.mat")), mapping="gotcha")
    axis = np.arange(-50.0, 50.0, pixel)
    found = mf.fold(mf.focus(flight, x=axis, y=axis))
    assert "no mirror was found: the radar looks down by 46 degrees" in found.attrs["remark"]
    table = found["objects"].to_dataset(inherit=False)
    assert not table["bounces"].any()
    brightest = table.isel(point=int(table["amplitude"].argmax("point")))
    assert np.hypot(brightest["x"] + 15.5, brightest["y"] - 21.5) < 0.7


def test_antennas_around_a_scene_see_no_mirror_in_it(shared_data):
    scans = [mf.import_data(shared_data / f"merit/B0_P3_p0{n}.csv", mapping="merit") for n in ("00", "36")]
    difference = scans[0].assign(s=scans[0]["s"] - scans[1]["s"]).assign_attrs(wave_speed=speed_of_light / 8.0**0.5)
    pixels = np.arange(-0.07, 0.07, 0.002)
    found = mf.fold(mf.focus(difference, x=pixels, y=pixels, z=0.0275))
    assert found.attrs["remark"].startswith("no mirror was found: ")
    assert not found["mirrors"].sizes["mirror"]
