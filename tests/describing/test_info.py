"""What `info` finds: the numbers of the textbook, and each thing that can be wrong with a sweep."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.cli.terminal import show_mirrors
from mirrorfold.describing.resolution import resolution
from mirrorfold.sweep import add_noise


def targets(ranges, *, frequencies=101, elements=8, amplitude=None):
    """The sweep of scatterers straight ahead."""
    frequency = np.linspace(290e9, 300e9, frequencies)
    position = np.zeros((elements, 3))
    position[:, 0] = 0.5e-3 * np.arange(elements)
    s = np.zeros((frequencies, elements, elements), dtype=complex)
    for r, a in zip(ranges, amplitude or [1.0] * len(ranges), strict=True):
        d = np.hypot(position[:, 0], r)
        s += a * np.exp(-2j * np.pi / speed_of_light * frequency[:, None, None] * (d[:, None] + d))
    return mf.make_sweep(s, frequency=frequency, tx_position=position, rx_position=position)


def test_a_block_of_metal_is_resolved_where_it_is():
    """Ultrasound in aluminium: ranges of millimetres, and the image says it for its own pixels."""
    frequency = np.linspace(1e6, 9e6, 271)
    position = np.zeros((8, 3))
    position[:, 0] = 0.63e-3 * (np.arange(8) - 3.5)
    s = np.exp(-2j * np.pi * frequency[:, None, None] * (np.zeros((8, 8)) + 0.04) / 6300.0)
    sweep = mf.make_sweep(s, frequency=frequency, tx_position=position, rx_position=position, wave_speed=6300.0)
    stated = mf.info(sweep, diagnose=False).cross_range_resolution_m
    assert max(map(float, stated)) == pytest.approx(6300.0 / (2 * 8e6 / 270), rel=0.01)
    image = mf.focus(sweep, x=np.linspace(-0.01, 0.01, 21), y=np.linspace(0.01, 0.03, 21))
    stated = mf.info(image).cross_range_resolution_m
    assert 0.01 <= min(map(float, stated)) <= max(map(float, stated)) < 0.04
    r, size = next(iter(stated.items()))
    assert size == pytest.approx(6300.0 / 5e6 * float(r) / (7 * 0.63e-3))


@pytest.mark.parametrize("level_db", [-740.0, 600.0])
def test_levels_are_told_where_powers_leave_single_precision(level_db):
    sweep = targets([0.5, 0.9])
    scaled = sweep.assign(s=sweep["s"] * np.float32(10.0 ** (level_db / 20.0)))
    usual, found = mf.info(sweep, diagnose=False), mf.info(scaled, diagnose=False)
    assert found["power_db"] == pytest.approx(usual["power_db"] + level_db, abs=0.01)
    assert found["snr_db"] == pytest.approx(usual["snr_db"], abs=1.0)
    assert found["reciprocity_db"] is None or found["reciprocity_db"] < -100.0


def test_what_a_sweep_resolves():
    found = mf.info(targets([0.5]))
    assert found["frequency_step_hz"] == pytest.approx(100e6)
    assert found["range_resolution_m"] == pytest.approx(speed_of_light / (2 * 10.1e9))
    assert found["ambiguous_range_m"] == pytest.approx(1.49896229)
    assert found["aperture_m"] == pytest.approx([3.5e-3, 3.5e-3])
    assert found["pitch_m"] == pytest.approx([0.5e-3, 0.5e-3])
    wavelength = speed_of_light / 295e9
    # Where the scene is: at a quarter, half and all of the ambiguous range.
    stated = found["cross_range_resolution_m"]
    assert list(stated) == ["0.375", "0.749", "1.5"]
    for r, size in stated.items():
        assert size == pytest.approx(float(r) * wavelength / 3.5e-3)
    assert found["remarks"] == []
    json.dumps(found, allow_nan=False)


def test_one_moving_antenna_resolves_as_an_array_of_twice_the_length_and_pitch():
    pairs = targets([0.5])
    own = np.einsum("fii->fi", pairs["s"].transpose("frequency", "tx", "rx").values)
    moving = mf.make_monostatic_sweep(
        own, frequency=pairs["frequency"].values, antenna_position=pairs["tx_position"].values
    )
    found, usual = mf.info(moving, diagnose=False), mf.info(pairs, diagnose=False)
    assert found["pitch_m"] == pytest.approx(usual["pitch_m"])
    for r, size in found["cross_range_resolution_m"].items():
        assert size == pytest.approx(0.5 * usual["cross_range_resolution_m"][r])
    assert any("0.5 mm exceeds a quarter of a wavelength, 0.25 mm" in remark for remark in found["remarks"])
    with pytest.warns(UserWarning, match="1501 wavelengths"):
        far = mf.make_monostatic_sweep(
            own, frequency=pairs["frequency"].values, antenna_position=3e3 * pairs["tx_position"].values
        )
    assert any("pitch of 1.5 m exceeds" in remark for remark in mf.info(far, diagnose=False)["remarks"])


def test_facts_turn_with_the_array():
    sweep = targets([0.5])
    turned = sweep.assign_coords({f"{a}_position": sweep[f"{a}_position"][:, [2, 0, 1]] for a in ("tx", "rx")})
    assert mf.info(turned)["aperture_m"] == pytest.approx(mf.info(sweep)["aperture_m"])
    assert mf.info(turned)["pitch_m"] == pytest.approx(mf.info(sweep)["pitch_m"])


@pytest.mark.parametrize(("elements", "snr_db"), [(1, 30.0), (1, 10.0), (8, 30.0), (8, 10.0), (8, 0.0)])
def test_the_noise_is_estimated(elements, snr_db):
    found = mf.info(add_noise(targets([0.5], frequencies=401, elements=elements), snr_db=snr_db, seed=0))
    assert found["snr_db"] == pytest.approx(snr_db, abs=2.0 if elements == 1 else 0.5)
    assert not any("wrapped" in remark or "reciprocal" in remark for remark in found["remarks"])


def test_echoes_at_the_end_of_the_range_are_remarked():
    end = 0.96 * mf.info(targets([0.5]))["ambiguous_range_m"]
    assert any("wrapped around" in remark for remark in mf.info(targets([0.5, end]))["remarks"])
    weak = targets([0.5, end], amplitude=[1.0, 0.01])
    assert mf.info(weak)["range_end_db"] == pytest.approx(-40, abs=2)
    assert mf.info(weak)["remarks"] == []


@pytest.mark.slow
def test_the_shared_sweep_is_fine_and_wraps_with_half_its_frequencies(shared_data):
    sweep = mf.load(shared_data / "two_walls_fullwave.nc").isel(tx=slice(0, 161, 20))
    assert not any("wrapped" in remark for remark in mf.info(sweep)["remarks"])
    assert any("wrapped" in remark for remark in mf.info(sweep.isel(frequency=slice(None, None, 2)))["remarks"])


def test_a_coarse_pitch_is_remarked_only_where_both_arrays_have_it():
    sweep = targets([0.5])
    assert mf.info(sweep)["field_of_view_deg"] > 170
    one = mf.info(sweep.isel(tx=slice(None, None, 2)))
    assert one["remarks"] == []
    both = mf.info(sweep.isel(tx=slice(None, None, 2), rx=slice(None, None, 2)))
    assert both["field_of_view_deg"] == pytest.approx(2 * np.degrees(np.arcsin(0.5)), rel=2e-3)
    assert "grating lobes" in both["remarks"][0]


def test_a_sweep_that_is_not_reciprocal_is_remarked():
    sweep = targets([0.5])
    assert not any("reciprocal" in remark for remark in mf.info(sweep)["remarks"])
    late = sweep.assign(s=sweep["s"] * np.exp(0.5j * np.arange(8))[:, None])
    assert any("not reciprocal" in remark for remark in mf.info(late.transpose(*sweep.dims))["remarks"])
    sweep["s"].values[:, 1] = 0.0
    masked = mf.info(mf.calibrate.mask_bad(sweep))  # what one transmitter would have sent back is not known
    assert not any("reciprocal" in remark for remark in masked["remarks"])
    assert masked.reciprocity_db is None  # nothing differs


def test_antennas_too_close_for_numbers_have_no_pitch():
    places = np.array([[0.0, 0.0, 0.0], [1e-200, 0.0, 0.0]])
    facts, _ = resolution(np.linspace(290e9, 300e9, 11), places, places, ranges=[1.0])
    assert facts.pitch_m == [None, None]


def test_what_a_single_antenna_or_frequency_cannot_tell():
    found = mf.info(targets([0.5], elements=1).isel(frequency=[0]))
    assert found["cross_range_resolution_m"] is None
    assert found["ambiguous_range_m"] is None
    assert len(found["remarks"]) == 2


def test_an_image_says_where_it_is_brightest(image):
    found = mf.info(image)
    assert found["strongest_at"] == pytest.approx({"y": 1.2, "x": 0.1})
    assert found["pixel"] == pytest.approx({"y": 0.02, "x": 0.02})
    assert found["remarks"] == []
    cut = mf.info(image.sel(x=slice(0.1, None)))
    assert "border" in cut["remarks"][0]


def test_a_reconstruction_lists_mirrors_and_points(reconstruction):
    found = mf.info(reconstruction)
    assert found["points_by_bounces"] == {"0": 2, "1": 3}
    assert found["mirrors"][0]["start_m"] == [0.4, 1.6]
    assert found["remarks"] == []
    assert found["left_out"] == 0
    reconstruction.attrs |= {"mixed_x": np.zeros(3), "mixed_y": np.ones(3)}
    assert mf.info(reconstruction)["left_out"] == 3


def test_mirrors_of_space_have_three_coordinates(reconstruction, capsys):
    mirrors = reconstruction.children["mirrors"].to_dataset(inherit=False)
    heights = {
        f"{folded}z{end}": ("mirror", np.full(mirrors.sizes["mirror"], 0.3 + end))
        for folded in ("", "folded_")
        for end in (0, 1)
    }
    reconstruction["mirrors"] = xr.DataTree(mirrors.assign(heights))
    mirror = mf.info(reconstruction).mirrors[0]
    assert mirror.start_m == [0.4, 1.6, 0.3]
    assert mirror["end_m"][2] == 1.3
    show_mirrors([mirror])
    assert "(0.4000, 1.6000, 0.3000)" in capsys.readouterr().out


def test_facts_are_attributes_and_items(image):
    found = mf.info(image)
    assert found.pixel is found["pixel"]
    assert "path" not in found
    assert found.path is None


def test_a_scene_beyond_the_unambiguous_range_is_remarked(scene_file):
    scene = mf.load(scene_file)
    assert mf.info(scene)["remarks"] == []
    far = scene_file.with_name("far.toml")
    far.write_text(scene_file.read_text().replace("[-0.2, 0.3]", "[-0.2, 1.3]"))
    assert "beyond the unambiguous range" in mf.info(far)["remarks"][0]


def test_anything_else_is_refused():
    with pytest.raises(mf.InputError, match="got the number 3"):
        mf.info(3)
