"""Volumes of raster scans at any speed of the waves, and their plan views and voxels."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.common.beams import beam_radius
from mirrorfold.errors import InputError
from mirrorfold.focusing import focus_raster

AZIMUTH, ELEVATION = np.linspace(-6.0, 6.0, 13), np.linspace(-4.0, 4.0, 9)
SPOT = {"spot_radius": 0.01, "focus_distance": 0.6}


def scan(speed=None, slower=1.0, **attrs):
    """A scan of two echoes and some noise; `slower` divides frequencies, whose wavelengths stay for a slower wave."""
    frequency = np.linspace(270e9, 300e9, 201) / slower
    rng = np.random.default_rng(0)
    s = 0.01 * (rng.standard_normal((201, 13, 9)) + 1j * rng.standard_normal((201, 13, 9)))
    k = 2 * np.pi * frequency / (speed_of_light / slower)
    for range_, beam in ((0.5, (3, 4)), (0.8, (9, 2))):
        s[:, *beam] += np.exp(-2j * k * range_)
    attrs |= {} if speed is None else {"wave_speed": speed}
    return mf.make_raster_sweep(s, frequency=frequency, azimuth=AZIMUTH, elevation=ELEVATION, **SPOT, **attrs)


@pytest.mark.parametrize("normalization", ["none", "r2", "beam"])
@pytest.mark.parametrize("given", [False, True])
def test_half_the_frequency_at_half_the_speed_gives_the_same_volume(normalization, given):
    light = mf.focus(scan(), normalization=normalization)
    half = 0.5 * speed_of_light
    slow = scan(slower=2.0) if given else scan(half, slower=2.0)
    slow = mf.focus(slow, normalization=normalization, wave_speed=half if given else None)
    np.testing.assert_allclose(slow.range, light.range, rtol=1e-12)
    np.testing.assert_allclose(slow.values, light.values, rtol=1e-5, atol=1e-6 * float(np.abs(light).max()))
    for name in ("ambiguous_range", "range_resolution"):
        assert slow.attrs[name] == pytest.approx(light.attrs[name], rel=1e-12)
    assert slow.attrs["wave_speed"] == half
    assert light.attrs["wave_speed"] == speed_of_light
    assert slow.attrs["frequency_stop"] == 150e9


def test_an_echo_stands_at_its_range_in_a_slow_medium():
    volume = mf.focus(scan(0.5 * speed_of_light, slower=2.0))
    profile = np.abs(volume.values[:, 3, 4])
    assert float(volume.range[int(profile.argmax())]) == pytest.approx(0.5, abs=float(volume.range[1]))
    assert volume.attrs["ambiguous_range"] == pytest.approx(speed_of_light / 2 / 150e6, rel=1e-9)


def test_the_beam_that_is_undone_has_the_wavelength_of_the_medium():
    speed = 0.5 * speed_of_light
    plain, undone = (focus_raster(scan(speed), normalization=kind) for kind in ("none", "beam"))
    width = beam_radius(plain.range.values, **SPOT, wavelength=speed / 285e9)
    gain = undone.values[1:, 3, 4] / plain.values[1:, 3, 4]
    np.testing.assert_allclose(gain.real, (width[1:] / SPOT["spot_radius"]) ** 2, rtol=1e-4)


def test_plan_view_and_voxels_know_band_and_speed():
    volume = mf.focus(scan(0.5 * speed_of_light, slower=2.0))
    x = np.linspace(-0.05, 0.05, 5)
    kept = ("wave_speed", "frequency_start", "frequency_stop", "frequency_points", "ambiguous_range", "radar_position")
    for view in (mf.plan_view(volume), mf.to_voxels(volume, x=x, y=x + 0.5, z=x)):
        for name in kept:
            np.testing.assert_array_equal(view.attrs[name], volume.attrs[name])


def test_a_volume_on_a_grid_is_that_of_its_voxels():
    x = np.linspace(-0.05, 0.05, 5)
    np.testing.assert_array_equal(
        mf.focus(scan(), x=x, y=x + 0.5, z=x), mf.to_voxels(mf.focus(scan()), x=x, y=x + 0.5, z=x)
    )


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"normalization": "r"}, "normalization is 'r', which a raster scan does not have; expected one of none, r2"),
        ({"apodization": "hann"}, "no elements to weigh"),
        ({"wave_speed": 0.0}, "wave_speed is 0.0"),
        ({"x": [0.0, 0.1]}, "all three or on none"),
    ],
)
def test_settings_that_a_raster_scan_cannot_have_are_refused(given, words):
    with pytest.raises(InputError) as refusal:
        mf.focus(scan(), **given)
    assert words in str(refusal.value)


def test_a_raster_scan_has_no_plan():
    with pytest.raises(InputError, match="raster scan"):
        mf.FocusPlan(scan())
