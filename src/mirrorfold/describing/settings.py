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
"""Name of each step, what its attributes begin with, and its settings."""

DIGITS = 4
"""Significant digits of a number that people read; the attribute itself holds all of them."""

LONGEST_ARRAY = 6
"""Values that are written out; of longer arrays only their number."""


class RecordedSetting(NamedTuple):
    """A setting as it was used.

    Attributes
    ----------
    attr : str
        Name of the attribute that holds it.
    step : str
        "focusing" or "folding".
    label : str
        Its name in plain words.
    value : str
        In words, with `DIGITS` digits.
    unit : str
        Such as "m" or "dB"; empty for pure numbers and names.
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
        Attributes of a reconstruction; those that are no setting of this version are left out.

    Examples
    --------
    >>> (found,) = recorded_settings({"fold_wall_margin": 0.0403712, "fold_of_another_version": 1})
    >>> found.step, found.label, found.value, found.unit
    ('folding', 'wall margin', '0.04037', 'm')
    """
    return [
        RecordedSetting(
            attr=f"{prefix}{name}",
            step=step,
            label=label(name, rule),
            value=words(attrs[f"{prefix}{name}"], rule),
            unit=rule.unit,
            meaning=rule.meaning,
        )
        for step, prefix, settings in STEPS
        for name, rule in settings.rules().items()
        if f"{prefix}{name}" in attrs
    ]


def label(name: str, rule: Rule) -> str:
    """The name of a setting in plain words; its unit is said elsewhere.

    Examples
    --------
    >>> label("threshold_db", Rule("Level.")), label("opaque", Rule("Whether.", label="objects are opaque"))
    ('threshold', 'objects are opaque')
    """
    return rule.label or name.removesuffix("_db").replace("_", " ")


def words(value: Any, rule: Rule) -> str:
    """A setting's value for people; "default" where none was chosen.

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
    if rule.kind == "bool":
        return "yes" if value else "no"
    if isinstance(value, int | float | np.number):
        return re.sub(r"e([+-])0*", lambda found: "e" + found[1].strip("+"), f"{float(value):.{DIGITS}g}")
    return str(value)
