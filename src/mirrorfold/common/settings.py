"""Settings: what can be chosen about a step, declared once.

A frozen dataclass lists the settings of a step; each field states its default, unit, meaning and range. The functions'
signatures and docstrings, the options of the command line and their help, the checks, and the attributes of files all
follow from it.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from textwrap import fill, indent
from typing import Any, TypeVar, get_type_hints

import numpy as np

from mirrorfold.errors import InputError

Function = TypeVar("Function", bound=Callable[..., Any])

LINE_WIDTH = 110
"""Of the generated docstrings."""


@dataclass(frozen=True)
class Rule:
    """What is known of one setting.

    Attributes
    ----------
    meaning : str
        A sentence or two, without the unit.
    unit : str
        Such as "m" or "dB"; empty for pure numbers and names.
    kind : str
        How a docstring names its type, such as "float".
    choices : tuple of str
        The names that it may have; empty for numbers.
    lowest, above : float, optional
        Bounds of a number: not below `lowest`, strictly above `above`.
    whole : bool
        Whether the number must be whole.
    option : bool
        Whether the command line offers it.
    """

    meaning: str
    unit: str = ""
    kind: str = ""
    choices: tuple[str, ...] = ()
    lowest: float | None = None
    above: float | None = None
    whole: bool = False
    option: bool = True

    def check(self, name: str, value: Any) -> None:
        """Refuse a value that the setting cannot have.

        Raises
        ------
        InputError
            With the name, the value, and what was expected.
        """
        if self.choices:
            if value not in self.choices:
                raise InputError(f"{name} is {value!r}, expected one of {', '.join(self.choices)}")
            return
        if self.kind == "bool":
            if not isinstance(value, bool | np.bool_):
                raise InputError(f"{name} is {value!r}, expected True or False")
            return
        if not self.kind.startswith(("float", "int")):
            return  # checked where it is used
        number = isinstance(value, int | float | np.integer | np.floating) and not isinstance(value, bool)
        if (
            not number
            or not np.isfinite(value)
            or (self.lowest is not None and value < self.lowest)
            or (self.above is not None and value <= self.above)
            or (self.whole and int(value) != value)
        ):
            raise InputError(f"{name} is {value!r}, expected {self.expected()}; leave it out for the default")

    def expected(self) -> str:
        """What the setting may be, in words."""
        what = "a whole number" if self.whole else "a finite number"
        if self.unit:
            what += f" [{self.unit}]"
        if self.above is not None:
            return f"{what} above {self.above:g}"
        return what if self.lowest is None else f"{what} of at least {self.lowest:g}"


def setting(default: Any, meaning: str, **rule: Any) -> Any:
    """A field of a `Settings` dataclass; `rule` holds the other attributes of a `Rule`."""
    return field(default=default, metadata={"rule": Rule(meaning, **rule)})


@dataclass(frozen=True)
class Settings:
    """Base of all settings. None stands for what is chosen from the data."""

    def __post_init__(self) -> None:
        for name, rule in self.rules().items():
            value = getattr(self, name)
            if value is not None:
                rule.check(name, value)

    @classmethod
    def rules(cls) -> dict[str, Rule]:
        """What is known of every setting, by name."""
        return {item.name: item.metadata["rule"] for item in fields(cls) if "rule" in item.metadata}


def takes(
    *settings: type[Settings], without: tuple[str, ...] = (), options: bool = False
) -> Callable[[Function], Function]:
    """Declare that the keywords of a function are settings: completes its signature and its docstring.

    Parameters
    ----------
    *settings : type
        Subclasses of `Settings`. Where two of them have a name in common, the last one counts.
    without : tuple of str
        Settings that the function does not take.
    options : bool
        Whether the function is a verb of the command line, which takes what `Rule.option` allows, and whose help wants
        the unit in the text.

    Returns
    -------
    callable
        A decorator of a function that ends in ``**given``. The place of the settings in its docstring is the line
        ``**given``. Settings that are not given reach the function as if they had not been named.
    """
    rules: dict[str, Rule] = {}
    types: dict[str, Any] = {}
    for kind in settings:
        hints = get_type_hints(kind)
        for name, rule in kind.rules().items():
            if name not in without and (rule.option or not options):
                rules[name], types[name] = rule, hints[name]

    def decorate(function: Function) -> Function:
        own = inspect.signature(function)
        named = [p for p in own.parameters.values() if p.kind is not p.VAR_KEYWORD]
        added = [
            inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=None, annotation=types[name] | None)
            for name in rules
        ]
        signature = own.replace(parameters=[*named, *added])

        @functools.wraps(function)
        def wrapper(*args: Any, **kwargs: Any) -> Any:
            bound = signature.bind(*args, **kwargs)
            chosen = {name: value for name, value in bound.arguments.items() if name not in rules or value is not None}
            bound.arguments.clear()
            bound.arguments.update(chosen)
            return function(*bound.args, **bound.kwargs)

        wrapper.__signature__ = signature  # type: ignore[attr-defined]
        wrapper.__annotations__ = {**function.__annotations__, **{p.name: p.annotation for p in added}}
        wrapper.__annotations__.pop("given", None)
        wrapper.__doc__ = _completed(function.__doc__ or "", rules, options)
        return wrapper  # type: ignore[return-value]

    return decorate


def _completed(text: str, rules: dict[str, Rule], options: bool) -> str:
    """A docstring with the settings in the place of the line ``**given``."""
    lines = inspect.cleandoc(text).splitlines()
    if "**given" not in lines:
        return text
    entries: list[str] = []
    for name, rule in rules.items():
        unit = f" [{rule.unit}]" if rule.unit else ""
        if options:
            entries += [name, _paragraph(rule.meaning.rstrip(".") + unit + ".")]
        else:
            kind = "{" + ", ".join(f'"{choice}"' for choice in rule.choices) + "}" if rule.choices else rule.kind
            entries += [f"{name} : {kind}{unit}, optional", _paragraph(rule.meaning)]
    at = lines.index("**given")
    return "\n".join([*lines[:at], *entries, *lines[at + 1 :]])


def _paragraph(text: str) -> str:
    return indent(fill(text, LINE_WIDTH), "    ")
