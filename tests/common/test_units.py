"""Numbers with units: one table for options, scenes, mappings and tables of positions."""

from __future__ import annotations

import inspect
import math
import re

import pytest

import mirrorfold as mf
from mirrorfold.cli import main
from mirrorfold.cli.calibration import parse_gate, parse_place
from mirrorfold.cli.planning import parse_band, parse_roughness
from mirrorfold.cli.program import FUNCTIONS
from mirrorfold.cli.results import parse_axis
from mirrorfold.common.units import KINDS, parse_quantities, parse_quantity, unit_named
from mirrorfold.errors import InputError
from mirrorfold.io.mapping.model import Places, Values
from mirrorfold.io.scans.positions import Scan
from mirrorfold.scenes.floor_plan import parse_scene


@pytest.mark.parametrize("kind", [kind for kind in KINDS if KINDS[kind]])
def test_every_unit_is_read_in_every_spelling_and_gives_si(kind):
    for unit, factor in KINDS[kind].items():
        for text in (f"2.5{unit}", f"2.5 {unit}", f" 2.5  {unit} ", f"25e-1{unit}", f"2.5 {unit.lower()}"):
            assert parse_quantity(text, kind) == pytest.approx(2.5 * factor, rel=1e-15)
    assert parse_quantity("-2.5", kind) == -2.5


def test_a_full_turn_is_the_same_in_degrees_and_radians():
    assert parse_quantity(f"{2 * math.pi}rad", "angle") == pytest.approx(360.0)
    assert parse_quantity("1km", "length") == pytest.approx(parse_quantity("1e6 mm", "length"))
    assert unit_named("in") == "inch"


@pytest.mark.parametrize(
    ("names", "unit"),
    [
        ("millimeter millimetre millimeters Millimetres", "mm"),
        ("centimeter centimetre centimeters CENTIMETRES", "cm"),
        ("micrometers", "um"),
        ("gigahertz GigaHertz", "GHz"),
        ("megahertz Megahertz", "MHz"),
        ("Hertz", "Hz"),
        ("nanosecond nanoseconds", "ns"),
        ("foot feet", "ft"),
    ],
)
def test_units_may_be_written_out(names, unit):
    assert {unit_named(name) for name in names.split()} == {unit}


@pytest.mark.parametrize("text", ["300 GHz", "3 parsec", "wall", "", "1e", "nan", "inf", "1 2 m", "0x3 m"])
def test_what_is_no_length_is_refused_in_one_sentence(text):
    with pytest.raises(mf.InputError, match="is no length, expected a number") as refused:
        parse_quantity(text, "length")
    assert "\n" not in str(refused.value)


def test_all_numbers_of_a_row_have_units_or_none_has():
    assert parse_quantities("0:2m:5mm", "length") == [0.0, 2.0, 0.005]
    with pytest.raises(mf.InputError, match="give each its unit"):
        parse_quantities("270:300GHz", "frequency")


def test_options_of_several_numbers_take_units():
    assert parse_band("270GHz:0.3THz") == parse_band("270e9:300e9")
    assert parse_roughness("0.05mm,200um") == pytest.approx(parse_roughness("50,200"))
    assert parse_place("-1cm,1.5m,0", "sphere-at") == (-0.01, 1.5, 0.0)
    with pytest.raises(InputError, match=r"^--sphere-at is '0,9e9', farther away than 1e\+07 m"):
        parse_place("0,9e9", "sphere-at")
    assert parse_gate("30cm:") == (0.3, None)
    assert parse_gate(":4m") == (None, 4.0)
    assert parse_axis("-2m:2m:5mm", "x").tolist() == parse_axis("-2:2:0.005", "x").tolist()
    assert parse_axis("15cm", "x").tolist() == [0.15]


def test_every_option_that_is_a_length_frequency_or_time_takes_units():
    """The unit that the help of an option names in brackets decides what it reads."""
    kinds = {"m": "length", "Hz": "frequency", "s": "time", "degree": "angle", "m/s": "speed"}
    checked = []
    for function in FUNCTIONS:
        text = inspect.getdoc(function) or ""
        for name, parameter in inspect.signature(function).parameters.items():
            meaning = re.search(rf"^{name}\n((?:    .*\n?)+)", text, re.MULTILINE)
            units = re.findall(r"\[(m|Hz|s|degree|m/s)\]", meaning[1] if meaning else "")
            if not units or "str" in str(parameter.annotation) or "Numbers" in str(parameter.annotation):
                continue  # several numbers in one text are tested above
            assert f"Quantity(kind='{kinds[units[0]]}')" in str(parameter.annotation), f"{function.__name__} {name}"
            checked.append(name)
    assert {"aperture", "pitch", "settling", "cable_length", "sphere_radius", "minimum_length", "wave_speed"} <= {
        *checked
    }


