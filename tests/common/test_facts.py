"""What attributes and coordinates of images say that cannot be is refused wherever the images are used."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scans import point_sweep

import mirrorfold as mf
from mirrorfold.common.facts import radar_place

VOLUME = mf.focus(point_sweep((0.03, 1.2, 0.02)))
PLAN = mf.plan_view(VOLUME)
AXIS = np.linspace(-0.1, 0.1, 5)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("radar_position", "here"),
        ("radar_position", [1.0]),
        ("radar_position", [1.0, np.nan, 0.0]),
        ("frequency_start", "300 GHz"),
        ("frequency_stop", 1e9),
        ("frequency_points", "many"),
        ("spot_radius", -1.0),
        ("wave_speed", 0.0),
        ("range_resolution", np.array([1.0, 2.0])),
    ],
)
@pytest.mark.parametrize(
    "use",
    [
        lambda **fact: mf.fold(VOLUME.assign_attrs(fact)),
        lambda **fact: mf.fold(PLAN.assign_attrs(fact)),
        lambda **fact: mf.plan_view(VOLUME.assign_attrs(fact)),
        lambda **fact: mf.to_voxels(VOLUME.assign_attrs(fact), x=AXIS, y=1.2 + AXIS, z=AXIS),
    ],
    ids=["fold a volume", "fold a plan view", "plan view", "voxels"],
)
def test_facts_that_cannot_be_are_refused_in_one_sentence(use, name, value):
    with pytest.raises(mf.InputError, match=rf"^(image|volume): attr {name} is ") as refused:
        use(**{name: value})
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("use", [mf.fold, mf.plan_view], ids=["fold", "plan view"])
def test_angles_that_say_to_be_in_radians_are_no_degrees(use):
    radian = ("azimuth", np.radians(VOLUME["azimuth"].values), {"units": "radian"})
    with pytest.raises(mf.InputError, match="azimuth is in radian"):
        use(VOLUME.assign_coords(azimuth=radian))


@pytest.mark.parametrize("known", [True, False], ids=["band known", "band unknown"])
@pytest.mark.parametrize(
    "use",
    [mf.fold, mf.plan_view, lambda volume: mf.to_voxels(volume, x=AXIS, y=1.2 + AXIS, z=AXIS)],
    ids=["fold", "plan view", "voxels"],
)
def test_angles_that_are_probably_in_radians_are_doubted(use, known):
    """A scan over 30 x 8 degrees in steps of 0.5 degrees, whose angles are stored in radians without a unit."""
    azimuth, elevation = np.arange(-15.0, 15.5, 0.5), np.arange(-4.0, 4.5, 0.5)
    range_ = 1.0 + 0.01 * np.arange(40)
    sides = np.meshgrid(range_, azimuth, elevation, indexing="ij")
    near = np.exp(-(((sides[0] - 1.2) / 0.02) ** 2) - ((sides[1] - 3.0) / 1.5) ** 2 - (sides[2] / 1.5) ** 2)
    axes = {"range": range_, "azimuth": np.radians(azimuth), "elevation": np.radians(elevation)}
    band = {"frequency_start": 270e9, "frequency_stop": 300e9} if known else {}
    volume = xr.DataArray(near.astype(np.complex64), dims=list(axes), coords=axes, attrs=band)
    with pytest.warns(UserWarning, match=r"reach no farther than 0\.262 degrees .* probably in radians\. Remedy"):
        use(volume)
    axes |= {"azimuth": azimuth, "elevation": elevation}
    use(volume.assign_coords(axes))  # warnings are errors


def test_a_place_on_the_floor_is_as_good_as_one_in_space():
    assert radar_place({"radar_position": [1.0, 2.0]}).tolist() == [1.0, 2.0, 0.0]
    assert radar_place({}).tolist() == [0.0, 0.0, 0.0]
    flat, full = (mf.fold(VOLUME.assign_attrs(radar_position=place)) for place in ([1.0, 2.0], [1.0, 2.0, 0.0]))
    xr.testing.assert_identical(flat["objects"].to_dataset(), full["objects"].to_dataset())


@pytest.mark.parametrize("dims", [("elevation", "range", "azimuth"), ("azimuth", "elevation", "range")])
def test_a_volume_in_another_order_is_told_how_to_sort_it(dims):
    with pytest.raises(mf.InputError, match=r"image\.transpose\('range', 'azimuth', 'elevation'\) sorts them"):
        mf.fold(VOLUME.transpose(*dims))


def test_voxels_in_another_order_are_told_how_to_sort_them():
    voxels = mf.to_voxels(VOLUME, x=AXIS, y=1.2 + AXIS, z=AXIS)
    with pytest.raises(mf.InputError, match=r"image\.transpose\('z', 'y', 'x'\) sorts them"):
        mf.fold(voxels.transpose("y", "x", "z"))


def test_a_volume_of_another_tool_is_told_how_it_becomes_one_of_ours(tmp_path):
    axes = {name: VOLUME[name].values for name in VOLUME.dims}
    np.savez(tmp_path / "scan.npz", image=VOLUME.values, **axes)
    with pytest.raises(
        mf.InputError, match=r"seems to be a volume of range, azimuth and elevation; make it .* mf\.save"
    ):
        mf.import_image(tmp_path / "scan.npz")
    mf.save(xr.DataArray(VOLUME.values, dims=VOLUME.dims, coords=axes), tmp_path / "scan.nc")
    assert mf.load(tmp_path / "scan.nc").shape == VOLUME.shape
