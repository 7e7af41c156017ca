"""Columns, headings, marks and encodings of text tables as other programs write them."""

from __future__ import annotations

from functools import partial

import numpy as np
import point_target
import pytest
from point_target import echo, line_of

import mirrorfold as mf

same = partial(point_target.same, within=1e-6)

FREQUENCY = np.linspace(290e9, 300e9, 21)
TX, RX = line_of(3), line_of(5, 0.01)
S = echo(FREQUENCY, TX, RX)
PLACES = {"tx": {"position": TX.tolist()}, "rx": {"position": RX.tolist()}}


def long(headings, mark=",", cell=lambda n, i, k: [], comment=""):
    """A long table, with further cells in front of each line."""
    lines = [comment + mark.join(headings)]
    for n, i, k in np.ndindex(S.shape):
        values = [f"{FREQUENCY[n] / 1e9:.9g}", i + 1, k + 1, f"{S[n, i, k].real:.9g}", f"{S[n, i, k].imag:.9g}"]
        lines.append(mark.join(map(str, [*cell(n, i, k), *values])))
    return "\n".join(lines)


HEADINGS = ["freq_GHz", "tx", "rx", "re", "im"]

CLOCK = {
    "humidity": lambda n, i, k: [0.4],
    "operator": lambda n, i, k: ["alice"],
    "timestamp": lambda n, i, k: [f"2025-01-01T00:{n:02}:00"],
}


@pytest.mark.parametrize("name", CLOCK)
def test_columns_that_mean_nothing_are_named_and_left_out(tmp_path, name):
    path = tmp_path / "a.csv"
    path.write_text(long([name, *HEADINGS], cell=CLOCK[name]))
    with pytest.warns(UserWarning, match=f"the columns '{name}' are not understood and left out"):
        same(mf.import_data(path, positions=PLACES), FREQUENCY, TX, RX, S)


def test_a_real_column_beside_complex_cells_is_no_sample(tmp_path):
    names = [f"S_{k + 1}_{i + 1}" for i in range(3) for k in range(5)]
    lines = [",".join(["f_Hz", "humidity", *names])]
    s = S.copy()
    s[:, 0, 0] = 0.0  # a dead channel is one nevertheless
    for n, f in enumerate(FREQUENCY):
        lines.append(",".join([f"{f:.0f}", "0.4", *(f"{v.real:.9g}{v.imag:+.9g}i" for v in s[n].ravel())]))
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines))
    with pytest.warns(UserWarning, match="'humidity' are not understood"):
        same(mf.import_data(path, positions=PLACES), FREQUENCY, TX, RX, s)


@pytest.mark.parametrize("text", [
    long(["Freq. (GHz)", "Tx #", "Rx #", "Re{S21}", "Im{S21}"]),
    long(HEADINGS, comment="# "),
    long(HEADINGS, mark=" ", comment="# "),
    long(HEADINGS, mark="|"),
    long(HEADINGS, mark="\t"),
])  # fmt: skip
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_headings_marks_and_encodings(tmp_path, text, encoding):
    path = tmp_path / "a.csv"
    path.write_text(text, encoding=encoding)
    same(mf.import_data(path, positions=PLACES), FREQUENCY, TX, RX, S)


@pytest.mark.parametrize("between", [" ", ",", ", ", ";", "\t"])
@pytest.mark.parametrize("mark", [" ", ",", ";"])
def test_the_header_of_savetxt_may_have_other_marks_than_the_numbers(tmp_path, between, mark):
    path = tmp_path / "a.csv"
    n, i, k = np.indices(S.shape).reshape(3, -1)
    rows = np.column_stack([FREQUENCY[n] / 1e9, i + 1, k + 1, S.real.ravel(), S.imag.ravel()])
    np.savetxt(path, rows, delimiter=mark, header=between.join(HEADINGS))
    same(mf.import_data(path, positions=PLACES), FREQUENCY, TX, RX, S)


def test_words_in_a_column_that_means_something_are_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text(long(HEADINGS).replace("\n290,1,1,", "\n290,first,1,"))
    with pytest.raises(mf.InputError, match="line 2 holds 'first', expected a number"):
        mf.import_data(path, positions=PLACES)
