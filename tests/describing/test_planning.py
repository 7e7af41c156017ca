"""A plan says what the textbook says, warns of what goes wrong, and draws."""

from __future__ import annotations

import json

import numpy as np
import pytest
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.describing.planning import Instrument
from mirrorfold.describing.walls import shares

BASE = {"band": (270e9, 300e9), "points": 1001, "aperture": 0.08, "pitch": 0.5e-3, "range": 3.0}
ARGUMENTS = [
    "plan",
    "--band",
    "270e9:300e9",
    "--points",
    "401",
    "--aperture",
    "0.08",
    "--pitch",
    "0.5e-3",
    "--range",
    "4",
]


def test_resolution_ambiguity_and_data():
    found = mf.plan(**BASE)
    assert found["ambiguous_range_m"] == pytest.approx(speed_of_light / (2 * 30e6))
    assert found["range_resolution_m"] == pytest.approx(speed_of_light / (2 * 30e6 * 1001))
    assert found["cross_range_resolution_m"]["3"] == pytest.approx(speed_of_light / 285e9 * 3.0 / 0.08)
    assert found["samples"] == 161 * 161 * 1001
    assert found["data_megabytes"] == pytest.approx(161 * 161 * 1001 * 8e-6)
    assert found["measuring_s"] == pytest.approx(found["samples"] * 1.5e-4)
    json.dumps(found, allow_nan=False)
    moved = mf.plan(**BASE, instrument=Instrument(moving=0.5))
    assert moved["measuring_s"] - found["measuring_s"] == pytest.approx(0.5 * (161 * 161 - 1))


def test_walls_are_those_of_the_recommendation():
    """Half-spaces at 285 GHz: levels at normal incidence, and for TE and TM at 45 degrees."""
    for name, expected in (
        ("concrete", (-8.2, -5.9, -11.8)),
        ("plasterboard", (-12.7, -9.3, -18.7)),
        ("glass", (-7.7, -5.5, -11.0)),
    ):
        specular, diffuse = shares(name, np.array(285e9), np.radians([0.0, 45.0]), (0.0, None))
        levels = 10 * np.log10([specular[0, 0], specular[0, 1], specular[1, 1]])
        np.testing.assert_allclose(levels, expected, atol=0.06)
        assert not diffuse.any()


def test_roughness_moves_power_from_the_mirror_to_all_directions():
    angle = np.radians(np.linspace(0, 85, 18))
    for correlation in (None, 0.2e-3):
        smooth, _ = shares("plasterboard", np.array(285e9), angle, (0.0, None))
        specular, diffuse = shares("plasterboard", np.array(285e9), angle, (50e-6, correlation))
        np.testing.assert_allclose(specular + diffuse, smooth)
        assert (specular < smooth).all()
    rough, _ = shares("plasterboard", np.array(285e9), np.array(0.0), (50e-6, None))
    smooth, _ = shares("plasterboard", np.array(285e9), np.array(0.0), (0.0, None))
    phase = 4 * np.pi * 50e-6 * 285e9 / speed_of_light
    assert rough[0] / smooth[0] == pytest.approx(np.exp(-(phase**2)))


def test_the_link_budget_is_the_radar_equation():
    found = mf.plan(**BASE, instrument=Instrument(power_dbm=10, gain_dbi=25, noise_figure_db=10, if_bandwidth=1e3))
    wavelength = speed_of_light / 285e9
    received = 1e-2 * 10**5 * wavelength**2 * 1e-3 / ((4 * np.pi) ** 3 * 3.0**4)
    noise = 1.380649e-23 * 290 * 1e3 * 10
    first, second = found["link_budget"][:2]
    assert first["sample_snr_db"] == pytest.approx(10 * np.log10(received / noise), abs=1e-6)
    assert first["snr_db"] - first["sample_snr_db"] == pytest.approx(10 * np.log10(161 * 161 * 1001))
    loss = 2 * found["walls"]["plasterboard"]["specular_te_db"][3] - 40 * np.log10(4.5 / 3.0)
    assert second["snr_db"] - first["snr_db"] == pytest.approx(loss)


def test_better_mirrors_and_more_power_show_more_bounces():
    plain = mf.plan(**BASE)["bounces_above_noise"]
    assert mf.plan(**BASE, materials=["pec"])["bounces_above_noise"] > plain
    assert mf.plan(**BASE, instrument=Instrument(power_dbm=40))["bounces_above_noise"] > plain
    assert mf.plan(**BASE, roughness=(150e-6, None))["bounces_above_noise"] < plain


