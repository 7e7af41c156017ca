"""Tables of all pairs, wide and long; Network objects; what a file of nobody's format is told."""

from __future__ import annotations

import warnings
from functools import partial

import numpy as np
import point_target
import pytest
from point_target import TARGET, echo, line_of
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.io.readers import read_contents

same = partial(point_target.same, within=1e-9)


@pytest.fixture
def measured():
    """Frequencies, antennas and exact samples of a point target, 3 transmitters x 12 receivers."""
    f = np.linspace(290e9, 300e9, 21)
    tx, rx = line_of(3), line_of(12, 0.01)
    return f, tx, rx, echo(f, tx, rx)


def places(tx, rx):
    return {"tx": {"position": tx.tolist()}, "rx": {"position": rx.tolist()}}


MAPPED = {"s": {"variable": "s", "dims": ["frequency", "tx", "rx"]}, "frequency": "frequency"}


def write(path, headings, rows):
    np.savetxt(path, rows, delimiter=",", header=",".join(headings), comments="", fmt="%.12g")
    return path


def wide(path, f, s, form, unit="fGHz", scale=1e9, parts=("_re", "_im")):
    """A column for each pair and part: row i is the receiver, column j the transmitter."""
    columns, headings = [f / scale], [unit]
    for j in range(s.shape[1]):
        for i in range(s.shape[2]):
            values = s[:, j, i]
            both = (np.abs(values), np.degrees(np.angle(values))) if "deg" in parts[1] else (values.real, values.imag)
            if "dB" in parts[0]:
                both = (20 * np.log10(both[0]), both[1])
            columns += both
            headings += [form.format(i + 1, j + 1) + part for part in parts]
    return write(path, headings, np.stack(columns, axis=-1))


@pytest.mark.parametrize(
    ("form", "parts"),
    [
        ("S_{}_{}", ("_re", "_im")),
        ("S_{}_{}", ("_mag", "_deg")),
        ("S({},{})", (" real", " imag")),
        ("Rx{}_Tx{}", ("_re", "_im")),
        ("tx{1}rx{0}", ("_dB", "_phase_deg")),
    ],
)
def test_a_wide_table_is_a_cube(tmp_path, measured, form, parts):
    f, tx, rx, s = measured
    path = wide(tmp_path / "wide.csv", f, s, form, parts=parts)
    same(mf.import_data(path, mapping=MAPPED | places(tx, rx)), *measured)
    same(mf.import_data(path, positions=places(tx, rx)), *measured)


@pytest.mark.parametrize(
    ("headings", "cells", "named"),
    [
        ("S_1_1,S_1_1", "1+2i,3+4i", "'S_1_1' and 'S_1_1'"),
        ("S_1_1,S_1_2,S11", "1+2i,3+4i,5+6i", "'S_1_1' and 'S11'"),
        ("S_1_1_re,S_1_1_im,S_1_1_re,S_1_1_im", "1,2,3,4", "'S_1_1_re' and 'S_1_1_re'"),
    ],
)
def test_no_pair_has_two_columns(tmp_path, headings, cells, named):
    (tmp_path / "wide.csv").write_text(f"fGHz,{headings}\n290,{cells}\n291,{cells}\n")
    with pytest.raises(mf.InputError, match=rf"wide\.csv: the columns {named} hold the same pair; rename one"):
        mf.import_data(tmp_path / "wide.csv", positions={"tx": {"x": [0.0, 1.0]}, "rx": {"x": [0.0]}})


def test_a_wide_table_of_complex_cells(tmp_path, measured):
    f, tx, rx, s = measured
    names = [f"S_{i + 1}_{j + 1}" for j in range(3) for i in range(12)]
    rows = [[f"{f[n] / 1e6:.6f}", *(f"{v.real:.9g}{v.imag:+.9g}i" for v in s[n].ravel())] for n in range(f.size)]
    path = tmp_path / "wide.csv"
    path.write_text("\n".join(",".join(row) for row in [["freq [MHz]", *names], *rows]))
    same(mf.import_data(path, positions=places(tx, rx)), *measured)


def long(path, f, tx, rx, s, headings, sides, scale=1e9, keep=lambda i, k: True, values=None):
    rows = []
    for n in range(f.size):
        for i in range(len(tx)):
            for k in range(len(rx)):
                if keep(i, k):
                    one = s[n, i, k]
                    rows.append([f[n] / scale, *sides(i, k), *(values(one) if values else (one.real, one.imag))])
    np.random.default_rng(0).shuffle(rows)  # the order of the lines means nothing
    return write(path, headings, np.array(rows))


