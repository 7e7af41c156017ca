"""Images of raster scans, as volumes of range, azimuth and elevation, in voxels and from above: analytic echoes."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from scans import FREQUENCY, SPOT, panel, point_sweep, scene
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.common.beams import beam_angles, beam_direction, beam_radius
from mirrorfold.common.statistics import in_equal_steps
from mirrorfold.common.windows import window
from mirrorfold.detection.views.volume_view import to_volume_view
from mirrorfold.detection.volume_echoes import find_runs
from mirrorfold.focusing.scans.gridding import plan_view, to_voxels
from mirrorfold.focusing.scans.range_profiles import focus_raster


def test_the_volume_is_the_focusing_sum():
    sweep = point_sweep((0.02, 1.2, 0.01), (-0.03, 1.5, 0.02), noise=0.01)
    volume = focus_raster(sweep, limits=(0.9, 1.8), padding=2, remove_leakage=False)
    range_ = volume["range"].values[::37]
    assert range_[0] >= 0.9
    assert volume["range"].values[-1] <= 1.8
    steer = np.exp(4j * np.pi / speed_of_light * np.outer(range_, FREQUENCY)) * window("hann", FREQUENCY.size, "t")
    expected = np.einsum("rf,fae->rae", steer, sweep["s"].values)
    assert np.abs(volume.values[::37] - expected).max() < 1e-5 * np.abs(expected).max()


def test_leakage_is_taken_away_and_the_scene_stays():
    clean = point_sweep((0.02, 1.2, 0.01))
    leak = 0.5 * np.exp(-4j * np.pi * FREQUENCY * 0.1 / speed_of_light)
    leaking = clean.assign(s=clean["s"] + leak[:, None, None].astype(np.complex64))
    near = focus_raster(leaking, limits=(0.0, 0.3))
    kept = focus_raster(leaking, limits=(0.0, 0.3), remove_leakage=False)
    assert np.abs(near).max() < 1e-3 * np.abs(kept).max()
    scene_with, scene_without = (np.abs(focus_raster(s, limits=(1.0, 1.4))) for s in (leaking, clean))
    assert float(np.abs(scene_with - scene_without).max()) < 0.02 * float(scene_without.max())


def test_peaks_have_the_range_to_a_fraction_of_a_sample():
    for distance in np.linspace(1.2, 1.205, 5):
        volume = to_volume_view(focus_raster(point_sweep((0.0, distance, 0.0), noise=0.003)))
        cloud = find_runs(volume)
        best = np.argmax(cloud.amplitude)
        assert cloud.range[best] == pytest.approx(distance, abs=2e-4)
        assert np.linalg.norm(cloud.position[best] - [0.0, distance, 0.0]) < 1e-3


@pytest.mark.parametrize("name", ["uniform", "hann", "taylor"])
def test_side_lobes_and_cells_are_those_of_the_users_own_weights(name):
    """Whether a window is given by its name or by its weights, the volume's view knows it."""
    scan = point_sweep((0.0, 1.2, 0.0), noise=0.003)
    by_name, own = (
        to_volume_view(focus_raster(scan, taper=taper)) for taper in (name, window(name, FREQUENCY.size, "taper"))
    )
    assert own.range_cell == pytest.approx(by_name.range_cell, rel=0.02)
    assert own.side_lobes[:50] == pytest.approx(by_name.side_lobes[:50], rel=0.05)


def test_normalization_undoes_the_spreading():
    sweep = point_sweep((0.0, 1.2, 0.0), noise=0.01)
    width = beam_radius(1.2, wavelength=speed_of_light / FREQUENCY.mean(), **SPOT)
    plain = np.abs(focus_raster(sweep).sel(range=1.2, method="nearest"))
    for normalization, gain in (("none", 1.0), ("r2", 1.2**2), ("beam", (width / 0.017) ** 2)):
        volume = np.abs(focus_raster(sweep, normalization=normalization).sel(range=1.2, method="nearest"))
        assert np.allclose(volume / plain, gain, rtol=0.01)


def test_plan_view_shows_the_strongest_of_each_column():
    volume = focus_raster(point_sweep((0.03, 1.2, 0.05), (-0.03, 1.4, -0.05)))
    plan = plan_view(volume, pixel=0.005)
    assert plan.dims == ("y", "x")
    for x, y in ((0.03, 1.2), (-0.03, 1.4)):
        near = plan.where((np.abs(plan["x"] - x) < 0.03) & (np.abs(plan["y"] - y) < 0.03), 0.0)
        row, column = np.unravel_index(int(near.values.argmax()), near.shape)
        assert plan["x"].values[column] == pytest.approx(x, abs=0.006)
        assert plan["y"].values[row] == pytest.approx(y, abs=0.006)
        assert float(near.max()) == pytest.approx(float(np.abs(volume).max()), rel=0.15)
    assert mf.fold(plan).attrs["mirrorfold_kind"] == "reconstruction"


