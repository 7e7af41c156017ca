"""Import: mappings of any file to a sweep, proposals of mappings, and what they say when things do not fit."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from profiles import examples
from scipy.constants import speed_of_light
from scipy.io import savemat

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.errors import InputError
from mirrorfold.io.guess import guess_mapping
from mirrorfold.io.mapping import load_mapping, shipped
from mirrorfold.io.proposal import Guess

ONE_FILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=examples(30))

TARGET = np.array([0.05, 0.4, 0.02])


def array_of(count, offset=0.0):
    place = np.zeros((count, 3))
    place[:, 0] = 0.5e-3 * (np.arange(count) - (count - 1) / 2) + offset
    return place


def echo(frequency, tx, rx, target=TARGET, speed=speed_of_light):
    """The exact samples of a point, exp(-j k d)."""
    d = np.linalg.norm(tx - target, axis=1)[:, None] + np.linalg.norm(rx - target, axis=1)
    return np.exp(-2j * np.pi * frequency[:, None, None] / speed * d)


@pytest.fixture
def measured():
    """Frequencies, antennas and samples of a point target, 5 x 7 elements."""
    f = np.linspace(290e9, 300e9, 21)
    tx, rx = array_of(5), array_of(7, 0.01)
    return f, tx, rx, echo(f, tx, rx)


def same(sweep, f, tx, rx, s):
    np.testing.assert_allclose(sweep["frequency"], f, rtol=1e-12)
    np.testing.assert_allclose(sweep["tx_position"], tx, atol=1e-12)
    np.testing.assert_allclose(sweep["rx_position"], rx, atol=1e-12)
    np.testing.assert_allclose(sweep["s"], s, atol=1e-5)
    assert sweep["s"].dims == ("frequency", "tx", "rx")
    assert sweep["s"].dtype == np.complex64


AXES = ["frequency", "tx", "rx"]


@ONE_FILE
@given(
    order=st.permutations(AXES),
    unit=st.sampled_from(["Hz", "MHz", "GHz"]),
    length=st.sampled_from(["m", "mm", "um"]),
    falling=st.booleans(),
    conjugated=st.booleans(),
    parts=st.sampled_from(["variable", "real", "polar", "dB", "re_im"]),
    writer=st.sampled_from(["mat", "npz", "h5"]),
)
def test_any_order_unit_sign_and_form_gives_the_same_sweep(
    tmp_path, measured, order, unit, length, falling, conjugated, parts, writer
):
    f, tx, rx, s = measured
    scale = {"Hz": 1.0, "MHz": 1e6, "GHz": 1e9}[unit]
    metre = {"m": 1.0, "mm": 1e3, "um": 1e6}[length]
    stored = s[::-1] if falling else s
    stored = 0.5 * (stored.conj() if conjugated else stored)
    stored = stored.transpose([AXES.index(name) for name in order])
    content = {"f": (f[::-1] if falling else f) / scale, "txpos": tx * metre, "rxpos": (rx * metre).T}
    samples = {"dims": list(order)}
    if parts == "variable":
        content["s"], samples["variable"] = stored, "s"
    elif parts == "real":
        content |= {"a": stored.real, "b": stored.imag}
        samples |= {"real": "a", "imaginary": "b"}
    elif parts == "re_im":
        content["s"], samples["variable"] = np.stack([stored.real, stored.imag], axis=-1), "s"
        samples["dims"] = [*order, "re_im"]
    else:
        size = 20 * np.log10(np.abs(stored)) if parts == "dB" else np.abs(stored)
        content |= {"m": size, "p": np.degrees(np.angle(stored))}
        samples |= {"magnitude": "m", "phase": "p", "phase_unit": "degree"}
        samples["magnitude_unit"] = "dB" if parts == "dB" else "linear"
    path = tmp_path / f"data.{writer}"
    if writer == "mat":
        savemat(path, content)
    elif writer == "npz":
        np.savez(path, **content)
    else:
        with h5py.File(path, "w") as file:
            for name, values in content.items():
                file[name] = values
    mapping = {
        "s": samples,
        "frequency": {"variable": "f", "unit": unit},
        "tx": {"position": "txpos", "unit": length},
        "rx": {"position": "rxpos", "unit": length},
        "time_convention": "exp(-jwt)" if conjugated else "exp(+jwt)",
    }
    same(mf.import_data(path, mapping=mapping), f, tx, rx, 0.5 * s)


def test_axes_are_renamed_turned_and_selected(tmp_path, measured):
    f, tx, rx, s = measured
    cube = np.stack([np.zeros_like(s), s], axis=1)  # a second channel that is chosen
    np.savez(tmp_path / "d.npz", s=cube, f=f, tx=np.stack([tx[:, 0], -tx[:, 2], tx[:, 1]], axis=-1), rx=rx)
    mapping = {
        "s": {"variable": "s", "dims": ["frequency", "channel", "tx", "rx"], "select": {"channel": 1}},
        "frequency": "f",
        "tx": {"position": "tx", "axes": ["x", "-z", "y"]},
        "rx": {"position": "rx"},
    }
    same(mf.import_data(tmp_path / "d.npz", mapping=mapping), f, tx, rx, s)


def test_a_half_matrix_becomes_a_full_one_by_reciprocity(tmp_path):
    f, place = np.linspace(290e9, 300e9, 11), array_of(6)
    s = echo(f, place, place)
    i, k = np.triu_indices(6)
    savemat(tmp_path / "fmc.mat", {"d": {"h": s[:, i, k], "tx": i + 1, "rx": k + 1, "el": place, "f": f}})
    mapping = {
        "s": {"variable": "d.h", "dims": ["frequency", "pair"]},
        "frequency": "d.f",
        "elements": {"position": "d.el"},
        "pairs": {"tx": "d.tx", "rx": "d.rx"},
        "reciprocal": True,
    }
    sweep = mf.import_data(tmp_path / "fmc.mat", mapping=mapping)
    same(sweep, f, place, place, s)
    assert "measured" not in sweep.coords
    half = mf.import_data(tmp_path / "fmc.mat", mapping=mapping | {"reciprocal": False})
    np.testing.assert_array_equal(half["measured"], np.triu(np.ones((6, 6), dtype=bool)))
    assert not np.any(half["s"].values[:, 3, 1])
    path = mf.save(half, tmp_path / "half.nc")
    xr.testing.assert_identical(mf.load(path)["measured"], half["measured"])


def test_pairs_that_were_not_measured_are_missing_from_the_image(tmp_path):
    f, place = np.linspace(290e9, 300e9, 41), array_of(6)
    s = echo(f, place, place)
    i, k = np.triu_indices(6, 1)
    keep = (i + k) % 3 > 0
    i, k = i[keep], k[keep]
    np.savez(tmp_path / "d.npz", s=s[:, i, k], tx=i, rx=k, el=place, f=f)
    mapping = {
        "s": {"variable": "s", "dims": ["frequency", "pair"]},
        "frequency": "f",
        "elements": {"position": "el"},
        "pairs": {"tx": "tx", "rx": "rx", "base": 0},
    }
    sweep = mf.import_data(tmp_path / "d.npz", mapping=mapping)
    x, y = np.linspace(0.0, 0.1, 11), np.linspace(0.35, 0.45, 5)
    image = mf.focus(sweep, x=x, y=y, taper="uniform")
    p = np.stack([*np.meshgrid(x, y), np.zeros((5, 11))], axis=-1)
    d = np.linalg.norm(p[..., None, :] - place, axis=-1)
    wave = 2 * np.pi * f / speed_of_light
    expected = sum(
        (s[:, a, b, None, None] * np.exp(1j * wave[:, None, None] * (d[..., a] + d[..., b]))).sum(axis=0)
        for a, b in zip(i, k, strict=True)
    )
    np.testing.assert_allclose(image.values, expected, atol=2e-4 * np.abs(expected).max())


def test_time_traces_become_frequencies(tmp_path):
    speed, place = 6000.0, array_of(8) * 1.0
    t = np.arange(1200) * 20e-9 + 1e-6
    target = np.array([0.001, 0.02, 0.0])
    d = np.linalg.norm(place - target, axis=1)
    delay = (d[:, None] + d) / speed
    pulse = t[:, None, None] - delay
    traces = np.cos(2 * np.pi * 5e6 * pulse) * np.exp(-((pulse * 4e6) ** 2))
    savemat(tmp_path / "t.mat", {"h": traces, "t": t * 1e6, "el": place * 1e3, "v": speed})
    mapping = {
        "s": {"variable": "h", "dims": ["time", "tx", "rx"]},
        "time": {"variable": "t", "unit": "us"},
        "elements": {"position": "el", "unit": "mm"},
        "wave_speed": "v",
    }
    sweep = mf.import_data(tmp_path / "t.mat", mapping=mapping)
    assert sweep.attrs["wave_speed"] == speed
    f = sweep["frequency"].values
    assert f[0] > 1e6
    assert f[-1] < 9e6
    # The spectrum of the pulse is real and positive, so that the phase is that of the delay alone.
    phase = np.angle(sweep["s"].values * np.exp(2j * np.pi * f[:, None, None] * delay))
    assert np.abs(phase).max() < 0.02
    x, y = np.arange(-5e-3, 5e-3, 0.25e-3), np.arange(15e-3, 25e-3, 0.25e-3)
    image = np.abs(mf.focus(sweep, x=x, y=y).values)
    peak = np.unravel_index(image.argmax(), image.shape)
    assert x[peak[1]] == pytest.approx(target[0], abs=0.6e-3)
    assert y[peak[0]] == pytest.approx(target[1], abs=0.3e-3)


def test_range_profiles_about_a_carrier_become_frequencies(tmp_path):
    r = np.arange(100) * 0.02 + 0.1
    carrier, place = 60e9, 0.93
    k = 2 * np.pi * carrier / speed_of_light
    g = np.exp(-((r - place) ** 2) / (2 * 0.05**2)) * np.exp(-2j * k * place)
    np.savez(tmp_path / "r.npz", g=np.stack([g, 2 * g]), r=r)
    mapping = {
        "s": {"variable": "g", "dims": ["frame", "range"]},
        "range": {"variable": "r", "carrier": carrier},
        "antenna": {"position": [[0.0, 0.0, 0.0]]},
    }
    sweep = mf.import_data(tmp_path / "r.npz", mapping=mapping)
    assert sweep["s"].dims == ("frame", "frequency", "position")
    f = sweep["frequency"].values
    phase = np.angle(sweep["s"].values[0, :, 0] * np.exp(4j * np.pi * f / speed_of_light * place))
    assert np.abs(phase).max() < 0.02
    y = np.arange(0.2, 1.8, 0.005)
    profile = np.abs(mf.focus(sweep, x=0.0, y=y).values[1, :, 0])
    assert y[profile.argmax()] == pytest.approx(place, abs=0.006)


@pytest.mark.slow
@ONE_FILE
@given(seed=st.integers(0, 1000))
def test_motion_compensation_is_undone_whatever_the_reference(tmp_path, seed):
    rng = np.random.default_rng(seed)
    f = np.linspace(9e9, 9.6e9, 64)
    antenna = np.stack([np.linspace(-30, 30, 24), np.full(24, -800.0), np.full(24, 500.0)], axis=-1)
    target = np.array([*rng.uniform(-2, 2, 2), 0.0])
    r0 = np.linalg.norm(antenna, axis=1) + rng.uniform(-2, 2, 24)
    d = np.linalg.norm(antenna - target, axis=1)
    s = np.exp(-4j * np.pi * f[:, None] / speed_of_light * (d - r0))
    np.savez(tmp_path / "sar.npz", s=s, f=f, x=antenna[:, 0], y=antenna[:, 1], z=antenna[:, 2], r0=r0)
    mapping = {
        "s": {"variable": "s", "dims": ["frequency", "position"]},
        "frequency": "f",
        "antenna": {"x": "x", "y": "y", "z": "z"},
        "compensation": {"range": "r0"},
        "scene_center": [0.0, 0.0, 0.0],
    }
    sweep = mf.import_data(tmp_path / "sar.npz", mapping=mapping)
    x, y = target[0] + np.arange(-3, 3.1, 0.25), target[1] + np.arange(-1, 1.01, 0.125)
    image = np.abs(mf.focus(sweep, x=x, y=y).values)
    peak = np.unravel_index(image.argmax(), image.shape)
    assert x[peak[1]] == pytest.approx(target[0], abs=0.25)
    assert y[peak[0]] == pytest.approx(target[1], abs=0.125)
    with pytest.raises(InputError, match="centre of the scene"):
        mf.focus(sweep, x=x + 100.0, y=y)


def test_beams_of_a_raster_scan_in_any_order_become_a_grid(tmp_path):
    rng = np.random.default_rng(0)
    azimuth, elevation = np.linspace(-10, 10, 5), np.linspace(-4, 4, 3)
    s = rng.standard_normal((6, 5, 3)) + 1j * rng.standard_normal((6, 5, 3))
    a, e = (angle.ravel() for angle in np.meshgrid(azimuth, elevation, indexing="ij"))
    order = rng.permutation(a.size)
    np.savez(tmp_path / "b.npz", s=s.reshape(6, -1)[:, order], a=np.radians(a[order]), e=e[order])
    mapping = {
        "s": {"variable": "s", "dims": ["frequency", "beam"]},
        "frequency": {"start": 270, "stop": 300, "points": 6, "unit": "GHz"},
        "azimuth": {"variable": "a", "unit": "radian"},
        "elevation": "e",
    }
    sweep = mf.import_data(tmp_path / "b.npz", mapping=mapping)
    np.testing.assert_allclose(sweep["azimuth"], azimuth, atol=1e-9)
    np.testing.assert_allclose(sweep["s"], s, rtol=1e-6)
    np.savez(tmp_path / "b.npz", s=s.reshape(6, -1)[:, 1:], a=np.radians(a[1:]), e=e[1:])
    with pytest.raises(InputError, match="14 beams with 5 azimuths and 3 elevations"):
        mf.import_data(tmp_path / "b.npz", mapping=mapping)


def test_columns_of_real_and_imaginary_parts_beside_the_frequency(tmp_path, measured):
    f, tx, rx, s = measured
    columns = np.stack([s.real, s.imag], axis=-1).reshape(21, -1)
    np.savetxt(tmp_path / "d.csv", np.column_stack([f / 1e9, columns]), delimiter=",", fmt="%.17g")
    np.savetxt(tmp_path / "tx.csv", tx, delimiter=",")
    mapping = {
        "s": {"variable": "table", "skip": 1, "shape": [21, 5, 7, 2], "dims": ["frequency", "tx", "rx", "re_im"]},
        "frequency": {"file": "d.csv", "column": 0, "unit": "GHz"},
        "tx": {"file": "tx.csv"},
        "rx": {"position": rx.tolist()},
    }
    same(mf.import_data(tmp_path / "d.csv", mapping=mapping), f, tx, rx, s)
    mapping["s"]["shape"] = [21, 5, 8, 2]
    with pytest.raises(InputError, match="makes no"):
        mf.import_data(tmp_path / "d.csv", mapping=mapping)


def test_the_cube_of_a_chirped_radar_becomes_a_sweep(tmp_path):
    slope, rate, samples, start = 60e12, 8e6, 128, 77e9
    tx, rx = np.zeros((3, 3)), np.zeros((4, 3))
    tx[:, 0], rx[:, 0] = 7.8e-3 * np.arange(3), 1.95e-3 * np.arange(4)
    target = np.array([1.0, 4.0, 0.0])
    d = np.linalg.norm(tx - target, axis=1)[:, None] + np.linalg.norm(rx - target, axis=1)
    t = np.arange(samples) / rate
    beat = np.exp(2j * np.pi * (start + slope * t) * d[..., None] / speed_of_light)  # the phase rises with range
    np.savez(tmp_path / "cube.npz", adc=np.stack([np.zeros_like(beat), beat]))
    mapping = {
        "s": {"variable": "adc", "dims": ["chirp", "tx", "rx", "frequency"], "select": {"chirp": 1}},
        "frequency": {"start": start, "step": slope / rate, "points": samples},
        "tx": {"x": {"values": (1e3 * tx[:, 0]).tolist(), "unit": "mm"}},
        "rx": {"x": {"start": 0.0, "step": 1.95, "points": 4}, "unit": "mm"},
        "time_convention": "exp(-jwt)",
    }
    sweep = mf.import_data(tmp_path / "cube.npz", mapping=mapping)
    x, y = np.arange(-2.0, 2.01, 0.05), np.arange(3.0, 5.0, 0.02)
    image = mf.focus(sweep, x=x, y=y)
    peak = np.unravel_index(np.abs(image.values).argmax(), image.shape)
    assert x[peak[1]] == pytest.approx(1.0, abs=0.2)
    assert y[peak[0]] == pytest.approx(4.0, abs=0.08)


# --- what does not fit -----------------------------------------------------------------------------------------------

GOOD = {
    "s": {"variable": "s", "dims": ["frequency", "tx", "rx"]},
    "frequency": "f",
    "tx": {"position": "tx"},
    "rx": {"position": "rx"},
}


@pytest.fixture
def npz(tmp_path, measured):
    f, tx, rx, s = measured
    np.savez(tmp_path / "d.npz", s=s, f=f, tx=tx, rx=rx, ghz=f / 1e9, bad=np.append(f[:-1], np.nan), jump=f**2)
    return tmp_path / "d.npz"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"frequency": "freq"}, ["no variable 'freq'", "it holds s, f, tx"]),
        ({"frequency": "ghz"}, ["290 to 300 Hz", "unit"]),
        ({"frequency": "bad"}, ["not finite", "number 20"]),
        ({"frequency": "jump"}, ["equal rising steps"]),
        ({"frequency": {"start": 1e9, "step": 1e9, "points": 5}}, ["length 21 along 'frequency'", "5 values"]),
        ({"tx": {"position": "rx"}}, ["7 places of tx", "5 samples"]),
        ({"tx": {"position": "f"}}, ["shape (21,)", "(n, 3)"]),
        ({"s": {"variable": "s", "dims": ["frequency", "tx"]}}, ["shape (21, 5, 7)", "2 axes"]),
        ({"s": {"variable": "s", "dims": ["frequency", "tx", "rx"], "select": {"rx": 9}}}, ["length 7"]),
        ({"frequency": {"variable": "f", "unit": "mm"}}, ["unit 'mm'", "GHz"]),
        ({"s": {"variable": "s", "dims": ["tx", "frequency", "rx"]}}, ["length 5 along 'frequency'", "order of dims"]),
    ],
)
def test_what_does_not_fit_is_said_with_its_place(npz, change, words):
    with pytest.raises(InputError) as caught:
        mf.import_data(npz, mapping=GOOD | change)
    for word in [str(npz), *words]:
        assert word in str(caught.value)


def test_all_mistakes_of_a_mapping_are_said_at_once(tmp_path, npz):
    path = tmp_path / "m.toml"
    path.write_text(
        's = {variable = "s", dims = ["frequency", "tx", "rx"], slect = {}}\nfrequncy = "f"\n'
        'time_convention = "exp(jwt)"\ntx = {position = "tx", unit = "miles"}\n'
    )
    with pytest.raises(InputError) as caught:
        mf.import_data(npz, mapping=path)
    for word in (
        "s.slect",
        "did you mean 'select'",
        "frequncy",
        "did you mean 'frequency'",
        "time_convention",
        "tx.unit",
    ):
        assert word in str(caught.value)
    path.write_text('s = {variable = "s",\n')
    with pytest.raises(InputError, match="line 1"):
        mf.import_data(npz, mapping=path)
    path.write_text('s = {variable = "s", dims = ["frequency", "pair"]}\nfrequency = "f"\n')
    with pytest.raises(InputError, match="'pair' needs pairs"):
        mf.import_data(npz, mapping=path)


def test_a_file_that_says_nothing_of_itself_asks_for_a_mapping(npz, tmp_path):
    with pytest.raises(InputError, match="--guess"):
        mf.import_data(npz)
    (tmp_path / "a.s1p").write_text("# Hz S RI R 50\n1e9 0 1\n2e9 0 1\n")
    with pytest.raises(InputError, match="--positions"):
        mf.import_data(tmp_path / "a.s1p")
    with pytest.raises(InputError, match="2 files are given"):
        mf.import_data([npz, npz], mapping=GOOD)
    with pytest.raises(InputError, match="no files"):
        mf.import_data([])


def test_pairs_beyond_the_elements_are_refused(tmp_path):
    np.savez(tmp_path / "d.npz", s=np.ones((3, 2)) * 1j, tx=[1, 4], rx=[1, 2], el=array_of(3), twice=[1, 1])
    mapping = {
        "s": {"variable": "s", "dims": ["frequency", "pair"]},
        "frequency": {"start": 1e9, "stop": 2e9, "points": 3},
        "elements": {"position": "el"},
        "pairs": {"tx": "tx", "rx": "rx"},
    }
    with pytest.raises(InputError, match="holds 4 as number 1, expected whole numbers from 1 to 3"):
        mf.import_data(tmp_path / "d.npz", mapping=mapping)
    mapping["pairs"] = {"tx": "twice", "rx": "twice"}
    with pytest.raises(InputError, match="twice"):
        mf.import_data(tmp_path / "d.npz", mapping=mapping)


def test_a_sweep_of_our_own_is_imported_as_it_is(sweep, tmp_path):
    path = mf.save(sweep, tmp_path / "own.nc")
    xr.testing.assert_identical(mf.import_data(path), sweep)


def test_the_mappings_that_come_along_are_valid():
    assert set(shipped()) == {"arim", "gotcha", "merit"}
    for name in shipped():
        load_mapping(name)
    with pytest.raises(InputError, match="arim, gotcha, merit"):
        load_mapping("nothing")


# --- proposals -------------------------------------------------------------------------------------------------------


@ONE_FILE
@given(
    names=st.sampled_from(
        [
            ("S", "freq", "tx_pos", "rx_pos"),
            ("data", "f", "txLocations", "rxLocations"),
            ("meas.s21", "meas.frequency", "meas.tx_position", "meas.rx_position"),
        ]
    ),
    order=st.permutations(AXES),
    unit=st.sampled_from([1.0, 1e9]),
)
def test_a_proposal_for_a_plain_file_makes_the_right_sweep(tmp_path, measured, names, order, unit):
    f, tx, rx, s = measured
    values = (s.transpose([AXES.index(name) for name in order]), f / unit, tx, rx)
    content: dict = {}
    for name, value in zip(names, values, strict=True):
        group, _, leaf = name.rpartition(".")
        (content.setdefault(group, {}) if group else content)[leaf] = value
    savemat(tmp_path / "d.mat", content)
    guess = guess_mapping(tmp_path / "d.mat")
    assert guess.works
    (tmp_path / "m.toml").write_text(guess.to_toml())
    same(mf.import_data(tmp_path / "d.mat", mapping=tmp_path / "m.toml"), f, tx, rx, s)


def test_proposals_recognise_magnitudes_and_phases_millimetres_and_coordinates_one_by_one(tmp_path, measured):
    f, tx, rx, s = measured
    content = {
        "S21_dB": 20 * np.log10(2 * np.abs(s)),
        "S21_phase": np.degrees(np.angle(s)),
        "f_start": 290.0,
        "f_stop": 300.0,
    }
    content |= {"tx_x": tx[:, 0] * 1e3, "rx_x": rx[:, 0] * 1e3, "tx_y": tx[:, 1], "rx_y": rx[:, 1]}
    savemat(tmp_path / "d.mat", content)
    guess = guess_mapping(tmp_path / "d.mat")
    assert guess.works, guess.to_toml()
    same(mf.import_data(tmp_path / "d.mat", mapping=guess.entries), f, tx, rx, 2 * s)


@pytest.mark.parametrize("unit", ["degree", "radian"])
def test_proposals_recognise_raster_scans(tmp_path, unit):
    rng = np.random.default_rng(1)
    azimuth, elevation, f = np.linspace(-15, 15, 7), np.linspace(-10, 10, 5), np.linspace(270e9, 300e9, 9)
    s = rng.standard_normal((7, 5, 9)) + 1j * rng.standard_normal((7, 5, 9))
    turn = np.radians if unit == "radian" else np.asarray
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["raw/s11"], file["raw/az"], file["raw/el"], file["raw/frequencies"] = s, turn(azimuth), turn(elevation), f
    guess = guess_mapping(tmp_path / "d.h5")
    assert guess.works, guess.to_toml()
    sweep = mf.import_data(tmp_path / "d.h5", mapping=guess.entries)
    np.testing.assert_allclose(sweep["azimuth"], azimuth)
    np.testing.assert_allclose(sweep["s"].values, s.transpose(2, 0, 1), rtol=1e-5)


def test_a_proposal_says_what_it_does_not_know(tmp_path, measured):
    _, _, _, s = measured
    np.savez(tmp_path / "d.npz", s=s)
    guess = guess_mapping(tmp_path / "d.npz")
    assert not guess.works
    assert any("band" in sentence for sentence in guess.missing)
    assert "TO DO" in guess.to_toml()
    assert all(finding.sure in ("sure", "likely", "a guess") for finding in guess.findings)


def test_what_a_proposal_lacks_can_be_added_at_its_end(tmp_path, measured):
    f, tx, rx, s = measured
    np.savez(tmp_path / "d.npz", s=s, tx_pos=tx, rx_pos=rx)
    guess = guess_mapping(tmp_path / "d.npz")
    assert any("[frequency]" in sentence for sentence in guess.missing)
    band = '[frequency]\nstart = 290.0\nstop = 300.0\npoints = 21\nunit = "GHz"\n'
    (tmp_path / "m.toml").write_text(guess.to_toml() + band)
    same(mf.import_data(tmp_path / "d.npz", mapping=tmp_path / "m.toml"), f, tx, rx, s)


def test_a_proposal_writes_any_name_so_that_it_is_read_again():
    name = 'a "quoted"\\path\n\x7f\u00fc'
    guess = Guess(Path("d.npz"), entries={"s": {"variable": name, "dims": ["frequency"]}, "reciprocal": True})
    assert tomllib.loads(guess.to_toml()) == guess.entries


def test_proposals_for_real_files_make_sweeps(shared_data, tmp_path):
    for name in ("arim/contact_notch_aluminium.mat", "gotcha/data_3dsar_pass1_az001_HH.mat", "merit/B0_P3_p000.csv",
                 "acconeer/corner-reflector.h5"):  # fmt: skip
        guess = guess_mapping(shared_data / name)
        assert guess.works, guess.to_toml()
        (tmp_path / "m.toml").write_text(guess.to_toml())
        assert mf.import_data(shared_data / name, mapping=tmp_path / "m.toml").sizes["frequency"] > 20
    arim = guess_mapping(shared_data / "arim/contact_notch_aluminium.mat")
    assert arim.entries["pairs"] == {"tx": "exp_data.tx", "rx": "exp_data.rx", "base": 1}
    assert arim.entries["wave_speed"] == "exp_data.ph_velocity"
    gotcha = guess_mapping(shared_data / "gotcha/data_3dsar_pass1_az001_HH.mat")
    assert gotcha.entries["compensation"] == {"range": "data.r0"}


# --- the command line ------------------------------------------------------------------------------------------------


def test_the_command_imports_by_a_proposed_mapping(npz, tmp_path, capsys):
    assert main(["import", "--guess", str(npz), "-o", str(tmp_path / "m.toml")]) == 0
    assert "dims" in capsys.readouterr().out
    out = tmp_path / "s.nc"
    assert main(["import", str(npz), "--mapping", str(tmp_path / "m.toml"), "-o", str(out), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["dimensions"] == {"frequency": 21, "tx": 5, "rx": 7}
    assert mf.load(out).attrs["command"].startswith("mirrorfold import ")
    assert main(["import", "--guess", str(npz), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["works"].startswith("s(frequency 21, tx 5, rx 7)")


@pytest.mark.parametrize(
    "arguments",
    [
        ["import", "-o", "s.nc"],
        ["import", "d.npz"],
        ["import", "d.npz", "-o", "s.nc"],
        ["import", "none.npz", "-o", "s.nc"],
        ["import", "d.npz", "--mapping", "none.toml", "-o", "s.nc"],
        ["import", "d.npz", "--positions", "none.csv", "-o", "s.nc"],
        ["import", "d.npz", "-o", "none/s.nc"],
        ["import", "d.npz", "-o", "d.npz"],
        ["import", "d.npz", "--reader", "nonsense", "-o", "s.nc"],
        ["export", "d.npz", "-o", "scan"],
        ["export", "none.nc", "-o", "scan"],
    ],
)
def test_wrong_commands_are_told_in_one_line(npz, monkeypatch, capsys, arguments):
    monkeypatch.chdir(npz.parent)
    before = sorted(npz.parent.iterdir())
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert sorted(npz.parent.iterdir()) == before