def test_a_long_table_of_numbers(tmp_path, measured):
    _, tx, rx, _ = measured
    path = long(tmp_path / "a.csv", *measured, ["freq", "tx", "rx", "re", "im"], lambda i, k: (i + 1, k + 1), scale=1.0)
    same(mf.import_data(path, positions=places(tx, rx)), *measured)
    same(mf.import_data(path, mapping=MAPPED | places(tx, rx)), *measured)
    contents = read_contents(path)
    assert contents.variables["s"].dims == ("frequency", "tx", "rx")


def test_a_long_table_of_places_needs_nothing_else(tmp_path, measured):
    f, tx, rx, s = measured
    headings = ["tx_x_mm", "rx_x [mm]", "fGHz", "mag_dB", "phase_deg"]
    level, phase = 20 * np.log10(np.abs(s)), np.degrees(np.angle(s))
    rows = [[1e3 * tx[i, 0], 1e3 * rx[k, 0], f[n] / 1e9, level[n, i, k], phase[n, i, k]]
            for i in range(3) for k in range(12) for n in range(f.size)]  # fmt: skip
    path = write(tmp_path / "a.csv", headings, np.array(rows))
    same(mf.import_data(path), *measured)


@pytest.mark.parametrize(
    ("headings", "factor"),
    [(("x_mm", "y_mm"), 1e3), (("x", "z [m]"), 1.0), (("antenna_x (cm)", "antenna_y (cm)"), 1e2), (("pos_x_um",), 1e6)],
)
def test_a_long_table_of_one_moving_antenna(tmp_path, measured, headings, factor):
    f, *_ = measured
    places = np.zeros((5, 3))
    axes = ["xyz".index(heading.removeprefix("antenna_").removeprefix("pos_")[0]) for heading in headings]
    places[:, axes] = np.array([[0.02, 0.01], [0.0, 0.0], [0.01, 0.0], [-0.01, 0.0], [0.0, 0.01]])[:, : len(axes)]
    places = np.unique(places, axis=0)
    s = np.stack([np.diag(one) for one in echo(f, places, places)])
    rows = [[f[n] / 1e9, *(factor * places[i, axes]), s[n, i].real, s[n, i].imag]
            for i in range(len(places)) for n in range(f.size)]  # fmt: skip
    path = write(tmp_path / "a.csv", ["f_GHz", *headings, "re", "im"], np.array(rows))
    sweep = mf.import_data(path)
    assert sweep["s"].dims == ("frequency", "position")
    np.testing.assert_allclose(sweep["antenna_position"], places, atol=1e-12)
    np.testing.assert_allclose(sweep["s"], s, atol=1e-5)
    path.write_text("\n".join(path.read_text().splitlines()[:-1]))
    with pytest.raises(mf.InputError, match=r"the position x .*has no line at \S+ Hz"):
        mf.import_data(path)


@pytest.mark.parametrize(
    ("headings", "factor"), [("azimuth,elevation", 1.0), ("az_deg,el_deg", 1.0), ("az [rad],el [rad]", np.pi / 180)]
)
def test_a_long_table_of_beams(tmp_path, measured, headings, factor):
    f, *_ = measured
    azimuth, elevation = np.array([-4.0, 0.0, 4.0]), np.array([-1.0, 1.0])
    s = measured[3][:, :3, :2]
    rows = [[f[n] / 1e9, factor * azimuth[i], factor * elevation[k], s[n, i, k].real, s[n, i, k].imag]
            for n in range(f.size) for k in range(2) for i in range(3)]  # fmt: skip
    sweep = mf.import_data(write(tmp_path / "a.csv", ["f_GHz", *headings.split(","), "re", "im"], np.array(rows)))
    assert sweep["s"].dims == ("frequency", "azimuth", "elevation")
    np.testing.assert_allclose(sweep["azimuth"], azimuth, atol=1e-9)
    np.testing.assert_allclose(sweep["elevation"], elevation, atol=1e-9)
    np.testing.assert_allclose(sweep["s"], s, atol=1e-5)


