"""Real measurements of other labs: each imported by its mapping, focused, and compared with what is known of it."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.diagnosis import diagnose
from mirrorfold.sweep import ambiguous_range, is_monostatic


def brightest(image, inside=None):
    """Coordinates of the brightest pixel, in the order of the image's axes."""
    amplitude = np.abs(image.values)
    if inside is not None:
        amplitude = np.where(inside, amplitude, 0.0)
    at = np.unravel_index(amplitude.argmax(), amplitude.shape)
    return [float(image[name].values[i]) for name, i in zip(image.dims, at, strict=True)]


@pytest.fixture
def merit(shared_data):
    """The difference of a scan and the same with the phantom turned, which is its background."""
    scans = [mf.import_data(shared_data / f"merit/B0_P3_{name}.csv", mapping="merit") for name in ("p000", "p036")]
    return scans, scans[0].assign(s=scans[0]["s"] - scans[1]["s"])


def test_merit_scans_are_96_channels_of_24_antennas(merit):
    scan = merit[0][0]
    assert scan["s"].shape == (76, 24, 24)
    assert scan["frequency"].values[[0, -1]].tolist() == [1.5e9, 4.5e9]
    assert int(scan["measured"].sum()) == 2 * 96
    np.testing.assert_array_equal(scan["s"].values, scan["s"].values.swapaxes(1, 2))
    assert scan["s"].values[0, 0, 1] == np.complex64(-0.025697 - 0.0043991j)
    np.testing.assert_allclose(scan["tx_position"].values[10], [0.056, 0.018, 0.037])


def test_merit_difference_shows_one_compact_peak_where_the_tumour_is(merit):
    x = np.arange(-70e-3, 70.1e-3, 2.5e-3)
    z = np.arange(0.0, 75e-3, 2.5e-3)
    image = mf.focus(merit[1], x=x, y=x, z=z, taper="uniform")
    radius = np.sqrt(x[None, None, :] ** 2 + x[None, :, None] ** 2 + z[:, None, None] ** 2)
    inside = radius < 0.065  # within the phantom, away from the antennas
    peak = brightest(image, inside)[::-1]
    np.testing.assert_allclose(peak, [15e-3, 2.5e-3, 27.5e-3], atol=2.6e-3)
    amplitude = np.where(inside, np.abs(image.values), 0.0)
    place = np.stack(np.broadcast_arrays(x[None, None, :], x[None, :, None], z[:, None, None]), axis=-1)
    strong = amplitude > 0.8 * amplitude.max()
    assert np.linalg.norm(place[strong] - peak, axis=-1).max() < 15e-3
    assert amplitude.max() > 8.0 * np.median(amplitude[inside])


@pytest.fixture
def gotcha(shared_data):
    return mf.import_data(sorted((shared_data / "gotcha").glob("*.mat")), mapping="gotcha")


def test_pairs_that_were_not_measured_are_no_finding(merit):
    scan = merit[0][0]
    assert not scan["measured"].values.all()
    assert diagnose(scan)[0] == []
    silent = scan.copy(deep=True)
    tx, rx = np.argwhere(silent["measured"].values)[7]
    silent["s"].values[:, tx, rx] = 0.0
    (finding,) = diagnose(silent)[0]
    assert finding.name == "dead-channels"
    assert finding.what.startswith("1 of ")


def test_a_ring_of_antennas_in_millimetres_is_named(merit):
    scan = merit[0][0]
    wrong = scan.assign_coords({f"{side}_position": 1e3 * scan[f"{side}_position"] for side in ("tx", "rx")})
    (finding,) = diagnose(wrong)[0]
    assert (finding.name, finding.remedy) == ("position-unit", "--position-unit mm")


@pytest.mark.parametrize("mistake", [mf.calibrate.conjugate, mf.calibrate.swap_iq, mf.calibrate.reverse_frequency])
def test_a_ring_of_antennas_tells_which_way_time_runs(merit, mistake):
    for scan in merit[0]:
        (finding,) = diagnose(mistake(scan))[0]
        assert (finding.name, finding.remedy) == ("range-reversed", "--conjugate")


def test_gotcha_files_join_to_one_flight(gotcha):
    assert is_monostatic(gotcha)
    assert gotcha["s"].shape == (424, 117 + 117 + 118 + 117)
    assert ambiguous_range(gotcha) > 100.0


@pytest.mark.slow
def test_mistakes_in_a_flight_smear_its_image_and_are_named(gotcha):
    assert diagnose(gotcha) == ([], {"waves": True, "exchange": False})
    for repair, names in (
        (mf.calibrate.conjugate, ["conjugated"]),
        (mf.calibrate.swap_iq, ["conjugated"]),
        (mf.calibrate.reverse_frequency, ["frequency-reversed"]),
    ):
        assert [finding.name for finding in diagnose(repair(gotcha))[0]] == names


