"""Scans with one file for each position: written, read back, and refused with the line that is wrong."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from profiles import examples

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.errors import InputError
from mirrorfold.sweep import make_monostatic_sweep, make_raster_sweep, make_sweep

ONE_FILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=examples(15))

pytestmark = pytest.mark.filterwarnings(
    "ignore:the files hold S11",
    "ignore:.*were not measured",
    "ignore:.*neighbouring places",
    "ignore:Neighbouring antennas stand",
)


def noise(rng, *shape):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)).astype(np.complex64)


def random_sweep(kind, seed):
    rng = np.random.default_rng(seed)
    f = np.linspace(270e9, 300e9, int(rng.integers(2, 12)))
    n, m = (int(v) for v in rng.integers(1, 6, 2))
    if kind == "pairs":
        attrs = {"title": 'drywall "L" \N{SATELLITE ANTENNA}', "wave_speed": 2.9e8} if seed % 2 else {}
        place = rng.uniform(-0.1, 0.1, (2, 6, 3))
        return make_sweep(
            noise(rng, f.size, n, m), frequency=f, tx_position=place[0, :n], rx_position=place[1, :m], **attrs
        )
    if kind == "moving":
        attrs = {"scene_center": [0.0, 1.0, 0.5]} if seed % 2 else {}
        return make_monostatic_sweep(
            noise(rng, f.size, n), frequency=f, antenna_position=rng.uniform(-1, 1, (n, 3)), **attrs
        )
    angles = np.sort(rng.uniform(-30, 30, (2, 6)).round(3))
    origin = rng.uniform(-1, 1, 3) if seed % 2 else np.zeros(3)
    return make_raster_sweep(
        noise(rng, f.size, n, m), frequency=f, azimuth=angles[0, :n], elevation=angles[1, :m], origin=origin
    )


@pytest.mark.slow
@ONE_FILE
@given(kind=st.sampled_from(["pairs", "moving", "raster"]), seed=st.integers(0, 100_000))
def test_a_random_sweep_written_as_a_scan_comes_back_exactly(tmp_path_factory, kind, seed):
    sweep = random_sweep(kind, seed)
    folder = tmp_path_factory.mktemp("scan") / "scan"
    positions = mf.save_touchstone(sweep, folder)
    back = mf.import_data(folder, positions=positions if seed % 3 else None)  # it is found in the folder
    assert back["s"].dims == sweep["s"].dims
    for name in ("s", "frequency", "tx_position", "rx_position", "antenna_position", "azimuth", "elevation"):
        if name in sweep.variables:
            np.testing.assert_array_equal(back[name].values, sweep[name].values, err_msg=name)
    for name in ("title", "wave_speed", "scene_center", "origin"):
        if name in sweep.attrs:
            np.testing.assert_array_equal(back.attrs[name], sweep.attrs[name])


def test_the_phases_of_all_files_tell_their_unit(tmp_path):
    f, s = np.linspace(270e9, 280e9, 41), np.exp(2j * np.pi * np.linspace(0.0, 1.0, 41 * 4)).reshape(4, 41)
    for n, values in enumerate(s):
        rows = np.column_stack([f, np.abs(values), np.angle(values)])
        np.savetxt(tmp_path / f"r{n}.csv", rows, delimiter=",", header="freq_Hz,S21_mag,S21_phase", comments="")
    lines = [f"r{n}.csv,{n},0" for n in range(4)]
    (tmp_path / "positions.csv").write_text("\n".join(["file,tx_x_mm,rx_x_mm", *lines]))
    with pytest.warns(UserWarning, match="taken for radians"):
        sweep = mf.import_data(tmp_path)
    np.testing.assert_allclose(sweep["s"].values[:, :, 0].T, s, atol=1e-6)


def test_the_beam_and_the_polarization_come_back_with_a_scan(tmp_path):
    known = {"spot_radius": 0.017, "focus_distance": 0.0, "polarization": "TM"}
    sweep = random_sweep("raster", 1).assign_attrs(known)
    back = mf.import_data(tmp_path / "scan", positions=mf.save_touchstone(sweep, tmp_path / "scan"))
    assert {name: back.attrs[name] for name in known} == known


def test_pairs_that_were_not_measured_are_not_written_and_are_known_afterwards(tmp_path):
    sweep = random_sweep("pairs", 4)
    measured = np.ones((sweep.sizes["tx"], sweep.sizes["rx"]), dtype=bool)
    measured[0, 0] = False
    sweep = sweep.assign(s=sweep["s"] * measured).assign_coords(measured=(("tx", "rx"), measured))
    sweep["s"] = sweep["s"].astype(np.complex64)
    positions = mf.save_touchstone(sweep, tmp_path / "scan")
    assert len(list((tmp_path / "scan").glob("*.s2p"))) == measured.size - 1
    back = mf.import_data(tmp_path / "scan", positions=positions)
    # Places are listed as they first appear in the table.
    order = [
        int(np.flatnonzero((sweep["tx_position"].values == place).all(axis=1))[0])
        for place in back["tx_position"].values
    ]
    columns = [
        int(np.flatnonzero((sweep["rx_position"].values == place).all(axis=1))[0])
        for place in back["rx_position"].values
    ]
    np.testing.assert_array_equal(back["measured"].values, measured[np.ix_(order, columns)])
    np.testing.assert_array_equal(back["s"].values, sweep["s"].values[:, order][:, :, columns])


def write(path, samples, parameter="S21"):
    """A two-port file with the samples as one of the parameters."""
    columns = {"S11": 0, "S21": 1, "S12": 2, "S22": 3}
    lines = ["# GHz S RI R 50"]
    for n, value in enumerate(samples):
        words = ["0.5 0.25"] * 4
        words[columns[parameter]] = f"{value.real:.9g} {value.imag:.9g}"
        lines.append(f"{270 + n} " + " ".join(words))
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture
def scan(tmp_path):
    """A folder of 2 x 3 two-port files and their samples (frequencies, tx, rx)."""
    s = noise(np.random.default_rng(1), 4, 2, 3)
    folder = tmp_path / "scan"
    folder.mkdir()
    for i in range(2):
        for k in range(3):
            write(folder / f"run_t{i + 1}_r{k + 1}.s2p", s[:, i, k])
    return folder, s


TX, RX = np.array([[-1.0, 0, 0], [1.0, 0, 2.0]]) * 1e-3, np.array([[5.0, 0, 0], [5.5, 0, 0], [6.0, 0, 1.0]]) * 1e-3


def table(headings="file,tx_x_mm,tx_z_mm,rx_x_mm,rx_z_mm", name="run_t{}_r{}.s2p", delimiter=","):
    lines = [headings.replace(",", delimiter)]
    for i in range(2):
        for k in range(3):
            numbers = [1e3 * v for v in (TX[i, 0], TX[i, 2], RX[k, 0], RX[k, 2])]
            lines.append(delimiter.join([name.format(i + 1, k + 1), *(f"{v:g}" for v in numbers)]))
    return lines


def is_the_scan(sweep, s):
    np.testing.assert_allclose(sweep["tx_position"], TX, atol=1e-12)
    np.testing.assert_allclose(sweep["rx_position"], RX, atol=1e-12)
    np.testing.assert_allclose(sweep["s"], s)
    np.testing.assert_allclose(sweep["frequency"], np.arange(270, 274) * 1e9)


@pytest.mark.parametrize(
    "lines",
    [
        table(),
        table("file,tx_x [mm],tx_z [mm],rx_x [mm],rx_z [mm]"),
        table(delimiter=";"),
        ["# made by the stage", "", *table(name="C:\\data\\run_t{}_r{}.s2p")],
        table(name="*_t{}_r{}.s2p"),
    ],
)
def test_tables_of_positions_are_understood(scan, tmp_path, lines):
    (tmp_path / "p.csv").write_text("\n".join(lines))
    is_the_scan(mf.import_data(scan[0], positions=tmp_path / "p.csv"), scan[1])
    is_the_scan(mf.import_data(sorted(scan[0].iterdir()), positions=tmp_path / "p.csv"), scan[1])


def test_a_pattern_of_file_names_and_places_of_stages(scan, tmp_path):
    (tmp_path / "p.toml").write_text(
        'files = "run_t{tx}_r{rx}.s2p"\nbase = 1\n'
        'tx = {x = [-1.0, 1.0], z = [0.0, 2.0], unit = "mm"}\n'
        'rx = {x = {start = 5.0, step = 0.5, points = 3}, z = [0.0, 0.0, 1.0], unit = "mm"}\n'
    )
    is_the_scan(mf.import_data(scan[0], positions=tmp_path / "p.toml"), scan[1])


@pytest.mark.parametrize("names", [("measurements", "filename"), ("files", "path"), ("file", "file")])
def test_one_json_metafile_is_enough(scan, names):
    entries = [
        {names[1]: f"run_t{i + 1}_r{k + 1}.s2p", "tx": (1e3 * TX[i]).tolist(), "rx": (1e3 * RX[k]).tolist()}
        for i in range(2)
        for k in range(3)
    ]
    (scan[0] / "meta.json").write_text(json.dumps({names[0]: entries, "unit": "mm"}))
    is_the_scan(mf.import_data(scan[0] / "meta.json"), scan[1])


def test_another_parameter_and_the_other_sign_are_taken_on_request(scan, tmp_path):
    (tmp_path / "p.csv").write_text("\n".join(table()))
    sweep = mf.import_data(scan[0], positions=tmp_path / "p.csv", parameter="s12")
    np.testing.assert_allclose(sweep["s"], 0.5 + 0.25j)
    (tmp_path / "p.toml").write_text('table = "p.csv"\ntime_convention = "exp(-jwt)"\nparameter = "S21"\n')
    is_the_scan(mf.import_data(scan[0], positions=tmp_path / "p.toml"), scan[1].conj())


def test_angles_in_file_names_make_a_raster_scan(tmp_path):
    azimuth, elevation = [-2.5, 0.0, 2.5], [-1.0, 1.0]
    s = noise(np.random.default_rng(2), 4, 3, 2)
    for i, a in enumerate(azimuth):
        for k, e in enumerate(elevation):
            write(tmp_path / f"az{a}_el{e}.s2p", s[:, i, k], "S11")
    (tmp_path / "p.toml").write_text('files = "az{azimuth}_el{elevation}.s2p"\norigin = [0.0, 0.0, 1.2]\n')
    sweep = mf.import_data(tmp_path, positions=tmp_path / "p.toml")
    np.testing.assert_allclose(sweep["s"], s)
    np.testing.assert_allclose(sweep["azimuth"], azimuth)
    np.testing.assert_allclose(sweep.attrs["origin"], [0.0, 0.0, 1.2])


def test_one_file_with_a_port_for_each_antenna(tmp_path):
    s = noise(np.random.default_rng(5), 3, 4, 4)  # frequency, out, in
    lines = ["# GHz S RI R 50"]
    for n in range(3):
        rows = [" ".join(f"{v.real:.9g} {v.imag:.9g}" for v in s[n, i]) for i in range(4)]
        lines += [f"{n + 1} {rows[0]}", *rows[1:]]
    (tmp_path / "array.s4p").write_text("\n".join(lines))
    (tmp_path / "p.toml").write_text('ports = {x = {start = 0.0, step = 1.0, points = 4}, unit = "cm"}\n')
    sweep = mf.import_data(tmp_path / "array.s4p", positions=tmp_path / "p.toml")
    np.testing.assert_allclose(sweep["s"], s.swapaxes(1, 2))
    np.testing.assert_allclose(sweep["tx_position"][:, 0], [0.0, 0.01, 0.02, 0.03])


@pytest.mark.parametrize("suffix", ["csv", "cti"])
def test_scans_of_other_formats_work_alike(tmp_path, suffix):
    s = noise(np.random.default_rng(3), 4, 3)
    f = np.arange(270, 274) * 1e9
    for k in range(3):
        rows = [f"{v.real:.9g},{v.imag:.9g}" for v in s[:, k]]
        if suffix == "csv":
            text = "\n".join(["frequency,re,im", *(f"{hz:.1f},{row}" for hz, row in zip(f, rows, strict=True))])
        else:
            head = ["CITIFILE A.01.00", "VAR FREQ MAG 4", "DATA S[1,1] RI", "SEG_LIST_BEGIN", "SEG 270E9 273E9 4"]
            text = "\n".join([*head, "SEG_LIST_END", "BEGIN", *rows, "END"])
        (tmp_path / f"p{k}.{suffix}").write_text(text)
    lines = ["file,x_mm,y_mm", *(f"p{k}.{suffix},{k},{2 * k}" for k in range(3))]
    (tmp_path / "positions.csv").write_text("\n".join(lines))
    files = sorted(tmp_path.glob(f"p?.{suffix}"))
    sweep = mf.import_data(files, positions=tmp_path / "positions.csv")
    np.testing.assert_allclose(sweep["s"], s)
    np.testing.assert_allclose(sweep["antenna_position"][:, 1], [0.0, 0.002, 0.004])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda lines: [*lines[:2], lines[2].replace("-1", "-l"), *lines[3:]], ["line 3", "'-l'", "tx_x_mm"]),
        (
            lambda lines: [*lines[:3], lines[3].replace("r3", "r9"), *lines[4:]],
            ["line 4", "run_t1_r9.s2p", "not among", "expected a name such as run_t1_r1.s2p"],
        ),
        (
            lambda lines: [line.replace(".s2p", "") for line in lines],
            ["line 2", "'run_t1_r1', which is not", "write run_t1_r1.s2p, with its ending"],
        ),
        (lambda lines: [*lines, lines[1]], ["line 8", "run_t1_r1.s2p", "line 2"]),
        (
            lambda lines: [lines[0], lines[1], lines[2].replace("5.5", "5"), *lines[3:]],
            ["line 3", "same places", "line 2"],
        ),
        (lambda lines: [lines[0], lines[1] + ",7", *lines[2:]], ["line 2", "6 columns", "expected 5"]),
        (lambda lines: [lines[0].replace("tx_x_mm", "tx_x_miles"), *lines[1:]], ["line 1", "tx_x_miles"]),
        (lambda lines: [lines[0].replace("file", "what"), *lines[1:]], ["line 1", "'file'"]),
        (lambda lines: [line.rpartition(",")[0].rpartition(",")[0] for line in lines], ["line 2", "no place of rx"]),
        (
            lambda lines: [f"{lines[0]},azimuth", *(f"{one},{n}" for n, one in enumerate(lines[1:]))],
            ["line 2", "keep to"],
        ),
        (lambda lines: [], ["empty"]),
        (lambda lines: lines[:1], ["names no file"]),
    ],
)
def test_mistakes_in_the_table_are_said_with_their_line(scan, tmp_path, change, words):
    path = tmp_path / "p.csv"
    path.write_text("\n".join(change(table())))
    with pytest.raises(InputError) as caught:
        mf.import_data(scan[0], positions=path)
    for word in [str(path), *words]:
        assert word in str(caught.value)


def test_a_column_that_is_no_place_is_named_and_left_out(scan, tmp_path):
    lines = [f"{line},{'comment' if n == 0 else 'wet floor'}" for n, line in enumerate(table())]
    (tmp_path / "p.csv").write_text("\n".join(lines))
    with pytest.warns(UserWarning, match=r"p\.csv: the columns 'comment' are not understood and left out"):
        is_the_scan(mf.import_data(scan[0], positions=tmp_path / "p.csv"), scan[1])


def test_the_mark_between_the_side_and_the_axis_may_be_missing(scan, tmp_path):
    (tmp_path / "p.csv").write_text("\n".join(table("file,txx_mm,txz_mm,rx_x_mm,rxz [mm]")))
    is_the_scan(mf.import_data(scan[0], positions=tmp_path / "p.csv"), scan[1])


def test_numbers_of_the_table_may_have_units(scan, tmp_path):
    for delimiter, headings in ((",", "file,tx_x,tx_z_mm,rx_x,rx_z [m]"), (";", "file,tx_x,tx_z,rx_x,rx_z")):
        first, *lines = table(headings, delimiter=delimiter)
        lines = [delimiter.join([cell if n == 0 else f"{cell} mm" for n, cell in enumerate(line.split(delimiter))])
                 for line in lines]  # fmt: skip
        (tmp_path / "p.csv").write_text("\n".join([first, *lines]))
        is_the_scan(mf.import_data(scan[0], positions=tmp_path / "p.csv"), scan[1])


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("-1 mm", "p.csv: the column 'tx_x' gives some numbers a unit and others none"),
        ("-1 s", "line 2 holds '-1 s' as tx_x, expected a number, which may have a unit: m, cm, mm"),
    ],
)
def test_units_of_one_column_are_of_one_kind_and_complete(scan, tmp_path, cell, message):
    lines = table("file,tx_x,tx_z_mm,rx_x_mm,rx_z_mm")
    (tmp_path / "p.csv").write_text("\n".join([lines[0], lines[1].replace("-1,", f"{cell},"), *lines[2:]]))
    with pytest.raises(InputError) as caught:
        mf.import_data(scan[0], positions=tmp_path / "p.csv")
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("headings", "message"),
    [
        ("file,tx_x_mm,tx_z_mm,rx_x_mm,rxheight_mm", "line 1 has the heading 'rxheight_mm', which is not understood"),
        ("file,tx_x_mm,tx_z_mm,rx_x_mm,H\xf6he [mm]", "line 1 has the heading 'H\xf6he [mm]', which is not understood"),
        ("file,tx_x_mm,tx_z_mm,rx_x_mm,tilt_deg", "line 1 has the heading 'tilt_deg', which is not understood"),
        ("file,Sender,S2,Empf\xe4nger,E2", "line 1, 'file,Sender,S2,Empf\xe4nger,E2', has no column of places"),
    ],
)
def test_no_place_is_left_out_in_silence(scan, tmp_path, headings, message):
    (tmp_path / "p.csv").write_text("\n".join(table(headings)), "utf-8")
    with pytest.raises(InputError) as caught:
        mf.import_data(scan[0], positions=tmp_path / "p.csv")
    assert message in str(caught.value)


def test_a_parameter_that_is_no_name_is_refused(scan, tmp_path):
    (tmp_path / "p.csv").write_text("\n".join(table()))
    with pytest.raises(InputError, match="parameter: got the number 21, expected the name"):
        mf.import_data(scan[0], positions=tmp_path / "p.csv", parameter=21)


def test_files_without_a_line_are_refused_where_they_were_listed_and_noted_in_a_folder(scan, tmp_path):
    (tmp_path / "p.csv").write_text("\n".join(table()))
    write(scan[0] / "thru.s2p", scan[1][:, 0, 0])
    with pytest.warns(UserWarning, match=r"^no line of p\.csv names thru\.s2p, which the folder"):
        mf.import_data(scan[0], positions=tmp_path / "p.csv")
    with pytest.raises(InputError, match=r"says nothing of thru\.s2p"):
        mf.import_data(sorted(scan[0].iterdir()), positions=tmp_path / "p.csv")


def test_a_file_with_other_frequencies_is_named(scan, tmp_path):
    (tmp_path / "p.csv").write_text("\n".join(table()))
    write(scan[0] / "run_t2_r1.s2p", scan[1][:3, 0, 0])
    with pytest.raises(InputError, match=r"run_t2_r1.s2p: has 3 frequencies from 270 GHz to 272 GHz, .*1_r1.s2p 4"):
        mf.import_data(scan[0], positions=tmp_path / "p.csv")


def test_millimetres_taken_for_metres_are_doubted(scan, tmp_path):
    (tmp_path / "p.csv").write_text("\n".join(table("file,tx_x,tx_z,rx_x,rx_z")))
    with pytest.warns(UserWarning, match="wavelengths: their positions are probably in mm"):
        mf.import_data(scan[0], positions=tmp_path / "p.csv")


def test_sweeps_with_frames_are_not_written(tmp_path):
    sweep = random_sweep("pairs", 2).expand_dims(frame=2)
    with pytest.raises(InputError, match="select one"):
        mf.save_touchstone(sweep, tmp_path / "scan")
    assert not (tmp_path / "scan").exists()


def test_the_commands_export_and_import(tmp_path, capsys, sweep):
    path = mf.save(sweep, tmp_path / "sweep.nc")
    assert main(["export", str(path), "-o", str(tmp_path / "scan"), "--json"]) == 0
    positions = json.loads(capsys.readouterr().out)["positions"]
    assert (
        main(["import", str(tmp_path / "scan"), "--positions", positions, "-o", str(tmp_path / "back.nc"), "--json"])
        == 0
    )
    assert json.loads(capsys.readouterr().out)["kind"] == "sweep"
    back = mf.load(tmp_path / "back.nc")
    xr.testing.assert_equal(back["s"], sweep["s"])
    assert back.attrs["title"] == "point target"