def test_the_plan_is_the_same_with_and_without_units(capsys):
    plain = ["--band", "270e9:300e9", "--aperture", "0.08", "--pitch", "0.5e-3", "--range", "4", "--settling", "5e-5"]
    said = ["--band", "270GHz:300GHz", "--aperture", "80mm", "--pitch", "0.5mm", "--range", "400cm"]
    printed = []
    for options in (plain, [*said, "--settling", "50us"]):
        assert main(["plan", "--points", "401", *options, "--json"]) == 0
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1]
    assert main(["plan", "--points", "401", *said[:2], "--aperture", "80GHz", *said[4:]]) == 2
    assert "--aperture: '80GHz' is no length" in capsys.readouterr().err


def test_a_scene_may_name_its_units():
    content = {
        "name": "units",
        "array": {"elements": 5, "pitch": 0.5e-3, "center": [0.01, 0.0]},
        "band": {"start": 290e9, "stop": 300e9, "points": 3},
        "surface": [{"name": "a", "kind": "arc", "center": [0.0, 1.0], "radius": 0.08, "start_angle": 0.0,
                     "stop_angle": 90.0, "roughness": {"rms_height": 5e-5, "correlation_length": 2e-4}}],
    }  # fmt: skip
    said = {
        "name": "units",
        "array": {"elements": 5, "pitch": "0.5 mm", "center": ["1cm", 0.0]},
        "band": {"start": "290 GHz", "stop": "0.3THz", "points": 3},
        "surface": [{"name": "a", "kind": "arc", "center": [0.0, "1 m"], "radius": "8 cm", "start_angle": 0.0,
                     "stop_angle": "90 deg", "roughness": {"rms_height": "50um", "correlation_length": "0.2 mm"}}],
    }  # fmt: skip
    assert parse_scene(said) == parse_scene(content)
    with pytest.raises(mf.InputError, match=r"array.pitch: '3 GHz' is no length"):
        parse_scene(said | {"array": {"elements": 5, "pitch": "3 GHz"}})


@pytest.mark.parametrize(
    ("part", "place"),
    [
        ({"band": {"start": 290e9, "stop": "300 GHz", "points": 3}}, "band"),
        ({"array": {"elements": 5, "pitch": "0.5 mm", "center": ["1cm", "2"]}}, "array.center"),
    ],
)
def test_numbers_of_one_place_in_a_scene_all_have_units_or_none(part, place):
    content = {
        "name": "units", "array": {"elements": 5, "pitch": 0.5e-3},
        "band": {"start": 290e9, "stop": 300e9, "points": 3},
        "surface": [{"name": "a", "kind": "segment", "start": [0.0, 1.0], "end": [0.5, 1.0]}],
    }  # fmt: skip
    with pytest.raises(mf.InputError, match=rf"{place}.*: .* gives some numbers a unit and others none"):
        parse_scene(content | part)


def test_a_mapping_and_a_description_of_positions_may_name_their_units():
    row = Values(start="270 GHz", step="0.5GHz", points=3)
    assert (row.start, row.step, row.unit) == (270e9, 0.5e9, "Hz")
    places = Places(position=[["1cm", "2 mm", 0.0]])
    assert places.position == [[0.01, 0.002, 0.0]]
    assert Places(position=[[1.0, 2.0, 0.0]], unit="MM").unit == "mm"
    with pytest.raises(ValueError, match="give each its unit"):
        Values(start="270 GHz", stop=300.0, points=3)
    with pytest.raises(ValueError, match="give each its unit"):
        Values(start="-12 mm", step="1.2", points=3)
    scan = Scan(file=[{"file": "a.s1p", "position": ["5 mm", "0 mm", "1 cm"]}], scene_center=["1m", 0.0, 0.0])
    assert (scan.file[0].position, scan.file[0].unit, scan.scene_center) == ([0.005, 0.0, 0.01], "m", (1.0, 0.0, 0.0))