def test_a_spectrum_of_one_place_stays_a_spectrum(tmp_path, measured):
    """Files of a scan, one for each position, may say their own place in every line."""
    f, *_, s = measured
    for n in range(3):
        rows = np.stack([f, np.full(f.size, float(n)), s[:, n, 0].real, s[:, n, 0].imag], axis=-1)
        write(tmp_path / f"p{n}.csv", ["freq", "x_mm", "re", "im"], rows)
    (tmp_path / "positions.csv").write_text("file,x_mm\np0.csv,0\np1.csv,1\np2.csv,2\n")
    sweep = mf.import_data(tmp_path)
    np.testing.assert_allclose(sweep["s"], s[:, :3, 0], atol=1e-5)


@pytest.mark.parametrize(("heading", "unit"), [("phase", 1.0), ("phase", 180 / np.pi), ("phase_rad", 1.0)])
def test_phases_without_a_unit_are_radians_where_they_go_around_a_circle_of_two_pi(tmp_path, measured, heading, unit):
    _, tx, rx, _ = measured
    path = long(
        tmp_path / "a.csv", *measured, ["f_GHz", "tx", "rx", "mag", heading], lambda i, k: (i, k),
        values=lambda one: (abs(one), unit * np.angle(one)),
    )  # fmt: skip
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        same(mf.import_data(path, positions=places(tx, rx)), *measured)
    assert any("taken for radians" in str(one.message) for one in said) == (heading == "phase" and unit == 1.0)


def test_the_phases_of_all_columns_of_a_wide_table_tell_their_unit(tmp_path, measured):
    f, tx, rx, s = measured  # each column has fewer phases than tell it by themselves
    headings = [f"S_{i + 1}_{j + 1}_{part}" for j in range(3) for i in range(12) for part in ("mag", "phase")]
    both = np.stack([np.abs(s), np.angle(s)], axis=-1).reshape(f.size, -1)
    path = write(tmp_path / "wide.csv", ["f_GHz", *headings], np.column_stack([f / 1e9, both]))
    with pytest.warns(UserWarning, match="taken for radians"):
        same(mf.import_data(path, positions=places(tx, rx)), *measured)


def test_a_wide_table_of_two_by_two_antennas_is_one_of_pairs(tmp_path, measured):
    f, tx, rx, s = measured
    path = wide(tmp_path / "wide.csv", f, s[:, :2, :2], "S_{}_{}")
    same(mf.import_data(path, positions=places(tx[:2], rx[:2])), f, tx[:2], rx[:2], s[:, :2, :2])


def test_places_in_table_and_description_are_the_same_whatever_their_order(tmp_path, measured):
    _, tx, rx, s = measured
    headings, sides = ["fGHz", "tx_x", "rx_x", "re", "im"], lambda i, k: (tx[i, 0], rx[k, 0])
    path = long(tmp_path / "a.csv", *measured, headings, sides)
    same(mf.import_data(path, positions=places(tx[::-1], rx[::-1])), *measured)
    with pytest.raises(mf.InputError, match=r"other places of rx than the columns of .*a\.csv"):
        mf.import_data(path, positions=places(tx, rx + 1e-3))
    path = long(tmp_path / "a.csv", *measured, headings, sides, keep=lambda i, k: i != k)
    sweep = mf.import_data(path, positions=places(tx[::-1], rx[::-1]))
    np.testing.assert_allclose(sweep["s"], np.where(sweep["measured"].values, s, 0.0), atol=1e-5)


def test_antennas_of_any_numbers_stand_in_the_order_of_their_numbers(tmp_path, measured):
    _, tx, rx, s = measured  # ports 1 to 3 transmit, 4 to 15 receive
    path = long(
        tmp_path / "a.csv", *measured, ["f_GHz", "tx", "rx", "re", "im"], lambda i, k: (i + 1, k + 4),
        keep=lambda i, k: i != k,
    )  # fmt: skip
    sweep = mf.import_data(path, positions=places(tx, rx))
    assert not sweep["measured"].values[1, 1]
    np.testing.assert_allclose(sweep["s"], np.where(sweep["measured"].values, s, 0.0), atol=1e-5)


def test_three_places_of_two_coordinates_are_three(tmp_path, measured):
    f, tx, rx, s = measured
    path = wide(tmp_path / "wide.csv", f, s, "S_{}_{}")
    flat = {"tx": {"position": tx[:, :2].tolist()}, "rx": {"position": rx[:, :2].tolist()}}
    same(mf.import_data(path, positions=flat), *measured)