@pytest.mark.slow
def test_gotcha_shows_vehicles_with_the_brightest_point_where_it_is_known(gotcha):
    x = np.arange(-50.0, 50.01, 0.25)
    image = mf.focus(gotcha, x=x, y=x, tolerance=1e-3)
    y0, x0 = brightest(image)
    assert (x0, y0) == (pytest.approx(-15.5, abs=0.26), pytest.approx(21.5, abs=0.26))
    level = 20 * np.log10(np.abs(image.values) / np.median(np.abs(image.values)))
    assert level.max() == pytest.approx(46.7, abs=0.1)
    # Rows of vehicles: many echoes well above the ground, in many places.
    rows, columns = np.nonzero(level > 25.0)
    assert len({(i // 20, k // 20) for i, k in zip(rows, columns, strict=True)}) > 20


def test_gotcha_has_a_default_grid_about_the_scene(gotcha):
    image = mf.focus(gotcha.isel(position=slice(None, None, 8)), tolerance=1e-2)
    assert float(image["x"].min()) < -30.0 < 30.0 < float(image["x"].max())
    y0, x0 = brightest(image)
    assert np.hypot(x0 + 15.5, y0 - 21.5) < 1.0


@pytest.mark.slow
def test_gotcha_needs_no_mapping_but_the_name_on_the_command_line(shared_data, tmp_path, capsys):
    files = [str(path) for path in sorted((shared_data / "gotcha").glob("*.mat"))]
    assert main(["import", *files, "--mapping", "gotcha", "-o", str(tmp_path / "g.nc")]) == 0
    found = mf.load(tmp_path / "g.nc")
    assert found.sizes["position"] == 469
    capsys.readouterr()
    arguments = [
        "focus",
        str(tmp_path / "g.nc"),
        "-o",
        str(tmp_path / "i.nc"),
        "--x",
        "-20:-10:0.5",
        "--y",
        "16:26:0.5",
    ]
    assert main(arguments) == 0
    y0, x0 = brightest(mf.load(tmp_path / "i.nc"))
    assert np.hypot(x0 + 15.5, y0 - 21.5) < 0.8


def test_the_aluminium_block_shows_its_notch_and_its_back_wall(shared_data):
    sweep = mf.import_data(shared_data / "arim/contact_notch_aluminium.mat", mapping="arim")
    assert sweep["s"].shape[1:] == (64, 64)
    assert sweep.attrs["wave_speed"] == 6300.0
    assert "measured" not in sweep.coords  # the half matrix became a full one
    x, y = np.arange(-12e-3, 12.01e-3, 0.4e-3), np.arange(15e-3, 46e-3, 0.1e-3)
    image = mf.focus(sweep, x=x, y=y, tolerance=1e-3)
    wall_y, _ = brightest(image.sel(y=slice(35e-3, 48e-3)))
    assert wall_y == pytest.approx(40.8e-3, abs=0.2e-3)
    notch_y, notch_x = brightest(image.sel(y=slice(15e-3, 30e-3)))
    assert notch_x == pytest.approx(7e-3, abs=0.5e-3)
    assert notch_y == pytest.approx(20e-3, abs=0.5e-3)


def test_files_of_a_known_kind_need_no_mapping(shared_data, tmp_path, monkeypatch):
    """Their variables are those of one mapping that comes along: they are loaded as if it had been named."""
    (tmp_path / "arim").mkdir()  # whatever lies beside
    monkeypatch.chdir(tmp_path)
    path = shared_data / "arim/contact_notch_aluminium.mat"
    found = mf.load(path)
    xr.testing.assert_identical(found, mf.import_data(path, mapping="arim"))


@pytest.mark.parametrize("name", ["corner-reflector", "large_tank", "cargo_20_feet"])
def test_acconeer_sessions_describe_themselves(shared_data, name):
    sweep = mf.import_data(shared_data / f"acconeer/{name}.h5")
    assert sweep["s"].dims == ("frame", "frequency", "position")
    assert sweep["frequency"].values[0] < 60.5e9 < sweep["frequency"].values[-1]
    assert sweep.attrs["instrument"] == "Acconeer A121"
    assert diagnose(sweep)[0] == []


def profile(sweep, start, stop):
    """Mean amplitude against range [m]."""
    y = np.arange(start, stop, 0.005)
    image = mf.focus(sweep, x=0.0, y=y)
    return y, np.abs(image.values[..., 0]).mean(axis=0)


def test_the_corner_reflector_stands_out_at_its_distance_and_repeats(shared_data):
    sweep = mf.import_data(shared_data / "acconeer/corner-reflector.h5").isel(frame=slice(None, None, 10))
    y, level = profile(sweep, 0.1, 0.8)
    distance = y[level.argmax()]
    assert distance == pytest.approx(0.22, abs=0.015)
    assert level.max() > 10 * np.median(level)
    # The echo goes to and fro between sensor and reflector: again at twice and at three times the distance.
    for times, share in ((2, 0.1), (3, 0.03)):
        near = np.abs(y - times * distance) < 0.03
        peak = y[near][level[near].argmax()]
        assert peak == pytest.approx(times * distance, abs=0.025)
        assert level[near].max() > share * level.max()


def test_enclosed_scenes_have_echoes_throughout(shared_data):
    sweep = mf.import_data(shared_data / "acconeer/cargo_20_feet.h5")
    y, level = profile(sweep, 0.5, 6.5)
    floor = np.quantile(level, 0.1)
    peaks = (level[1:-1] > level[:-2]) & (level[1:-1] >= level[2:]) & (level[1:-1] > 2.0 * floor)
    assert np.count_nonzero(peaks) > 5
    assert y[1:-1][peaks].max() > 4.0  # from the far end of the container


@pytest.mark.slow
def test_a_session_becomes_a_range_profile_on_the_command_line(shared_data, tmp_path, capsys):
    session = str(shared_data / "acconeer/corner-reflector.h5")
    assert main(["import", session, "--frame", "mean", "-o", str(tmp_path / "s.nc")]) == 0
    arguments = ["focus", str(tmp_path / "s.nc"), "--x", "0", "--y", "0.1:0.8:0.005", "-o", str(tmp_path / "i.nc")]
    assert main(arguments) == 0
    assert brightest(mf.load(tmp_path / "i.nc"))[0] == pytest.approx(0.22, abs=0.015)
    assert main(["import", session, "--frame", "500", "-o", str(tmp_path / "s.nc")]) == 2
    assert "0 to 112" in capsys.readouterr().err