@pytest.mark.parametrize("angle", [80.0, 130.0, 180.0, -180.0, 270.0, 1000.0])
def test_scans_that_look_aside_or_back_are_seen_from_above_and_in_voxels(angle):
    ahead = focus_raster(point_sweep((0.03, 1.2, 0.02)))
    turned = ahead.assign_coords(azimuth=ahead["azimuth"] + angle)
    x, y, _ = beam_direction(np.degrees(np.arctan2(0.03, 1.2)) + angle, 0.0) * np.hypot(0.03, 1.2)
    plan = plan_view(turned)
    brightest = plan.stack(pixel=("y", "x"))[int(plan.values.argmax())]
    assert np.hypot(brightest["x"] - x, brightest["y"] - y) < 0.01
    assert float(plan.max()) == pytest.approx(float(plan_view(ahead).max()), rel=0.15)
    there, here = (float(to_voxels(volume, x=[a], y=[b], z=[0.02])[0, 0, 0])
                   for volume, a, b in ((turned, x, y), (ahead, 0.03, 1.2)))  # fmt: skip
    assert there == pytest.approx(here, rel=1e-3)


@pytest.mark.parametrize("view", [plan_view, lambda volume: to_voxels(volume, x=[0.0], y=[1.2], z=[0.0])])
@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda v: v[:, ::-1], "azimuth does not rise; sort it"),
        (lambda v: v[:, :, ::-1], "elevation does not rise; sort it"),
        (lambda v: v[np.r_[:40, 60 : v.sizes["range"]]], "range does not rise in equal steps"),
        (lambda v: v.assign_coords(elevation=v["elevation"] + 95.0), "elevations go beyond -90 to 90 degrees"),
        (lambda v: v[:, :1], "needs a coordinate azimuth .* with at least 2 values"),
        (lambda v: v[:1], "needs a coordinate range .* with at least 2 values"),
        (lambda v: v.drop_vars("azimuth"), "needs a coordinate azimuth"),
        (lambda v: v.where(v["azimuth"] > 0.0), "samples are not finite"),
    ],
)
def test_volumes_that_would_be_drawn_wrong_are_refused(change, said, view):
    with pytest.raises(mf.InputError, match=f"^volume: .*{said}"):
        view(change(focus_raster(point_sweep((0.03, 1.2, 0.02)), limits=(0.8, 1.6))))


def test_voxels_interpolate_the_volume():
    volume = focus_raster(point_sweep((0.03, 1.2, 0.02)), limits=(0.8, 1.6))
    x, y, z = np.linspace(-0.04, 0.04, 5), np.linspace(1.1, 1.3, 4), np.linspace(-0.03, 0.03, 3)
    voxels = to_voxels(volume, x=x, y=y, z=z)
    assert voxels.dims == ("z", "y", "x")
    grid = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1)
    azimuth, elevation = beam_angles(grid)
    where = {name: xr.DataArray(values, dims=("x", "y", "z")) for name, values in (
        ("range", np.linalg.norm(grid, axis=-1)), ("azimuth", azimuth), ("elevation", elevation))}  # fmt: skip
    expected = np.abs(volume).interp(where).transpose("z", "y", "x").values
    assert np.abs(voxels.values - expected).max() < 1e-3 * expected.max()
    assert mf.focus(point_sweep((0.03, 1.2, 0.02)), x=x, y=y, z=z).dims == ("z", "y", "x")


@pytest.mark.slow
def test_angles_with_two_decimals_or_the_play_of_a_drive_are_equal_steps_and_fold():
    sweep = mf.simulate(scene(panel(), beams=37))
    azimuth = sweep["azimuth"].values
    assert not in_equal_steps(azimuth.round(1))  # steps of 0.444 degrees
    play = 0.1 * np.random.default_rng(0).uniform(-1.0, 1.0, azimuth.size)
    for written in (azimuth.round(1), azimuth + play * np.diff(azimuth).mean()):
        volume = mf.focus(sweep.assign_coords(azimuth=written))
        assert in_equal_steps(volume["azimuth"].values)
        np.testing.assert_allclose(volume["azimuth"], azimuth, atol=0.1 * np.diff(azimuth).mean())
        assert mf.fold(volume)["mirrors"].sizes["mirror"] == 1
    uneven = np.degrees(np.arcsin(np.linspace(-0.5, 0.5, azimuth.size)))
    np.testing.assert_array_equal(mf.focus(sweep.assign_coords(azimuth=uneven))["azimuth"], uneven)