def test_missing_pairs_of_a_long_table_are_marked(tmp_path, measured):
    _, tx, rx, s = measured
    path = long(
        tmp_path / "a.csv", *measured, ["f_GHz", "tx", "rx", "re", "im"], lambda i, k: (i, k), keep=lambda i, k: i != k
    )
    sweep = mf.import_data(path, positions=places(tx, rx))
    assert sweep["measured"].values.sum() == 36 - 3
    assert not sweep["measured"].values[1, 1]
    np.testing.assert_allclose(sweep["s"], np.where(sweep["measured"].values, s, 0.0), atol=1e-5)


def test_a_line_that_is_missing_or_double_is_named(tmp_path, measured):
    path = long(tmp_path / "a.csv", *measured, ["fGHz", "tx", "rx", "re", "im"], lambda i, k: (i + 1, k + 1))
    lines = path.read_text().splitlines()
    path.write_text("\n".join(lines[:-1]))
    with pytest.raises(mf.InputError, match=r"has no line at \S+ Hz, expected one for each"):
        read_contents(path)
    path.write_text("\n".join([*lines, lines[-1]]))
    with pytest.raises(mf.InputError, match="has 2 lines at"):
        read_contents(path)


def test_unknown_headings_are_named(tmp_path, measured):
    f, tx, rx, s = measured
    headings = ["fGHz", "tx_x_mm", "rx_x_mm", "re", "im", "Temperatur"]
    rows = [[f[n] / 1e9, 1e3 * tx[i, 0], 1e3 * rx[k, 0], s[n, i, k].real, s[n, i, k].imag, 20.0]
            for i in range(3) for k in range(12) for n in range(f.size)]  # fmt: skip
    with pytest.warns(UserWarning, match="the columns 'Temperatur' are not understood and left out"):
        same(mf.import_data(write(tmp_path / "a.csv", headings, np.array(rows))), *measured)
    path = write(tmp_path / "b.csv", ["Frequenz", "Sender", "Wert"], np.ones((4, 3)))
    with pytest.raises(mf.InputError, match="headings 'Frequenz', 'Sender', 'Wert', which are not understood"):
        mf.import_data(path)


@pytest.mark.parametrize(
    "headings", ["freq,TX,RX,Sre,Sim", "Frequency (Hz),Tx No,Rx No,Real,Imag", "Freq [Hz],Tx No.,Rx No.,S_re,S_im"]
)
def test_headings_are_understood_in_many_spellings(tmp_path, measured, headings):
    _, tx, rx, _ = measured
    path = long(tmp_path / "a.csv", *measured, headings.split(","), lambda i, k: (i + 1, k + 1), scale=1.0)
    same(mf.import_data(path, positions=places(tx, rx)), *measured)


@pytest.mark.parametrize(
    ("headings", "said"),
    [
        ("freq,tx,rx,re,imaginery", "holds the headings 'imaginery', which are not understood"),
        ("freq,tx,rx,temperature,mag", "and holds magnitudes alone, 'mag', without the other part"),
        ("freq_GHz,x_miles,y_pol,re,im", "headings 'x_miles', 'y_pol', which are not understood"),
    ],
)
def test_headings_that_make_no_samples_are_named(tmp_path, measured, headings, said):
    _, tx, rx, _ = measured
    path = long(tmp_path / "a.csv", *measured, headings.split(","), lambda i, k: (i + 1, k + 1))
    for given in ({}, {"positions": places(tx, rx)}):
        with pytest.raises(mf.InputError, match=said):
            mf.import_data(path, **given)


@pytest.mark.slow
@pytest.mark.parametrize(
    "content",
    [
        np.random.default_rng(0).bytes(50_000),
        b"word " * 10_000,
        b"x" * 50_000,
        b"%PDF-1.7\n" + b"\xff\xfe" * 9000,
        ("freq," + ",".join(f"column {n}" for n in range(3000)) + "\n" + ",".join(["1"] * 3001)).encode(),
        ("a" * 9000 + ",b\n1,2\n3,4\n").encode(),
        b"<html>" + b"<p>1</p>\n" * 3000,
        b'{"a": ' + b"[1, 2, 3], " * 5000,
    ],
    ids=["bytes", "words", "letters", "pdf", "columns", "a long heading", "html", "json"],
)
@pytest.mark.parametrize("guess", [False, True])
def test_a_file_of_no_known_format_is_told_so_on_one_screen(tmp_path, capsys, content, guess):
    path = tmp_path / "file.dat"
    path.write_bytes(content)
    code = main(["import", str(path), *(["--guess"] if guess else ["-o", str(tmp_path / "o.nc")])])
    printed = capsys.readouterr()
    assert code == 2 or guess
    assert len(printed.out) + len(printed.err) < 2000
    assert not (tmp_path / "o.nc").exists()