@pytest.mark.slow
def test_what_will_go_wrong_is_remarked():
    assert any("measure at least 602 frequencies" in r for r in mf.plan(**BASE | {"points": 401})["remarks"])
    assert mf.plan(**BASE | {"points": 603})["bounces_unambiguous"] == 0
    assert any("wrap around" in remark for remark in mf.plan(**BASE | {"points": 700})["remarks"])
    assert any("grating lobes" in remark for remark in mf.plan(**BASE | {"pitch": 2e-3})["remarks"])
    assert not mf.plan(**BASE, rx_pitch=2e-3, materials=["concrete"], target=1e-6)["remarks"][1:]
    assert any("smooth" in remark for remark in mf.plan(**BASE, roughness=(0.0, None))["remarks"])
    far = mf.plan(**BASE | {"band": (890e9, 900e9)}, materials=["pec", "glass"])["remarks"]
    assert [remark for remark in far if "extrapolated" in remark] == [
        "The fit of glass holds from 1 to 450 GHz; what is said of it here is extrapolated."
    ]
    assert any("Not even" in r for r in mf.plan(**BASE, instrument=Instrument(power_dbm=-150))["remarks"])


@pytest.mark.parametrize(("points", "told"), [(1001, True), (100_000, False)])
def test_a_range_in_millimetres_is_remarked(points, told):
    """Where the frequency steps tell ranges of hundreds of metres, a range of a kilometre may be meant."""
    remarks = mf.plan(**BASE | {"range": 900.0, "points": points, "aperture": 0.002})["remarks"]
    assert any("the room, 900 m, perhaps 900 mm were meant; measure at least" in one for one in remarks) == told


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"band": (300e9, 270e9)}, "rising frequencies"),
        ({"points": 1}, "points"),
        ({"points": 10**9}, "points"),
        ({"aperture": -1.0}, "aperture"),
        ({"pitch": 1e-7}, "pitches"),
        ({"pitch": 1.0}, "pitch"),
        ({"range": float("nan")}, "range"),
        ({"materials": ["cheese"]}, "cheese"),
        ({"roughness": (-1.0, None)}, "roughness"),
        ({"leg": -1.0}, "leg"),
        ({"materials": []}, "materials"),
    ],
)
def test_what_makes_no_sense_is_refused(change, words):
    with pytest.raises(mf.InputError, match=words):
        mf.plan(**BASE | change)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_numbers_that_no_measurement_has_are_refused(sign):
    """They overflowed, or made a budget of infinities."""
    for name in ("power_dbm", "gain_dbi", "noise_figure_db"):
        mf.plan(**BASE, instrument=Instrument(**{name: sign * 200.0}))
        with pytest.raises(mf.InputError, match=rf"{name} is .*, expected a number of decibels from -200 to 200"):
            Instrument(**{name: sign * 4000.0})
    for name in ("range", "aperture", "pitch", "rx_aperture", "rx_pitch", "target", "leg"):
        with pytest.raises(mf.InputError, match=f"{name} is "):
            mf.plan(**BASE | {name: sign * 1e308})
    for name in ("if_bandwidth", "settling", "moving"):
        with pytest.raises(mf.InputError, match=f"{name} is "):
            Instrument(**{name: sign * 1e300})
    for roughness in ((sign * 1e308, None), (0.0, sign * 1e308)):
        with pytest.raises(mf.InputError, match="of the roughness is "):
            mf.plan(**BASE, roughness=roughness)


@pytest.mark.parametrize(
    "change",
    [{"range": 1e-9}, {"range": 1e7}, {"target": 1e-20}, {"target": 1e20}, {"leg": 1e7}, {"roughness": (1e7, 1e-12)},
     {"detection_db": -200.0}, {"roughness": (1e7, None)}, {"roughness": (0.0, 1e7)}],
)  # fmt: skip
def test_numbers_at_the_limits_are_planned(change):
    mf.plan(**BASE | change)


@pytest.mark.slow
def test_the_verb_prints_and_draws(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main([*ARGUMENTS, "--roughness", "50,200", "--material", "concrete", "-o", "plan.png"]) == 0
    assert "concrete" in capsys.readouterr().out
    assert (tmp_path / "plan.png").read_bytes().startswith(b"\x89PNG")
    assert main([*ARGUMENTS, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["ambiguous_range_m"] == pytest.approx(1.99862, rel=1e-4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (["--band", "270e9"], "START:STOP"),
        (["--roughness", "a"], "--roughness"),
        (["-o", "plan.txt"], "expected .png"),
        (["-o", "nowhere/plan.png"], "does not exist"),
        (["--if-bandwidth", "0"], "if_bandwidth"),
    ],
)
def test_wrong_arguments_are_one_sentence(tmp_path, monkeypatch, capsys, change, words):
    monkeypatch.chdir(tmp_path)
    given = dict(zip(ARGUMENTS[1::2], ARGUMENTS[2::2], strict=True)) | dict([change])
    assert main(["plan", *(part for pair in given.items() for part in pair)]) == 2
    printed = capsys.readouterr()
    assert words in printed.err
    assert printed.err.count("\n") == 1
    assert not list(tmp_path.iterdir())
