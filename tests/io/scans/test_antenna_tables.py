"""Positions of one file with all pairs, from a table with a line for each antenna."""

from __future__ import annotations

import numpy as np
import pytest

import mirrorfold as mf
from mirrorfold.errors import InputError

F = np.linspace(290e9, 300e9, 5)
TX = np.array([[-0.02, 0.0, 0.0], [-0.015, 0.001, 0.0], [-0.01, 0.002, 0.0]])
RX = np.array([[0.01, 0.0, 0.0], [0.02, 0.0, 0.005]])


@pytest.fixture
def pairs(tmp_path):
    """Path of a table with all pairs, and its samples (frequency, tx, rx)."""
    rng = np.random.default_rng(3)
    s = rng.standard_normal((F.size, 3, 2)) + 1j * rng.standard_normal((F.size, 3, 2))
    rows = [f"{F[n] / 1e9:g},{i + 1},{j + 1},{v.real:.9g},{v.imag:.9g}" for (n, i, j), v in np.ndenumerate(s)]
    path = tmp_path / "pairs.csv"
    path.write_text("\n".join(["f_GHz,tx,rx,re,im", *rows]))
    return path, s


def table(path, names, places, heading="antenna,x_mm,y [mm],z_mm"):
    lines = [f"{name},{x * 1e3},{y * 1e3},{z * 1e3}" for name, (x, y, z) in zip(names, places, strict=True)]
    path.write_text("\n".join([heading, *lines]))
    return path


NUMBERED = ["tx1", "tx2", "tx3", "rx1", "rx2"]


@pytest.mark.parametrize("names", [NUMBERED, ["tx"] * 3 + ["rx"] * 2, ["Tx 01", "TX_02", "T-3", "receiver 1", "R2"]])
def test_each_antenna_has_a_line(tmp_path, pairs, names):
    path, s = pairs
    sweep = mf.import_data(path, positions=table(tmp_path / "antennas.csv", names, [*TX, *RX]))
    np.testing.assert_allclose(sweep["s"], s, rtol=1e-6)
    np.testing.assert_allclose(sweep["tx_position"], TX, atol=1e-12)
    np.testing.assert_allclose(sweep["rx_position"], RX, atol=1e-12)


def test_numbers_and_not_lines_order_the_antennas(tmp_path, pairs):
    order = [4, 1, 0, 3, 2]
    names, places = [NUMBERED[n] for n in order], [[*TX, *RX][n] for n in order]
    sweep = mf.import_data(pairs[0], positions=table(tmp_path / "antennas.csv", names, places))
    np.testing.assert_allclose(sweep["tx_position"], TX, atol=1e-12)
    np.testing.assert_allclose(sweep["rx_position"], RX, atol=1e-12)


def test_ports_transmit_and_receive(tmp_path):
    lines = ["# Hz S RI R 50", "290e9 1 1 2 1 3 0 4 0", "291e9 5 0 6 0 7 1 8 1"]
    (tmp_path / "both.s2p").write_text("\n".join(lines))
    ports = table(tmp_path / "ports.csv", [2, 1], TX[:2], heading="Port,x_mm,y_mm,z_mm")
    sweep = mf.import_data(tmp_path / "both.s2p", positions=ports)
    np.testing.assert_allclose(sweep["tx_position"], TX[1::-1], atol=1e-12)
    np.testing.assert_allclose(sweep["rx_position"], TX[1::-1], atol=1e-12)
    assert sweep["s"].values[0, 0, 1] == 2 + 1j  # S21 of Touchstone comes second: out of port 1, into port 2


@pytest.mark.parametrize(
    ("names", "heading", "message"),
    [
        (["tx1", "tx1", "tx3", "rx1", "rx2"], None, "line 3 names the antenna 'tx1' again"),
        (["tx11", "tx12", "tx", "rx1", "rx2"], None, "all with a number or none"),
        (["tx1", "tx2", "tx3", "tx4", "tx5"], None, "holds the antennas tx1, tx2"),
        (["tx1", "tx2", "tx3", "rx1", "left"], None, "line 6 names the antenna 'left'; expected tx1, tx2"),
        (["tx1", "tx2", "tx3", "rx1", "7"], None, "expected tx1, tx2 ... and rx1, rx2"),
        (NUMBERED, "antenna,tx_x,tx_y,tx_z", "has no column x, y or z"),
        (NUMBERED, "aerial,x,y,z", "has no column 'file'; expected file, tx_x"),
        (NUMBERED, "antenna,x,y,port", "names antenna twice"),
    ],
)
def test_a_wrong_table_is_refused_by_its_line(tmp_path, pairs, names, heading, message):
    path = table(tmp_path / "antennas.csv", names, [*TX, *RX], **({"heading": heading} if heading else {}))
    with pytest.raises(InputError) as caught:
        mf.import_data(pairs[0], positions=path)
    assert message in str(caught.value)


def test_a_table_of_antennas_is_no_table_of_files(tmp_path, pairs):
    table(tmp_path / "antennas.csv", NUMBERED, [*TX, *RX])
    (tmp_path / "scan.toml").write_text('table = "antennas.csv"')
    with pytest.raises(InputError, match=r"antennas.csv: is a table of antennas; give it by itself"):
        mf.import_data(pairs[0], positions=tmp_path / "scan.toml")


def test_a_table_of_files_may_name_ports_and_channels(tmp_path):
    lines = ["# Hz S RI R 50", "290e9 1 1", "291e9 5 1"]
    (tmp_path / "a.s1p").write_text("\n".join(lines))
    (tmp_path / "b.s1p").write_text("\n".join(lines))
    path = tmp_path / "positions.csv"
    path.write_text("file,port,channel,x_mm\na.s1p,1,1,-1\nb.s1p,1,2,1\n")
    sweep = mf.import_data([tmp_path / "a.s1p", tmp_path / "b.s1p"], positions=path)
    np.testing.assert_allclose(sweep["antenna_position"][:, 0], [-0.001, 0.001], atol=1e-12)


def test_a_table_of_ten_ports_is_read_like_a_touchstone_file(tmp_path):
    """From ten on, the names of parameters have a comma."""
    frequency, count = np.linspace(290e9, 300e9, 3), 10
    s = np.arange(3.0)[:, None, None] + 10.0 * np.arange(count)[:, None] + np.arange(count)
    names = [f"S_{out + 1}_{into + 1}" for into in range(count) for out in range(count)]
    rows = [
        ",".join([f"{f:g}", *(f"{v:g}+1j" for v in row)]) for f, row in zip(frequency, s.reshape(3, -1), strict=True)
    ]
    (tmp_path / "all.csv").write_text("\n".join([",".join(["freq", *names]), *rows, ""]))
    (tmp_path / "p.toml").write_text("ports = {x = {start = 0.0, step = 1e-3, points = 10}}\n")
    sweep = mf.import_data(tmp_path / "all.csv", positions=tmp_path / "p.toml")
    np.testing.assert_allclose(sweep["s"].values.real, s)
