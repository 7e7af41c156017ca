"""Mistakes in raster scans, which show in the direction of time alone."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from scans import ball, content, panel
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.common.beams import beam_direction, beam_radius
from mirrorfold.diagnosis import diagnose
from mirrorfold.scenes.floor_plan import parse_scene


def named(sweep):
    return tuple(sorted(finding.name for finding in diagnose(sweep)[0]))


def raster_scan(seed, *, leakage, depth=(0.5, 1.3)):
    """Speckle at a depth [m] of the ambiguous range, 2 m, in focused beams."""
    random = np.random.default_rng(seed)
    frequency = np.linspace(270e9, 300e9, 401)
    angle = np.linspace(-6.0, 6.0, 25)
    depth = random.uniform(*depth, 1500)
    aim = beam_direction(random.uniform(-6.5, 6.5, 1500), random.uniform(-6.5, 6.5, 1500))
    width = beam_radius(depth, spot_radius=0.017, focus_distance=1.6, wavelength=1.05e-3)
    beams = beam_direction(angle[:, None], angle).reshape(-1, 3)
    off = depth * np.sqrt(np.maximum(1.0 - (beams @ aim.T) ** 2, 0.0))
    echo = random.standard_normal((1500, 2)).view(complex)[:, 0] * np.exp(-2.0 * (off / width) ** 2) / width**2
    k = 2 * np.pi * frequency / speed_of_light
    s = (np.exp(-2j * k[:, None] * depth) @ echo.T).reshape(-1, 25, 25)
    if leakage:
        s += 0.1 * np.abs(s).max() * np.exp(-2j * k * 0.1)[:, None, None]
    sweep = mf.make_raster_sweep(s, frequency=frequency, azimuth=angle, elevation=angle)
    return mf.add_noise(sweep, snr_db=20.0, seed=seed)


@pytest.mark.slow
def test_leakage_tells_that_the_range_axis_runs_forward():
    for seed in range(3):
        sweep = raster_scan(seed, leakage=True)
        assert named(sweep) == ()
        for repair in (mf.calibrate.conjugate, mf.calibrate.reverse_frequency):
            assert named(repair(sweep)) == ("range-reversed",)
        assert diagnose(sweep)[1]["waves"]


@pytest.mark.slow
def test_echoes_that_arrive_late_are_no_leakage():
    """All of them in a few range bins, in which the median of few independent beams is far above the usual level."""
    for seed in range(5):
        sweep = raster_scan(seed, leakage=False, depth=(1.7, 1.75))
        assert diagnose(sweep) == ([], {"waves": False, "exchange": False})


def turned_aperture(seed, *, spot_radius, focus_distance, depth):
    """A row of beams of a focused aperture that turns about its middle, among random scatterers at a depth [m].

    The field of each beam is the sum over the aperture, of which an exact distance leads to each scatterer.
    """
    random = np.random.default_rng(seed)
    frequency = np.linspace(270e9, 300e9, 401)
    k = 2 * np.pi * frequency / speed_of_light
    middle = k.mean()
    radius = 2.0 * focus_distance / (middle * spot_radius)
    azimuth = np.linspace(-8.0, 8.0, 41)
    range_ = random.uniform(*depth, 1500)
    angle = np.radians(random.uniform(-11.0, 11.0, 1500) - azimuth[:, None])
    across, ahead = range_ * np.sin(angle), range_ * np.cos(angle)
    field = sum(
        np.exp(-((x / radius) ** 2) + 1j * middle * (np.hypot(x, focus_distance) - np.hypot(across - x, ahead)))
        for x in np.linspace(-2.5 * radius, 2.5 * radius, 81)
    )
    echo = (field * np.exp(1j * middle * range_)) ** 2 * random.standard_normal((1500, 2)).view(complex)[:, 0]
    s = np.exp(-2j * k[:, None] * range_) @ echo.T
    sweep = mf.make_raster_sweep(
        s[:, :, None],
        frequency=frequency,
        azimuth=azimuth,
        elevation=[0.0],
        spot_radius=spot_radius,
        focus_distance=focus_distance,
    )
    return mf.add_noise(sweep, snr_db=20.0, seed=seed)


@pytest.mark.slow
@pytest.mark.parametrize(("spot_radius", "depth"), [(0.017, (1.0, 1.9)), (0.03, (0.3, 0.9))])
def test_speckle_over_an_angle_that_is_the_same_at_all_ranges_tells_nothing_of_range(spot_radius, depth):
    """It passed for speckle of echoes from beyond the ambiguous range, and for that of a reversed range axis."""
    for seed in range(3):
        sweep = turned_aperture(seed, spot_radius=spot_radius, focus_distance=3.6, depth=depth)
        for one in (sweep, mf.calibrate.conjugate(sweep)):
            assert diagnose(one) == ([], {"waves": False, "exchange": False})


@pytest.mark.slow
def test_walls_alone_tell_which_way_range_runs():
    """Without leakage, and with nothing known of the beam."""
    wall = panel(center=(0.1, 2.0, 0.0), normal=(-0.3, -1.0, 0.1))
    sweep = mf.simulate(parse_scene(content(wall, half=10.0)), seed=0, snr_db=10.0)
    for name in ("spot_radius", "focus_distance"):
        del sweep.attrs[name]
    assert named(sweep) == ()
    (finding,) = diagnose(mf.calibrate.reverse_frequency(sweep))[0]
    assert finding.name == "range-reversed"
    assert "flat" in finding.what
    frames = mf.calibrate.conjugate(sweep).expand_dims(frame=2)
    assert named(frames) == ("range-reversed",)


def test_a_complex_volume_of_the_scan_is_never_held():
    """With the amplitude beside it, it would be three times as large as the samples: range is sampled twice a cell."""
    azimuth, elevation = np.linspace(-20.0, 20.0, 80), np.linspace(-15.0, 15.0, 60)
    frequency = 220e9 + 50e6 * np.arange(301)
    wall = 1.5 / (np.cos(np.radians(azimuth))[:, None] * np.cos(np.radians(elevation)))
    s = np.exp(-4j * np.pi / speed_of_light * frequency[:, None, None] * wall)
    sweep = mf.add_noise(
        mf.make_raster_sweep(s, frequency=frequency, azimuth=azimuth, elevation=elevation), snr_db=40.0, seed=0
    )
    assert named(mf.calibrate.conjugate(sweep)) == ("range-reversed",)  # loads kernels, too
    tracemalloc.start()
    try:
        assert named(sweep) == ()
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 3 * sweep["s"].nbytes


def test_a_scan_in_unequal_steps_is_described_though_it_cannot_be_folded():
    sweep = raster_scan(0, leakage=True).isel(azimuth=[0, 1, 2, *range(5, 25)])
    assert named(sweep) == ()
    assert "azimuth" in str(mf.info(sweep))
    with pytest.raises(mf.InputError, match="azimuth does not rise in equal steps"):
        mf.reconstruct(sweep)


@pytest.mark.parametrize("snr_db", [None, 90.0])
def test_beams_that_meet_nothing_are_no_silent_channels(snr_db):
    """A ball in the middle of the scan: most beams pass beside it, and are 40 dB and more below those that meet it."""
    scan = mf.simulate(content(ball(center=(0.0, 2.0, 0.0)), half=12.0, points=401), snr_db=snr_db)
    power = np.mean(np.abs(scan["s"].values) ** 2, axis=0)
    assert np.mean(power < 1e-4 * power.max()) > 0.5
    assert diagnose(scan)[0] == []


def far_wall():
    """A room's back wall, 6.4 m away."""
    return panel("far", (0.0, 6.4, 0.0), (0.2, -1.0, 0.1), 4.0, 4.0, material="pec", diffuse_fraction=0.8)


@pytest.mark.slow
@pytest.mark.parametrize("near", [True, False])
@pytest.mark.parametrize("points", [1001, 1501, 2201])
def test_a_wall_out_of_focus_feigns_no_reversed_range(near, points):
    """The ambiguous range is 5, 7.5 or 11 m. Reversed, pieces of the far wall passed for flat walls, or for leakage."""
    wall = panel("near", (0.25, 2.0, 0.0), (-0.5, -0.9, 0.0), 0.35, 1.0, material="pec", diffuse_fraction=0.2)
    scan = {"beams": 61, "points": points, "half": 10.0, "focus_distance": 2.4}
    sweep = mf.simulate(parse_scene(content(*([wall] * near), far_wall(), **scan)), seed=0, snr_db=20.0, force=True)
    assert named(sweep) == ()
