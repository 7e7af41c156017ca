"""The controls of the live page: they are the declared settings of folding, with limits that folding accepts."""

from __future__ import annotations

import pytest

from mirrorfold.errors import InputError
from mirrorfold.folding import FoldSettings
from mirrorfold.viewing.controls import CHANGEABLE, KEPT, check_value, controls
from mirrorfold.viewing.held import held_settings

USED = {
    name: {"bool": True}.get(
        rule.kind, None if rule.kind == "int" or rule.choices else -18.0 if rule.unit == "dB" else 0.04
    )
    for name, rule in CHANGEABLE.items()
}
"""A number for every setting that has no other default, as folding records it."""


def test_every_option_of_folding_has_a_control_with_its_unit_and_its_meaning():
    rules = FoldSettings.rules()
    shown = {control["name"]: control for control in controls(USED)}
    assert set(shown) == {name for name, rule in rules.items() if rule.option} - set(KEPT)
    for name, control in shown.items():
        assert control["unit"] == rules[name].unit
        assert control["meaning"] == rules[name].meaning
        assert "_" not in control["label"]


@pytest.mark.parametrize("scale", [1e-3, 0.7, 1.0, 40.0])
def test_a_slider_reaches_around_the_value_and_no_further_than_the_setting_allows(scale):
    values = {name: value * scale if isinstance(value, float) else value for name, value in USED.items()}
    values["min_confidence"] = min(values["min_confidence"], 1.0)
    values["threshold_db"] = max(values["threshold_db"], -290.0)
    sliders = [control for control in controls(values) if control["kind"] == "range"]
    assert {"threshold_db", "minimum_length", "wall_margin"} <= {slider["name"] for slider in sliders}
    for slider in sliders:
        assert slider["lowest"] <= values[slider["name"]] <= slider["highest"]
        assert 100 <= (slider["highest"] - slider["lowest"]) / slider["step"] <= 400
        for end in (slider["lowest"], slider["highest"]):
            check_value(slider["name"], end)


def test_a_value_that_gives_no_scale_is_typed_in():
    shown = {control["name"]: control for control in controls({**USED, "wall_margin": 0.0, "threshold_db": None})}
    assert shown["wall_margin"]["kind"] == "number"
    assert shown["threshold_db"]["kind"] == "number"


@pytest.mark.parametrize("value", [5e-324, 1e-13, 1e300])
def test_a_value_that_no_slider_could_follow_is_typed_in(value):
    shown = {control["name"]: control for control in controls({**USED, "minimum_length": value})}
    assert shown["minimum_length"]["kind"] == "number"
    assert shown["threshold_db"]["kind"] == "range"


def test_a_count_is_chosen_among_the_default_small_ones_and_its_own():
    shown = {control["name"]: control for control in controls({**USED, "generations": 9})}
    assert shown["generations"]["choices"] == [None, 0, 1, 2, 3, 4, 5, 9]


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("wall_margin", -0.1, "wall_margin is -0.1"),
        ("wall_margin", True, "wall_margin is True"),
        ("generations", 1.5, "generations is 1.5"),
        ("generations", 10**300, "expected a whole number of at least 0 and up to 1000"),
        ("normalization", "r", "no setting 'normalization'"),
        ("secret", 1, "no setting 'secret'"),
    ],
)
def test_what_a_setting_cannot_be_is_refused(name, value, words):
    with pytest.raises(InputError, match=words):
        check_value(name, value)


def test_the_default_can_be_asked_for_where_the_image_decides():
    check_value("minimum_length", None)


def test_what_a_file_of_another_version_records_is_used_as_far_as_it_is_known():
    attrs = {"fold_threshold_db": -20.0, "fold_normalization": "default", "fold_wall_margin": "wide", "fold_size": 3}
    held = held_settings(attrs, FoldSettings(wall_margin=0.02))
    assert held["threshold_db"] == -20.0
    assert held["normalization"] is None
    assert held["wall_margin"] == 0.02
    assert held["minimum_length"] is None
    assert set(held) == set(FoldSettings.rules())
