"""The usual slips of a first import: units, missing phases, exchanged axes. Each is refused or named."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from point_target import AXES, TARGET, echo, line_of
from scipy.constants import speed_of_light
from scipy.io import savemat

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.io.guessing.guess import guess_mapping

F, TX, RX = np.linspace(290e9, 300e9, 41), line_of(9), line_of(12, 0.01)
S = echo(F, TX, RX)


def mapped(frequency, **other):
    places = {"tx": {"position": TX.tolist()}, "rx": {"position": RX.tolist()}}
    return {"s": {"variable": "s", "dims": AXES}, "frequency": frequency, **places, **other}


@pytest.mark.parametrize("name", ["fGHz", "f_GHz", "freqGHz", "frequency_GHz", "FreqGHz"])
def test_frequencies_are_understood_by_name_and_unit(tmp_path, name):
    np.savez(tmp_path / "a.npz", s=S, **{name: F / 1e9}, tx_position=TX, rx_position=RX)
    sweep = mf.import_data(tmp_path / "a.npz", mapping=mapped(name))
    np.testing.assert_allclose(sweep["frequency"], F)
    guess = guess_mapping(tmp_path / "a.npz")
    assert guess.entries["frequency"] == {"variable": name, "unit": "GHz"}
    assert not guess.missing
    np.testing.assert_allclose(mf.import_data(tmp_path / "a.npz", mapping=guess.entries)["s"], S, atol=1e-5)


@pytest.mark.parametrize(("scale", "unit"), [(1e9, "GHz"), (1e6, "MHz")])
def test_frequencies_without_their_unit_are_refused_with_it(tmp_path, scale, unit):
    np.savez(tmp_path / "a.npz", s=S, f=F / scale)
    with pytest.raises(mf.InputError, match=rf'unit = "{unit}", or the wave_speed of sound'):
        mf.import_data(tmp_path / "a.npz", mapping=mapped("f"))
    sweep = mf.import_data(tmp_path / "a.npz", mapping=mapped({"variable": "f", "unit": unit}))
    np.testing.assert_allclose(sweep["frequency"], F)


@pytest.mark.parametrize("numbered", [True, False])
def test_frequencies_of_a_table_get_their_unit_in_its_heading(tmp_path, numbered):
    n, i, k = np.indices(S.shape).reshape(3, -1)
    at = (i, k) if numbered else (TX[i, 0], RX[k, 0])
    rows = np.column_stack([F[n] / 1e9, *at, S.real.ravel(), S.imag.ravel()])
    given = {"positions": {"tx": {"position": TX.tolist()}, "rx": {"position": RX.tolist()}}} if numbered else {}

    def read(heading):
        names = [heading, *(("tx", "rx") if numbered else ("tx_x", "rx_x")), "re", "im"]
        np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header=",".join(names))
        return mf.import_data(tmp_path / "a.csv", **given)

    with pytest.raises(mf.InputError, match="say their unit in the heading of their column, probably freq_GHz, or the"):
        read("freq")
    np.testing.assert_allclose(read("freq_GHz")["frequency"], F)


def test_times_without_their_unit_are_refused_with_it(tmp_path):
    step = 1 / 60e9
    t = np.arange(256) * step
    delays = np.linalg.norm(TX - TARGET, axis=1)[:, None] + np.linalg.norm(RX - TARGET, axis=1)
    late = t[:, None, None] - delays / speed_of_light
    pulse = np.exp(-((late * 6e9) ** 2)) * np.cos(2 * np.pi * 15e9 * late)
    np.savez(tmp_path / "a.npz", traces=pulse, t=t * 1e9)
    mapping = {"s": {"variable": "traces", "dims": ["time", "tx", "rx"]}, "time": "t"}
    mapping |= {side: {"position": places.tolist()} for side, places in (("tx", TX), ("rx", RX))}
    with pytest.raises(mf.InputError, match=r'the times are probably in ns: say \[time\] unit = "ns"'):
        mf.import_data(tmp_path / "a.npz", mapping=mapping)
    sweep = mf.import_data(tmp_path / "a.npz", mapping=mapping | {"time": {"variable": "t", "unit": "ns"}})
    assert 10e9 < float(sweep["frequency"].mean()) < 20e9


def test_sound_is_as_welcome_as_light(tmp_path):
    for f, speed, pitch in ((np.linspace(2e6, 5e6, 41), 6300.0, 0.6e-3), (np.linspace(80.0, 100.0, 41), 1500.0, 7.0)):
        tx = line_of(9, pitch=pitch)
        sweep = mf.make_sweep(echo(f, tx, tx, speed), frequency=f, tx_position=tx, rx_position=tx, wave_speed=speed)
        names = [finding["name"] for finding in mf.info(sweep)["findings"]]
        assert not {"frequency-unit", "position-unit"}.intersection(names)
    with pytest.raises(mf.InputError, match="probably in MHz"):
        mf.make_sweep(S, frequency=np.linspace(2, 5, 41), tx_position=TX, rx_position=RX, wave_speed=6300.0)
    # Ultrasound whose speed is said when the image is made: a warning, and no image at the speed of light.
    f, tx = np.linspace(2e6, 5e6, 41), line_of(9, pitch=0.6e-3)
    with pytest.warns(UserWarning, match="the speed of sound is missing"):
        sweep = mf.make_sweep(echo(f, tx, tx, 6300.0), frequency=f, tx_position=tx, rx_position=tx)
    x, y = np.linspace(-0.02, 0.02, 9), np.linspace(0.01, 0.04, 9)
    assert mf.focus(sweep, x=x, y=y, wave_speed=6300.0).size == 81
    with pytest.raises(mf.InputError, match="give the speed of sound as wave_speed"):
        mf.focus(sweep, x=x, y=y)


@pytest.mark.slow
@pytest.mark.parametrize(("scale", "unit"), [(1e3, "mm"), (1e2, "cm")])
def test_positions_in_another_unit_are_named_with_the_command(tmp_path, scale, unit, capsys):
    np.savez(tmp_path / "a.npz", s=S, f=F, tx=TX * scale, rx=RX * scale)
    mapping = {
        "s": {"variable": "s", "dims": AXES},
        "frequency": "f",
        "tx": {"position": "tx"},
        "rx": {"position": "rx"},
    }
    with pytest.warns(UserWarning, match=f"their positions are probably in {unit}.*--position-unit {unit}"):
        sweep = mf.import_data(tmp_path / "a.npz", mapping=mapping)
    path = mf.save(sweep, tmp_path / "s.nc")
    fix = next(finding["fix"] for finding in mf.info(path)["findings"] if finding["name"] == "position-unit")
    assert main(fix.split()[1:]) == 0
    repaired = mf.load(tmp_path / "s-repaired.nc")
    np.testing.assert_allclose(repaired["tx_position"], TX, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("slip", ["frequency-unit", "angle-unit", "axes-exchanged"])
def test_the_command_that_info_names_mends_the_file(tmp_path, slip, capsys):
    path = tmp_path / "s.nc"
    if slip == "angle-unit":
        random = np.random.default_rng(0)
        s = random.standard_normal((41, 61, 21, 2)).view(complex)[..., 0]
        azimuth, elevation = np.linspace(-30, 30, 61), np.linspace(-10, 10, 21)
        good = mf.make_raster_sweep(s, frequency=F, azimuth=azimuth, elevation=elevation)
        bad = good.assign_coords(azimuth=np.radians(azimuth), elevation=np.radians(elevation))
    elif slip == "frequency-unit":
        good = mf.make_sweep(S, frequency=F, tx_position=TX, rx_position=RX)
        bad = good.assign_coords(frequency=F / 1e9)
    else:
        f = np.linspace(290e9, 300e9, 41)
        places = line_of(41)
        good = mf.make_sweep(echo(f, places, places), frequency=f, tx_position=places, rx_position=places)
        bad = good.assign(s=(good["s"].dims, good["s"].values.swapaxes(0, 1)))
    _write(bad, path)
    found = mf.info(path)
    names = [finding["name"] for finding in found["findings"]]
    assert slip in names
    fix = found["findings"][names.index(slip)]["fix"]
    assert main(fix.split()[1:]) == 0
    repaired = mf.load(tmp_path / "s-repaired.nc")
    for name in good.coords:
        if good[name].dtype.kind == "f":
            np.testing.assert_allclose(repaired[name], good[name], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(repaired["s"], good["s"], atol=1e-6)
    assert slip not in [finding["name"] for finding in mf.info(repaired)["findings"]]


def _write(sweep, path):
    """A file with a mistake in it, which `save` would refuse."""
    sweep.to_netcdf(path, engine="h5netcdf")


def test_samples_without_a_phase_are_refused(tmp_path):
    for part, words in ((np.abs(S), "magnitudes"), (S.real, "real parts")):
        with pytest.raises(mf.InputError, match="s has type float64, expected complex numbers"):
            mf.make_sweep(part, frequency=F, tx_position=TX, rx_position=RX)
        varying = part * np.linspace(1.0, 2.0, 41)[:, None, None]
        with pytest.raises(mf.InputError, match=f"s holds {words} alone"):
            mf.make_sweep(varying.astype(complex), frequency=F, tx_position=TX, rx_position=RX)
        np.savez(tmp_path / "a.npz", s=part, f=F)
        with pytest.raises(mf.InputError, match="real numbers against frequency"):
            mf.import_data(tmp_path / "a.npz", mapping=mapped("f"))
        np.savez(tmp_path / "b.npz", s=part, frequency=F)
        assert any("real numbers against frequency" in line for line in guess_mapping(tmp_path / "b.npz").missing)


def test_info_names_a_missing_phase_and_nothing_else(tmp_path):
    sweep = mf.make_sweep(S, frequency=F, tx_position=TX, rx_position=RX)
    real = (sweep["s"].real.values * np.linspace(1, 2, 41)[:, None, None]).astype(np.complex64)
    _write(sweep.assign(s=(sweep["s"].dims, real)), tmp_path / "s.nc")
    found = mf.info(tmp_path / "s.nc")
    assert found["valid"] is False
    assert [finding["name"] for finding in found["findings"]] == ["no-phase"]
    assert main(["info", str(tmp_path / "s.nc")]) == 2


def test_axes_of_equal_length_cannot_be_known(tmp_path):
    for tx, rx, f in ((line_of(12), RX, F), (TX, RX, np.linspace(290e9, 300e9, 9))):
        np.savez(tmp_path / "a.npz", s=echo(f, tx, rx), frequency=f, tx_position=tx, rx_position=rx)
        guess = guess_mapping(tmp_path / "a.npz")
        said = [finding for finding in guess.findings if "cannot be known" in finding.what]
        assert len(said) == 1
        assert said[0].sure == "a guess"
        assert "mirrorfold info" in said[0].why
    np.savez(tmp_path / "a.npz", s=S, frequency=F, tx_position=TX, rx_position=RX)
    assert not any("cannot be known" in finding.what for finding in guess_mapping(tmp_path / "a.npz").findings)


def write_scalars(path, values):
    if path.suffix == ".npz":
        np.savez(path, **values)
    elif path.suffix == ".mat":
        savemat(path, values)
    else:
        import h5py

        with h5py.File(path, "w") as file:
            for name, value in values.items():
                file[name] = value


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".h5"])
def test_scalars_that_describe_positions_are_found(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    scalars = {
        "tx_x0": 1e3 * TX[0, 0],
        "tx_dx_mm": 0.5,
        "n_tx": 9,
        "rx_x0": 1e3 * RX[0, 0],
        "rx_dx_mm": 0.5,
        "n_rx": 12,
    }
    write_scalars(path, {"s": S, "fGHz": F / 1e9, **scalars})
    guess = guess_mapping(path)
    assert not guess.missing, guess.missing
    sweep = mf.import_data(path, mapping=tomllib.loads(guess.to_toml()))
    np.testing.assert_allclose(sweep["tx_position"], TX, atol=1e-9)
    np.testing.assert_allclose(sweep["rx_position"], RX, atol=1e-9)


def test_a_pitch_alone_puts_the_antennas_around_zero_and_says_so(tmp_path):
    f, places = F, line_of(11)
    np.savez(tmp_path / "a.npz", s=echo(f, places, places)[:, :, 5], frequency=f, dx=0.5e-3)
    guess = guess_mapping(tmp_path / "a.npz")
    sweep = mf.import_data(tmp_path / "a.npz", mapping=guess.entries)
    np.testing.assert_allclose(sweep["antenna_position"], places, atol=1e-9)
    assert any("around zero" in finding.why and finding.sure == "a guess" for finding in guess.findings)


@pytest.mark.slow
def test_frequencies_that_stand_for_antennas_are_told_by_waves():
    f, tx, rx = np.linspace(290e9, 300e9, 41), line_of(41), line_of(30, 0.02)
    good = mf.make_sweep(echo(f, tx, rx), frequency=f, tx_position=tx, rx_position=rx)
    bad = good.assign(s=(good["s"].dims, np.ascontiguousarray(good["s"].values.swapaxes(0, 1))))
    assert "axes-exchanged" not in [finding["name"] for finding in mf.info(good)["findings"]]
    found = {finding["name"]: finding for finding in mf.info(bad)["findings"]}
    assert (
        "Echoes add up to a sharp image only when the axes frequency and tx are exchanged"
        in found["axes-exchanged"]["what"]
    )
    assert found["axes-exchanged"]["fix"].endswith("--swap-axes frequency,tx")


def test_frequencies_that_are_all_zero_tell_no_unit_of_positions(tmp_path):
    np.savez(tmp_path / "a.npz", s=S, frequency=0.0 * F, tx_position=TX, rx_position=RX)
    guess = guess_mapping(tmp_path / "a.npz")
    with pytest.raises(mf.InputError, match="frequenc"):
        mf.import_data(tmp_path / "a.npz", mapping=guess.entries)


@pytest.mark.parametrize(
    ("option", "said"),
    [
        (["--position-unit", "mm"], "its positions are in metres already"),
        (["--frequency-unit", "GHz"], "no phase is measured above"),
    ],
)
def test_a_unit_too_many_is_refused(tmp_path, option, said, capsys):
    mf.save(mf.make_sweep(S, frequency=F, tx_position=TX, rx_position=RX), tmp_path / "a.nc")
    assert main(["calibrate", str(tmp_path / "a.nc"), "-o", str(tmp_path / "b.nc"), *option]) == 2
    assert said in capsys.readouterr().err


def test_arrays_that_no_unit_makes_long_enough_are_refused():
    with pytest.raises(mf.InputError, match=r"wavelengths long at 3e\+11 Hz; give"):
        mf.make_sweep(S, frequency=F, tx_position=1e-6 * TX, rx_position=1e-6 * RX)


def test_what_the_waves_tell_of_a_unit_stands_for_what_lengths_suggest(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    places, f = line_of(31, pitch=1e-3), np.linspace(290e9, 300e9, 41)
    s = echo(f, places, places)
    rows = [
        [f[n] / 1e9, 1e2 * places[i, 0], 1e2 * places[k, 0], s[n, i, k].real, s[n, i, k].imag]
        for n, i, k in np.ndindex(s.shape)
    ]
    np.savetxt("a.csv", rows, delimiter=",", header="f_GHz,tx_x,rx_x,re,im", comments="", fmt="%.9g")
    assert main(["import", "a.csv", "-o", "sweep.nc"]) == 0
    said = capsys.readouterr().err
    assert "they are in centimetres, not in metres. (97 % sure)" in said
    assert "probably in" not in said
