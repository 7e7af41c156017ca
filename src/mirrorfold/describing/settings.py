"""The settings that a reconstruction records in its attributes, in words for people.

Folding records its settings as attributes ``fold_NAME``, and the attributes of the focused image, where focusing
records its own, become ``image_NAME``. Units and meanings come from the declarations of the settings.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from mirrorfold.common.settings import Rule, Settings
from mirrorfold.focusing.settings import FocusSettings
from mirrorfold.folding.settings import FoldSettings

STEPS: tuple[tuple[str, str, type[Settings]], ...] = (
    ("focusing", "image_", FocusSettings),
    ("folding", "fold_", FoldSettings),
)
"""Name of each step, the prefix of its attributes, and its settings."""

DIGITS = 4
"""Significant digits of a number in a text; the attribute itself holds all of them."""

SCALES = {
    "m": (("m", 1.0), ("cm", 1e-2), ("mm", 1e-3), ("\u00b5m", 1e-6)),
    "Hz": (("GHz", 1e9), ("MHz", 1e6), ("kHz", 1e3), ("Hz", 1.0)),
}
"""Units in which lengths and frequencies are written, and their sizes."""

READ_DIGITS = {"m": 3, "Hz": 6}
"""Significant digits of lengths and of frequencies; frequencies are known exactly."""

ATTRIBUTES = {
    "m": re.compile(r"(range|resolution|aperture|radius|distance|position|center|radar_[xyz]|mixed_[xyz])$"),
    "Hz": re.compile(r"frequency_(start|stop|step)$"),
}
"""The unit of an attribute that is no setting, by the end of its name."""

LARGEST_PLAIN = 1e7
"""Numbers from this on are written with an exponent."""

LONGEST_ARRAY = 6
"""Largest number of values that are written out; of longer arrays only the length is written."""


class RecordedSetting(NamedTuple):
    """A setting with the value that was used, in words.

    Attributes
    ----------
    attr : str
        Name of the attribute that holds it.
    step : str
        "focusing" or "folding".
    label : str
        Its name in plain words.
    value : str
        The value as a text, with `DIGITS` digits; lengths and frequencies with `READ_DIGITS`.
    unit : str
        Such as "cm" or "dB"; empty for pure numbers and names.
    meaning : str
        A sentence or two.
    """

    attr: str
    step: str
    label: str
    value: str
    unit: str
    meaning: str


def recorded_settings(attrs: Mapping[Any, Any]) -> list[RecordedSetting]:
    """The settings among the attributes of a reconstruction, in the order of the steps and of their declaration.

    Parameters
    ----------
    attrs : mapping
        Attributes of a reconstruction; those that are no settings of this version are left out.

    Examples
    --------
    >>> (found,) = recorded_settings({"fold_wall_margin": 0.0403712, "fold_of_another_version": 1})
    >>> found.step, found.label, found.value, found.unit
    ('folding', 'wall margin', '4.04', 'cm')
    """
    return [
        RecordedSetting(
            attr=f"{prefix}{name}",
            step=step,
            label=label(name, rule),
            **_value_and_unit(attrs[f"{prefix}{name}"], rule),
            meaning=rule.meaning,
        )
        for step, prefix, settings in STEPS
        for name, rule in settings.rules().items()
        if f"{prefix}{name}" in attrs
    ]


def label(name: str, rule: Rule) -> str:
    """The name of a setting in plain words, without its unit.

    Examples
    --------
    >>> label("threshold_db", Rule("Level.")), label("opaque", Rule("Whether.", label="objects are opaque"))
    ('threshold', 'objects are opaque')
    """
    return rule.label or name.removesuffix("_db").replace("_", " ")


def words(value: Any, rule: Rule) -> str:
    """The value of a setting as a text for people; "default" where none was chosen.

    Examples
    --------
    >>> words(299792458.0, Rule("Speed of the waves.", unit="m/s")), words(1e-05, Rule("Error."))
    ('2.998e8', '1e-5')
    """
    if value is None:
        return "default"
    if isinstance(value, str):
        return value
    if np.ndim(value):
        values = np.ravel(value)
        if values.size > LONGEST_ARRAY:
            return f"{values.size} values"
        return ", ".join(words(one, rule) for one in values.tolist())
    if rule.kind == "bool" or isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | float | np.number):
        if 10.0**DIGITS <= abs(float(value)) < LARGEST_PLAIN:
            return f"{float(value):.0f}"
        return re.sub(r"e([+-])0*", lambda found: "e" + found[1].strip("+"), f"{float(value):.{DIGITS}g}")
    return str(value)


def attribute_words(name: str, value: Any) -> str:
    """The value of an attribute that is no setting as a text for people, with the unit that its name tells.

    Examples
    --------
    >>> attribute_words("image_frequency_stop", 3e11), attribute_words("image_range_resolution", 0.0149522)
    ('300 GHz', '1.5 cm')
    >>> attribute_words("image_radar_position", [1.1e-18, 0.0, -2.5]), attribute_words("threshold", 18602.03894723974)
    ('0, 0, -2.5 m', '18602')
    """
    unit = next((unit for unit, end in ATTRIBUTES.items() if end.search(name)), "")
    return " ".join(_value_and_unit(value, Rule("", unit=unit)).values()).strip()


def _value_and_unit(value: Any, rule: Rule) -> dict[str, str]:
    """A value as a text, and its unit; lengths and frequencies in a unit in which the largest one is at least 1."""
    numbers = np.ravel(value)
    if rule.unit not in SCALES or numbers.dtype.kind not in "iuf" or not 0 < numbers.size <= LONGEST_ARRAY:
        return {"value": words(value, rule), "unit": rule.unit}
    scales, digits = SCALES[rule.unit], READ_DIGITS[rule.unit]
    largest = float(np.abs(numbers).max())
    unit, size = next((one for one in scales if largest >= one[1]), scales[-1])
    # Less than a thousandth of the smallest unit is a rounding error of zero.
    texts = [f"{number / size:.{digits}g}" if abs(number) >= 1e-3 * scales[-1][1] else "0" for number in numbers]
    return {"value": ", ".join(texts), "unit": unit if set(texts) != {"0"} else ""}
