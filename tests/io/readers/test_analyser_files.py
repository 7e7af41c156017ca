"""Files of network analysers: tables with their headings, CITI and Touchstone; each says the line of its mistake."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from profiles import examples
from reading import refused

from mirrorfold.io.readers import read_contents, touchstone

ONE_FILE = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=examples(40))


@pytest.mark.parametrize(
    ("heading", "parts", "delimiter"),
    [
        ("freq[Hz];re:Trc1_S21;im:Trc1_S21;", "ri", ";"),  # Rohde & Schwarz
        ("freq[Hz];db:Trc1_S21;ang:Trc1_S21;", "db", ";"),
        ("freq[Hz];mag:Trc1_S21;ang:Trc1_S21", "ma", ";"),
        ("Freq(Hz),S21(REAL),S21(IMAG)", "ri", ","),  # Keysight
        ("Freq(Hz),S21(DB),S21(DEG)", "db", ","),
        ("Freq(Hz),S21 Log Mag(dB),S21 Phase(deg)", "db", ","),
        ("Frequency (Hz),Re(S21),Im(S21)", "ri", ","),
        ("frequency\tS21_mag\tS21_phase_rad", "mr", "\t"),
        ("freq_Hz,S21_re,S21_im", "ri", ","),
        ("Frequency/Hz,dB(S(2,1)),ang(S(2,1))", "db", ","),
        ("Stimulus [Hz];Trc1_S21[re];Trc1_S21[im]", "ri", ";"),
        ("# Freq,Real,Imag\nFreq. [Hz],Real(S21),Imag(S21)", "ri", ","),
    ],
)
def test_tables_of_network_analysers_describe_themselves(tmp_path, rng, heading, parts, delimiter):
    s = rng.standard_normal(5) + 1j * rng.standard_normal(5)
    f = np.linspace(270e9, 300e9, 5)
    angle = np.angle(s) if parts == "mr" else np.degrees(np.angle(s))
    size = 20 * np.log10(np.abs(s)) if parts == "db" else np.abs(s)
    columns = (s.real, s.imag) if parts == "ri" else (size, angle)
    lines = [delimiter.join(f"{v:.15g}" for v in row) for row in zip(f, *columns, strict=True)]
    text = "\n".join(["!CSV A.10.45.04", "BEGIN CH1_DATA", heading, *lines, "END"])
    (tmp_path / "trace.csv").write_text(text)
    spectra = read_contents(tmp_path / "trace.csv").spectra
    np.testing.assert_allclose(spectra.frequency, f)
    np.testing.assert_allclose(spectra.parameters["S21"], s, rtol=1e-12)


def test_decimal_commas_and_gigahertz_are_understood(tmp_path):
    (tmp_path / "trace.csv").write_text("freq[GHz];re:S11;im:S11\n1,5;0,25;-1\n2,0;0,5;1e-3\n")
    spectra = read_contents(tmp_path / "trace.csv").spectra
    np.testing.assert_allclose(spectra.frequency, [1.5e9, 2e9])
    np.testing.assert_allclose(spectra.parameters["S11"], [0.25 - 1j, 0.5 + 1e-3j])


def test_a_table_says_the_line_of_its_mistake(tmp_path):
    (tmp_path / "a.csv").write_text("1,2\n3,4\n5,x6\n")
    refused(tmp_path / "a.csv", "line 3", "'x6'")
    (tmp_path / "b.csv").write_text("1,2\n3,4,5\n")
    refused(tmp_path / "b.csv", "line 2", "3 columns")


CITI = """CITIFILE A.01.01
#NA VERSION HP8510XF.01.02
NAME RAW_DATA
VAR FREQ MAG {points}
DATA S[1,1] RI
DATA S[2,1] {form}
{axis}
BEGIN
{first}
END
BEGIN
{second}
END
"""


@pytest.mark.parametrize("form", ["RI", "MAGANGLE", "DBANGLE"])
@pytest.mark.parametrize("listed", [False, True])
def test_citi_files_are_read(tmp_path, rng, form, listed):
    s = rng.standard_normal((2, 4)) + 1j * rng.standard_normal((2, 4))
    f = np.linspace(1e9, 4e9, 4)
    angle = np.degrees(np.angle(s[1]))
    size = 20 * np.log10(np.abs(s[1])) if form == "DBANGLE" else np.abs(s[1])
    second = (s[1].real, s[1].imag) if form == "RI" else (size, angle)

    def block(columns):
        return "\n".join(f"{a!r},{b!r}" for a, b in zip(*(c.tolist() for c in columns), strict=True))

    segments = "SEG_LIST_BEGIN\nSEG 1000000000 4000000000 4\nSEG_LIST_END"
    values = "\n".join(["VAR_LIST_BEGIN", *map(str, f), "VAR_LIST_END"])
    text = CITI.format(points=4, form=form, axis=values if listed else segments, first=block((s[0].real, s[0].imag)),
                       second=block(second))  # fmt: skip
    (tmp_path / "raw.cti").write_text(text)
    spectra = read_contents(tmp_path / "raw.cti").spectra
    np.testing.assert_allclose(spectra.frequency, f)
    np.testing.assert_allclose(spectra.parameters["S11"], s[0])
    np.testing.assert_allclose(spectra.parameters["S21"], s[1], rtol=1e-12)


def test_a_citi_file_that_announces_more_than_it_holds_is_refused(tmp_path):
    text = CITI.format(
        points=10**17,
        form="RI",
        axis="SEG_LIST_BEGIN\nSEG 1 2 99999999999999999\nSEG_LIST_END",
        first="1,2",
        second="1,2",
    )
    (tmp_path / "raw.cti").write_text(text)
    refused(tmp_path / "raw.cti")


def by_library(path):
    """The same file by way of scikit-rf."""
    from skrf import Network

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return Network(str(path))


@ONE_FILE
@given(
    ports=st.integers(1, 5),
    form=st.sampled_from(["RI", "MA", "DB"]),
    unit=st.sampled_from(["Hz", "kHz", "MHz", "GHz"]),
    seed=st.integers(0, 10_000),
)
def test_touchstone_files_are_read_as_scikit_rf_reads_them(tmp_path, ports, form, unit, seed):
    rng = np.random.default_rng(seed)
    points = int(rng.integers(2, 7))
    s = rng.standard_normal((points, ports**2)) + 1j * rng.standard_normal((points, ports**2))
    f = np.linspace(1.0, 2.0, points)
    pairs = {
        "RI": (s.real, s.imag),
        "MA": (np.abs(s), np.degrees(np.angle(s))),
        "DB": (20 * np.log10(np.abs(s)), np.degrees(np.angle(s))),
    }[form]
    lines = ["! a comment", f"# {unit} S {form} R 50"]
    for n in range(points):
        words = [f"{f[n]:.12g}", *(f"{v:.15g}" for pair in zip(pairs[0][n], pairs[1][n], strict=True) for v in pair)]
        if ports > 2:  # wrapped, a row of the matrix in a line and four pairs at most, as the specification says
            rows = [words[1 + 2 * ports * i : 1 + 2 * ports * (i + 1)] for i in range(ports)]
            words = words[:1]
            for row in rows:
                words += [*row[:8], "\n", *row[8:], "\n"]
        lines.append(" ".join(words).strip() + "  ! remark")
    path = tmp_path / f"n.s{ports}p"
    path.write_text("\n".join(lines) + "\n")
    spectra, network = touchstone.read_spectra(path), by_library(path)
    np.testing.assert_allclose(spectra.frequency, network.f, rtol=1e-12)
    for i in range(ports):
        for j in range(ports):
            np.testing.assert_allclose(
                spectra.parameters[f"S{i + 1}{j + 1}"], network.s[:, i, j], rtol=1e-9, atol=1e-12
            )


def test_noise_data_after_a_two_port_are_passed_over(tmp_path):
    row = "0.1 0 0.2 0 0.3 0 0.4 0"
    text = f"# GHz S RI R 50\n1 {row}\n2 {row}\n! noise\n0.5 1 0.5 60 0.3\n1.5 1 0.5 60 0.3\n"
    (tmp_path / "amplifier.s2p").write_text(text)
    spectra = touchstone.read_spectra(tmp_path / "amplifier.s2p")
    np.testing.assert_allclose(spectra.frequency, [1e9, 2e9])
    np.testing.assert_allclose(spectra.parameters["S21"], 0.2)
    np.testing.assert_allclose(spectra.parameters["S12"], 0.3)


def test_falling_frequencies_and_a_row_that_is_cut_off_are_no_noise_data(tmp_path):
    rows = [f"{f} 0.1 0 0.2 0 0.3 0 0.4 0" for f in range(6, 0, -1)]  # as many numbers as five rows and noise data
    path = tmp_path / "run.s2p"
    path.write_text("# GHz S RI R 50\n" + "\n".join(rows))
    refused(path, "frequencies do not rise")
    path.write_text("# GHz S RI R 50\n" + "\n".join(rows[::-1])[: -len(" 0.3 0 0.4 0")])
    refused(path, "cut off")


VERSION_2 = """[Version] 2.0
# GHz S RI R 50
[Number of Ports] 2
[Two-Port Data Order] 12_21
[Number of Frequencies] 2
[Network Data]
1 0.1 0 0.2 0 0.3 0 0.4 0
2 0.1 0 0.2 0 0.3 0 0.4 0
[End]
"""


@pytest.mark.parametrize("name", ["new.ts", "new.s2p"])
def test_touchstone_version_2_goes_through_scikit_rf(tmp_path, name):
    (tmp_path / name).write_text(VERSION_2)
    spectra = touchstone.read_spectra(tmp_path / name)
    np.testing.assert_allclose(spectra.frequency, [1e9, 2e9])
    np.testing.assert_allclose(spectra.parameters["S12"], 0.2)  # in the order 12, 21
    np.testing.assert_allclose(spectra.parameters["S21"], 0.3)


def test_a_touchstone_file_of_many_announced_ports_is_refused(tmp_path):
    (tmp_path / "new.ts").write_text(VERSION_2.replace("Ports] 2", "Ports] 200000"))
    refused(tmp_path / "new.ts", "cut off")


def test_a_touchstone_file_says_the_line_of_its_mistake(tmp_path):
    (tmp_path / "bad.s1p").write_text("# Hz S RI R 50\n1e9 0.1 0.2\n2e9 0.l 0.2\n")
    refused(tmp_path / "bad.s1p", "line 3", "'0.l'")
    (tmp_path / "short.s2p").write_text("# Hz S RI R 50\n1e9 0.1 0.2\n")
    refused(tmp_path / "short.s2p", "cut off")
