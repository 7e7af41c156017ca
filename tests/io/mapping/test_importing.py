"""Import: mappings of any file to a sweep, whatever the order of axes, the units and the form of the samples."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from point_target import AXES, echo, line_of, same
from profiles import examples
from scipy.constants import speed_of_light
from scipy.io import savemat

import mirrorfold as mf
from mirrorfold.errors import InputError
from mirrorfold.io.mapping.model import load_mapping, shipped

ONE_FILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=examples(30))


@pytest.mark.slow
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


@pytest.mark.slow
def test_a_half_matrix_becomes_a_full_one_by_reciprocity(tmp_path):
    f, place = np.linspace(290e9, 300e9, 11), line_of(6)
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
    apart = {name: value for name, value in mapping.items() if name != "elements"}
    apart |= {"tx": {"position": "d.el"}, "rx": {"position": np.add(place, [0.0, 0.0, 0.015]).tolist()}}
    with pytest.raises(mf.InputError, match="reciprocal is true, and transmitters and receivers stand at different"):
        mf.import_data(tmp_path / "fmc.mat", mapping=apart)
    half = mf.import_data(tmp_path / "fmc.mat", mapping=mapping | {"reciprocal": False})
    np.testing.assert_array_equal(half["measured"], np.triu(np.ones((6, 6), dtype=bool)))
    assert not np.any(half["s"].values[:, 3, 1])
    path = mf.save(half, tmp_path / "half.nc")
    xr.testing.assert_identical(mf.load(path)["measured"], half["measured"])


def test_pairs_that_were_not_measured_are_missing_from_the_image(tmp_path):
    f, place = np.linspace(290e9, 300e9, 41), line_of(6)
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
    speed, place = 6000.0, line_of(8) * 1.0
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
    np.savez(tmp_path / "sar.npz", s=s, f=f, x=antenna[:, 0], y=antenna[:, 1], z=antenna[:, 2], r0_cm=100.0 * r0)
    mapping = {
        "s": {"variable": "s", "dims": ["frequency", "position"]},
        "frequency": "f",
        "antenna": {"x": "x", "y": "y", "z": "z"},
        "compensation": {"range": "r0_cm"},  # its name tells the unit
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


@pytest.mark.parametrize("convention", ["exp(+jwt)", "exp(-jwt)"])
@pytest.mark.parametrize("falling", [False, True])
def test_a_mixer_without_q_gives_the_same_echoes_to_half_of_the_range(tmp_path, convention, falling):
    f, tx, rx = np.linspace(77e9, 80e9, 257), line_of(3, pitch=7.8e-3), line_of(4, pitch=1.95e-3)
    delays = np.array([40, 90, 127]) / (257 * (f[1] - f[0]))  # of bins of the range profile, the last before its middle
    s = np.exp(-2j * np.pi * (f - f[0])[:, None] * delays).sum(axis=1)[:, None, None] * np.ones((1, 3, 4))
    order = slice(None, None, -1) if falling else slice(None)
    np.savez(tmp_path / "cube.npz", adc=np.round(1000 * s.real[order]).astype(np.int16), f=f[order], tx=tx, rx=rx)
    mapping = {
        "s": {"variable": "adc", "dims": ["frequency", "tx", "rx"], "beat": True},
        "frequency": "f",
        "tx": {"position": "tx"},
        "rx": {"position": "rx"},
        "time_convention": convention,
    }
    sweep = mf.import_data(tmp_path / "cube.npz", mapping=mapping)
    np.testing.assert_allclose(sweep["frequency"], f[::2])
    np.testing.assert_allclose(sweep["s"], 1000 * s[::2], atol=2.0)
    del mapping["s"]["beat"]
    with pytest.raises(InputError, match="beat = true"):
        mf.import_data(tmp_path / "cube.npz", mapping=mapping)
    np.savez(tmp_path / "cube.npz", adc=s, f=f, tx=tx, rx=rx)
    mapping["s"]["beat"] = True
    with pytest.raises(InputError, match="the samples are complex"):
        mf.import_data(tmp_path / "cube.npz", mapping=mapping)


def test_a_sweep_of_our_own_is_imported_as_it_is(sweep, tmp_path):
    path = mf.save(sweep, tmp_path / "own.nc")
    xr.testing.assert_identical(mf.import_data(path), sweep)


def test_the_mappings_that_come_along_are_valid():
    assert set(shipped()) == {"arim", "gotcha", "merit"}
    for name in shipped():
        load_mapping(name)
    with pytest.raises(InputError, match="arim, gotcha, merit"):
        load_mapping("nothing")


def test_files_are_joined_to_frames_of_the_same_pairs_and_waves(tmp_path):
    f, tx, rx = np.linspace(290e9, 300e9, 11), line_of(3), line_of(4, 0.01)
    s, (i, k) = echo(f, tx, rx), np.indices((3, 4)).reshape(2, -1)
    files = [tmp_path / f"{n}.npz" for n in range(2)]

    def write(n, kept=slice(None), speed=2.9e8):
        np.savez(files[n], s=(1 + n) * s[:, i[kept], k[kept]], tx=i[kept], rx=k[kept], f=f, a=tx, b=rx, c=speed)

    mapping = {
        "s": {"variable": "s", "dims": ["frequency", "pair"]}, "frequency": "f", "tx": {"position": "a"},
        "rx": {"position": "b"}, "pairs": {"tx": "tx", "rx": "rx", "base": 0}, "wave_speed": "c", "join": "frame",
    }  # fmt: skip
    write(0), write(1)
    joined = mf.import_data(files, mapping=mapping)
    assert joined["s"].dims == ("frame", "frequency", "tx", "rx")
    np.testing.assert_allclose(joined["s"], [s, 2 * s], atol=1e-5)
    write(1, slice(1, None))
    with pytest.raises(mf.InputError, match=r"1\.npz: lacks other pairs than .*0\.npz"):
        mf.import_data(files, mapping=mapping)
    write(1, speed=2.8e8)
    with pytest.raises(mf.InputError, match=r"1\.npz: has another wave_speed"):
        mf.import_data(files, mapping=mapping)


@pytest.mark.parametrize(
    ("attribute", "unit", "per_metre"),
    [("units", "cm", 100.0), ("unit", "Millimeters", 1e3), ("Units", "inch", 1 / 0.0254), ("UNIT", "cm", 100.0)],
)
def test_places_without_a_unit_are_in_that_of_their_variables(tmp_path, attribute, unit, per_metre):
    f, tx, rx = np.linspace(290e9, 300e9, 11), line_of(3), line_of(4, 0.01)
    s = echo(f, tx, rx)
    with h5py.File(tmp_path / "d.h5", "w") as file:
        file["s"], file["f"], file["a"], file["rx_x_mm"], file["b"] = (
            s, f / 1e6, per_metre * tx, 1e3 * rx[:, 0], rx,
        )  # fmt: skip
        file["a"].attrs[attribute], file["f"].attrs[attribute] = unit, "megahertz"
    mapping = {"s": {"variable": "s", "dims": ["frequency", "tx", "rx"]}, "frequency": "f", "tx": {"position": "a"}}
    for places in ({"x": "rx_x_mm"}, {"position": "b"}, {"x": "rx_x_mm", "unit": "mm"}):
        same(mf.import_data(tmp_path / "d.h5", mapping=mapping | {"rx": places}), f, tx, rx, s)
