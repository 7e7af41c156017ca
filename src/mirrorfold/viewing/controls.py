"""The settings that can be changed in the live page, and the control for each, derived from the declared settings."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, floor, log10
from typing import Any

from mirrorfold.common.settings import Rule
from mirrorfold.describing.settings import label
from mirrorfold.errors import InputError
from mirrorfold.folding import FoldSettings

KEPT = ("normalization",)
"""Settings of folding that the page cannot change. With another normalization, the initial picture would have to be
drawn anew, which stays in the page while mirrors are moved."""

CHANGEABLE: dict[str, Rule] = {
    name: rule for name, rule in FoldSettings.rules().items() if rule.option and name not in KEPT
}
"""Declaration of each setting for which the page has a control."""

TESTED = ("copies",)
"""Settings of tests that need the sweep."""

LEVEL_SPAN = 24.0
"""How far the slider of a level extends to both sides of the value that was used [dB]: a factor of 16 in amplitude."""

LARGEST_FACTOR = 6.0
"""Upper end of the slider of a positive number, in multiples of the value that was used."""

FINEST_STEP = 1e-11
"""Smallest step of a slider, and one over the largest; other values get a field to type in, as no measured quantity
needs such steps."""

SLIDER_STEPS = 150
"""Approximate number of steps of a slider, at most its width in pixels."""

MORE_COUNTS = 5
"""Number of counts to choose from beyond the smallest one."""


def controls(values: Mapping[str, Any], *, tested: bool = True) -> list[dict[str, Any]]:
    """Descriptions of the controls, one for each setting, from which the page draws them.

    Parameters
    ----------
    values : mapping
        The settings as they were used, by name.
    tested : bool, default True
        Whether a sweep is at hand that tests echoes. Without one, settings of `TESTED` change nothing.

    Returns
    -------
    list of dict
        `name`, `label`, `unit`, `meaning`, and `kind`: "switch"; "choice" among `choices`; "range", a slider with
        `lowest`, `highest` and `step`; or "number", a field to type in, where the value tells no useful ends of a
        slider. None among the choices, or an empty field, stands for the default. `works` is false where the setting
        changes nothing.
    """
    return [
        {
            "name": name,
            "label": label(name, rule),
            "unit": rule.unit,
            "meaning": rule.meaning,
            "works": tested or name not in TESTED,
            **_kind(name, values[name]),
        }
        for name, rule in CHANGEABLE.items()
    ]


def check_value(name: str, value: Any) -> None:
    """Refuse a setting that the page cannot change, and a value that the setting cannot have.

    Raises
    ------
    InputError
        The message tells the name of the setting, and what was expected.
    """
    if name not in CHANGEABLE:
        raise InputError(f"there is no setting {name!r}, expected one of {', '.join(CHANGEABLE)}")
    if value is not None or DEFAULTS[name] is not None:
        CHANGEABLE[name].check(name, value)


DEFAULTS = {name: getattr(FoldSettings(), name) for name in CHANGEABLE}
"""Default of each setting that can be changed; None where it is chosen from the image."""


def _kind(name: str, value: Any) -> dict[str, Any]:
    """The kind of the control of a setting, with the choices, or the ends and the step of a slider."""
    rule = CHANGEABLE[name]
    if rule.kind == "bool":
        return {"kind": "switch"}
    unset = [None] if DEFAULTS[name] is None else []
    if rule.choices:
        return {"kind": "choice", "choices": [*unset, *rule.choices]}
    if rule.kind == "int":
        smallest = int(rule.lowest or 0)
        counts = {*range(smallest, smallest + MORE_COUNTS + 1), *([] if value is None else [int(value)])}
        return {"kind": "choice", "choices": [*unset, *sorted(counts)]}
    if value is None or (rule.unit != "dB" and not value > 0.0):
        return {"kind": "number"}
    lowest, highest = (value - LEVEL_SPAN, value + LEVEL_SPAN) if rule.unit == "dB" else (0.0, LARGEST_FACTOR * value)
    lowest = lowest if rule.lowest is None else max(lowest, rule.lowest)
    highest = highest if rule.highest is None else min(highest, rule.highest)
    if not FINEST_STEP < (highest - lowest) / SLIDER_STEPS < 1.0 / FINEST_STEP:
        return {"kind": "number"}
    step = _round_step((highest - lowest) / SLIDER_STEPS)
    lowest, highest = (round(step * round(end / step), 12) for end in (lowest, highest))
    if rule.lowest is not None:
        lowest = max(lowest, round(step * ceil(rule.lowest / step), 12))
    if rule.above is not None:
        lowest = max(lowest, rule.above + step)
    if rule.below is not None:
        highest = min(highest, rule.below - step)
    return {"kind": "range", "lowest": lowest, "highest": highest, "step": step}


def _round_step(step: float) -> float:
    """The largest number of the form 1, 2 or 5 times a power of ten that does not exceed a step.

    Examples
    --------
    >>> _round_step(0.0123), _round_step(0.32)
    (0.01, 0.2)
    """
    power = floor(log10(step))
    factor = max(one for one in (1, 2, 5) if one <= step / 10.0**power + 1e-9)
    return float(f"{factor}e{power}")