def test_many_names_are_cut_short(tmp_path):
    np.savez(tmp_path / "a.npz", **{f"variable_{n}_{'x' * 60}": np.zeros(3) for n in range(900)})
    with pytest.raises(mf.InputError, match="and 888 more") as refused:
        mf.import_data(tmp_path / "a.npz")
    assert len(str(refused.value)) < 1500


skrf = pytest.importorskip("skrf")


def networks(f, tx, rx, s):
    """A two-port for each pair."""
    found = []
    for i in range(len(tx)):
        for k in range(len(rx)):
            matrix = np.zeros((f.size, 2, 2), complex)
            matrix[:, 1, 0] = matrix[:, 0, 1] = s[:, i, k]
            found.append(skrf.Network(f=f, f_unit="Hz", s=matrix, name=f"run_{i}_{k}"))
    return found


DESCRIBED = {"files": "run_{tx}_{rx}.s2p", "parameter": "S21"}


def test_a_set_or_list_of_networks_is_a_scan(tmp_path, measured):
    _, tx, rx, _ = measured
    held = networks(*measured)
    for given in (held, skrf.networkSet.NetworkSet(held)):
        same(mf.import_data(given, positions=DESCRIBED | places(tx, rx)), *measured)
    lines = ["file,tx_x,rx_x"] + [f"run_{i}_{k},{tx[i, 0]!r},{rx[k, 0]!r}" for i in range(3) for k in range(12)]
    (tmp_path / "positions.csv").write_text("\n".join(lines).replace("np.float64(", "").replace(")", ""))
    same(mf.import_data(held, positions=tmp_path / "positions.csv", parameter="S21"), *measured)


def test_a_network_with_a_port_for_each_antenna(measured):
    f, _, rx, _ = measured
    d = np.linalg.norm(rx - TARGET, axis=1)
    s = np.exp(-2j * np.pi * f[:, None, None] / speed_of_light * (d[:, None] + 1.5 * d))  # not its own transpose
    network = skrf.Network(f=f, f_unit="Hz", s=np.swapaxes(s, 1, 2), name="array")
    same(mf.import_data(network, positions={"ports": {"position": rx.tolist()}}), f, rx, rx, s)


def test_networks_without_places_or_with_one_name_are_refused(measured):
    held = networks(*measured)
    with pytest.raises(mf.InputError, match="36 networks are given and nothing says where"):
        mf.import_data(held)
    with pytest.raises(mf.InputError, match=r"two networks are called 'run_0_0\.s2p'"):
        mf.import_data([held[0], held[0]], positions=DESCRIBED)
    with pytest.raises(mf.InputError, match=r"holds S11, S21, S12, S22 and not|parameter is 'S31'"):
        mf.import_data(held, positions=DESCRIBED | places(*measured[1:3]), parameter="S31")


def test_networks_and_their_files_are_the_same(tmp_path, measured):
    _, tx, rx, _ = measured
    held = networks(*measured)
    for network in held:
        network.write_touchstone(network.name, dir=tmp_path)
    from_files = mf.import_data(sorted(tmp_path.glob("*.s2p")), positions=DESCRIBED | places(tx, rx))
    from_memory = mf.import_data(held, positions=DESCRIBED | places(tx, rx))
    order = np.argsort(from_files["rx_position"].values[:, 0])  # the names of the files have another order
    np.testing.assert_allclose(from_files["s"].isel(rx=order), from_memory["s"], atol=1e-6)


def test_places_may_be_arrays(tmp_path, measured):
    _, tx, rx, _ = measured
    path = long(tmp_path / "a.csv", *measured, ["freq", "tx", "rx", "re", "im"], lambda i, k: (i + 1, k + 1), scale=1.0)
    same(mf.import_data(path, positions={"tx": {"position": tx}, "rx": {"x": rx[:, 0]}}), *measured)
    same(mf.import_data(path, mapping=MAPPED | {"tx": {"position": tx}, "rx": {"position": rx}}), *measured)
