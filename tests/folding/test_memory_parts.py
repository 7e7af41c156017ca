"""What folding is forecast to hold, part by part, for each kind of image."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from mirrorfold.common.forecasts import total
from mirrorfold.detection.search.fit import PROFILE_SAMPLES
from mirrorfold.detection.views.image_to_view import outline_of
from mirrorfold.detection.volume_echoes import MOST_ECHOES
from mirrorfold.folding.memory import DRAWING_ARRAYS, RIDGE_ARRAYS, fold_parts
from mirrorfold.tree.explaining import directions
from mirrorfold.tree.explaining.directions import CHUNK

AXES = {"z": np.linspace(-0.1, 0.1, 5), "y": np.linspace(0.5, 2.5, 201), "x": np.linspace(-1.0, 1.0, 201)}
PIXELS = 201 * 201


def image(dtype=np.complex64, dims=("y", "x"), **attrs):
    sizes = [AXES[name].size for name in dims]
    return xr.DataArray(np.ones(sizes, dtype=dtype), {name: AXES[name] for name in dims}, dims, attrs=attrs)


KNOWN = {"frequency_start": 290e9, "frequency_stop": 300e9, "frequency_points": 401, "tx_aperture": 0.08,
         "rx_aperture": 0.08}  # fmt: skip


def test_an_image_is_held_with_its_view_and_the_pictures():
    """With fine cells the view weighs most, with coarse ones the pictures do."""
    fine = image(**KNOWN)
    samples = float(outline_of(fine).range.size * outline_of(fine).u.size)
    parts = fold_parts(fine)
    assert parts == {
        "image": 8.0 * PIXELS, "view": 8.0 * samples, "power and table": DRAWING_ARRAYS * 8.0 * samples,
        "owners": 2.0 * samples, "pictures": 16.0 * PIXELS,
    }  # fmt: skip
    assert DRAWING_ARRAYS > RIDGE_ARRAYS
    coarse = image(**(KNOWN | {"frequency_stop": 291e9, "tx_aperture": 0.008, "rx_aperture": 0.008}))
    samples = float(outline_of(coarse).range.size * outline_of(coarse).u.size)
    assert fold_parts(coarse) == {
        "image": 8.0 * PIXELS, "view": 8.0 * samples, "power and table": DRAWING_ARRAYS * 8.0 * samples,
        "owners": 2.0 * samples, "pictures": 16.0 * PIXELS,
    }  # fmt: skip
    plain = fold_parts(coarse.real.astype(np.float32).assign_attrs(coarse.attrs))
    assert plain["image"] == 4.0 * PIXELS
    assert "splines" not in plain


def test_a_sweep_is_held_with_the_beams_that_its_echoes_are_tested_with(monkeypatch):
    """On each core phasors of the transmitters, what receivers hear of one frequency, and of groups of a half radian:
    40 mm of 10 GHz are 8.4. Two copies of a window of range: 140 mm of paths are 4.7 cells, with edges 26.7, a tenth
    more of bins, 31 whole ones, fast length 32. And the profiles of all pairs, 567 for 510 frequencies.
    """
    monkeypatch.setattr(directions, "cpu_count", lambda: 3)
    coarse = image(**(KNOWN | {"frequency_stop": 291e9, "tx_aperture": 0.008, "rx_aperture": 0.008}))
    parts = fold_parts(coarse, sweep_of(120, 160))
    assert parts["samples"] == 8.0 * 510 * 120 * 160
    profiles, window = 8.0 * 567 * 120 * 160, 2.0 * 8.0 * 32 * 120 * 160
    assert parts["directions of echoes"] == 3.0 * (8.0 * CHUNK * (3 * 120 + 18 * 160) + window)
    assert parts["range profiles"] == profiles


def test_range_profiles_are_held_until_the_pictures_are_drawn():
    drawn = fold_parts(image(**KNOWN), sweep_of(2, 2))
    assert "pictures" in drawn
    assert drawn["range profiles"] == 8.0 * 567 * 2 * 2


def test_a_small_sweep_is_held_with_the_finer_range_profiles_that_tell_late_echoes():
    """A thousand pairs, and as many more as have 8 million samples, four to a range cell; both are kept."""
    coarse = image(**(KNOWN | {"frequency_stop": 291e9, "tx_aperture": 0.008, "rx_aperture": 0.008}))
    parts = fold_parts(coarse, sweep_of(60, 80))
    assert parts["range profiles of pairs"] == 8.0 * 4 * 510 * (1000 + 2**23 // (4 * 510))


def sweep_of(transmitters, receivers):
    tx, rx = np.zeros((transmitters, 3)), np.zeros((receivers, 3))
    tx[:, 0], rx[:, 0] = np.linspace(-0.03, 0.03, transmitters), np.linspace(-0.04, 0.04, receivers)
    return xr.Dataset(
        {"s": (("frequency", "tx", "rx"), np.zeros((510, transmitters, receivers), dtype=np.complex64))},
        {
            "frequency": np.linspace(290e9, 300e9, 510), "tx_position": (("tx", "axis"), tx),
            "rx_position": (("rx", "axis"), rx),
        },
    )  # fmt: skip


def test_of_a_recording_one_frame_is_looked_at_and_all_are_held():
    one = image(**KNOWN)
    three = xr.concat([one] * 3, "frame", combine_attrs="override")
    assert fold_parts(three) == fold_parts(one) | {"image": 3.0 * 8.0 * PIXELS}


def test_of_voxels_their_amplitude_or_the_floor_plan_is_the_most():
    voxels = image(dims=("z", "y", "x"), **KNOWN)
    flat = fold_parts(voxels[0].real.drop_vars("z").astype(np.float32).assign_attrs(KNOWN))
    assert fold_parts(voxels) == flat | {"image": 5 * 8.0 * PIXELS, "floor plan": 4.0 * PIXELS}
    coarse = KNOWN | {"frequency_stop": 291e9, "tx_aperture": 0.008, "rx_aperture": 0.008}
    many = xr.concat([image(dims=("z", "y", "x"), **coarse)] * 4, "z", combine_attrs="override")
    assert fold_parts(many) == {"image": 20 * 8.0 * PIXELS, "amplitude of the voxels": 20 * 4.0 * PIXELS}


@pytest.mark.parametrize(("dtype", "own"), [(np.complex64, True), (np.float32, False)])
@pytest.mark.parametrize("ranges", [40, 4000])
def test_a_volume_is_held_with_its_echoes_and_fits_or_owners(dtype, own, ranges):
    """The scan that was focused to be folded is itself what is looked at."""
    axes = {"range": 1.0 + 0.01 * np.arange(ranges), "azimuth": np.arange(6.0), "elevation": np.arange(5.0)}
    volume = xr.DataArray(np.ones((ranges, 6, 5), dtype=dtype), axes, ("range", "azimuth", "elevation"))
    parts = fold_parts(volume)
    size = 30.0 * ranges
    assert parts.pop("image") == volume.nbytes
    assert parts.pop("amplitude", None) == (4.0 * size if own else None)
    assert parts.pop("echoes") == 24.0 * MOST_ECHOES * 30.0
    fits = 3.0 * 8.0 * PROFILE_SAMPLES * 30.0
    assert parts == ({"owners": 2.0 * size} if 2.0 * size > fits else {"profiles across a wall": fits})
    assert total(parts) == max(2.0 * size, fits)
