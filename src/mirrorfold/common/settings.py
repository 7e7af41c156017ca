"""Settings: everything that a user can choose about a step, declared once.

A frozen dataclass lists the settings of a step; each field states its default, unit, meaning and range. The functions'
signatures and docstrings, the options of the command line and their help, the checks, and the attributes of files all
follow from it.
"""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import MISSING, Field, dataclass, field, fields, replace
from textwrap import fill, indent
from typing import Any, Literal, Self, TypeVar

from mirrorfold.common.arguments import finite, in_message, is_boolean, one_of
from mirrorfold.common.units import QUANTITIES
from mirrorfold.errors import InputError

Function = TypeVar("Function", bound=Callable[..., Any])

LINE_WIDTH = 110
"""Width of lines in the generated docstrings [characters]."""

OPTION_TYPES = {"bool": bool, "int": int, "float": float}
"""The type that the command line reads for a setting of each kind; other kinds are read as text. A number whose unit is
in `QUANTITIES` may be given in another unit, too."""


@dataclass(frozen=True)
class Rule:
    """Meaning, type and bounds of one setting.

    Attributes
    ----------
    meaning : str
        A sentence or two, without the unit.
    unit : str
        Such as "m" or "dB"; empty for pure numbers and names.
    kind : str
        How a docstring names its type; by default that of the field if it is float, int or bool. These three are
        checked here; any other, such as "1D array", is checked where the step uses the value, because only there its
        size is known.
    choices : tuple of str
        The names that it may have; empty for numbers.
    lowest, highest, above, below : float, optional
        Bounds of a number: from `lowest` to `highest`, strictly above `above`, strictly below `below`.
    option : bool
        Whether the command line offers it.
    label : str
        Name of the setting on pages, if its own name would not be understood there.
    """

    meaning: str
    unit: str = ""
    kind: str = ""
    choices: tuple[str, ...] = ()
    lowest: float | None = None
    highest: float | None = None
    above: float | None = None
    below: float | None = None
    option: bool = True
    label: str = ""

    def check(self, name: str, value: Any) -> None:
        """Refuse a value that the setting cannot have.

        Raises
        ------
        InputError
            With the name, the value, and what was expected.
        """
        if self.choices:
            one_of(name, value, self.choices)
        elif self.kind == "bool":
            if not is_boolean(value):
                raise InputError(f"{name} is {in_message(value)}, expected True or False")
        elif self.kind.startswith(("float", "int")) and not self._holds(value):
            raise InputError(f"{name} is {in_message(value)}, expected {self.expected()}; leave it out for the default")

    def _holds(self, value: Any) -> bool:
        """Whether a value is a number within the bounds."""
        number = finite(value)
        return (
            number is not None
            and (self.lowest is None or number >= self.lowest)
            and (self.highest is None or number <= self.highest)
            and (self.above is None or number > self.above)
            and (self.below is None or number < self.below)
            and (self.kind != "int" or number.is_integer())
        )

    def expected(self) -> str:
        """The values that the setting may have, in words."""
        what = "a whole number" if self.kind == "int" else "a finite number"
        if self.unit:
            what += f" [{self.unit}]"
        bounds = [
            f"{words} {bound:g}"
            for words, bound in (
                ("of at least", self.lowest),
                ("up to", self.highest),
                ("above", self.above),
                ("below", self.below),
            )
            if bound is not None
        ]
        return " ".join([what, " and ".join(bounds)]).rstrip()


def setting(default: Any, meaning: str, **rule: Any) -> Any:
    """A field of a `Settings` dataclass; `rule` holds the other attributes of a `Rule`."""
    return field(default=default, metadata={"rule": Rule(meaning, **rule)})


def _kind_of(annotation: Any) -> str:
    """The kind of a setting by the type of its field, of which None may be an alternative."""
    name = str(getattr(annotation, "__name__", annotation)).split()[0]
    return name if name in OPTION_TYPES else ""


REQUIRED = MISSING
"""Takes the place of a default for a setting that must be given."""

NUMBERS: dict[str, Callable[[Any], float]] = {"int": int, "float": float}
"""The type to which numbers are converted, by the kind of the setting."""


@dataclass(frozen=True, eq=False)
class Settings:
    """Base of all settings. A setting that is None is chosen from the data.

    Settings that may hold arrays are declared with ``eq=False``: arrays are not equal as a whole.

    Examples
    --------
    >>> from dataclasses import dataclass
    >>> @dataclass(frozen=True)
    ... class Smoothing(Settings):
    ...     width: float = setting(0.5, "Width of the window.", unit="m", above=0.0)
    >>> @takes(Smoothing)
    ... def smooth(image, **given):
    ...     return Smoothing().with_given(**given)
    >>> smooth(None, width=2.0)
    Smoothing(width=2.0)
    >>> smooth(None, width=-1.0)
    Traceback (most recent call last):
    mirrorfold.errors.InputError: width is -1.0, expected a finite number [m] above 0; leave it out for the default
    """

    def __post_init__(self) -> None:
        for name, rule in self.rules().items():
            value = getattr(self, name)
            if value is not None:
                rule.check(name, value)
                if rule.kind in NUMBERS:
                    object.__setattr__(self, name, NUMBERS[rule.kind](value))

    @classmethod
    def rules(cls) -> dict[str, Rule]:
        """The rule of every setting, by name."""
        found = {item: item.metadata["rule"] for item in fields(cls) if "rule" in item.metadata}
        return {item.name: replace(rule, kind=rule.kind or _kind_of(item.type)) for item, rule in found.items()}

    @classmethod
    def is_optional(cls, name: str) -> bool:
        """Whether a setting may be None, and is then chosen from the data."""
        return next(item.default for item in fields(cls) if item.name == name) is None

    def with_given(self, **given: Any) -> Self:
        """The same settings, but for those that are given (not None).

        Raises
        ------
        InputError
            If one of them cannot be used.
        """
        return replace(self, **{name: value for name, value in given.items() if value is not None})


def takes(
    *settings: type[Settings], without: tuple[str, ...] = (), options: bool = False
) -> Callable[[Function], Function]:
    """Declare that a function takes settings as keywords: its signature and its docstring are completed.

    Parameters
    ----------
    *settings : type
        Subclasses of `Settings`. If two of them have a setting of the same name, that of the last one counts.
    without : tuple of str
        Settings that the function does not take.
    options : bool
        Whether the function is a verb of the command line. It then takes only settings that `Rule.option` allows, and
        the text of each setting contains the unit.

    Returns
    -------
    callable
        A decorator for a function, or for a class whose ``__init__``, ends in ``**given``. In its docstring, the
        settings replace the line ``**given``. A setting that is also a parameter of the function keeps its own type and
        text. Settings that are not given, or are None, are not passed on to the function.
    """
    declared: dict[str, Field[Any]] = {}
    rules: dict[str, Rule] = {}
    for kind in settings:
        declared |= {item.name: item for item in fields(kind) if item.name in kind.rules()}
        rules |= kind.rules()
    rules = {name: rule for name, rule in rules.items() if name not in without and (rule.option or not options)}

    def decorate(target: Function) -> Function:
        if isinstance(target, type):
            target.__init__ = decorate(target.__init__)  # type: ignore[misc]
            added = {name: rules[name] for name in inspect.signature(target).parameters if name in rules}
            target.__doc__ = _completed(target.__doc__ or "", added, declared, options)
            return target
        return _decorated(target, rules, declared, options)

    return decorate


def _decorated(function: Function, rules: dict[str, Rule], declared: dict[str, Field[Any]], options: bool) -> Function:
    """The function with the settings in its signature and its docstring."""
    own = inspect.signature(function)
    named = [p for p in own.parameters.values() if p.kind is not p.VAR_KEYWORD]
    rules = {name: rule for name, rule in rules.items() if name not in own.parameters}
    added = [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            default=inspect.Parameter.empty if declared[name].default is REQUIRED else declared[name].default,
            annotation=_option_type(rule, declared[name].default) if options else declared[name].type,
        )
        for name, rule in rules.items()
    ]
    parameters = sorted([*named, *added], key=lambda one: (one.kind, one.default is not one.empty))
    signature = own.replace(parameters=parameters)

    @functools.wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        try:
            bound = signature.bind(*args, **kwargs)
        except TypeError as error:  # as Python's own error, with the name of the function
            raise TypeError(f"{function.__qualname__}() {error}") from None
        chosen = {
            name: value
            for name, value in bound.arguments.items()
            if value is not None or name not in rules or declared[name].default is REQUIRED
        }
        bound.arguments.clear()
        bound.arguments.update(chosen)
        return function(*bound.args, **bound.kwargs)

    wrapper.__signature__ = signature  # type: ignore[attr-defined]
    wrapper.__annotations__ = {**function.__annotations__, **{p.name: p.annotation for p in added}}
    wrapper.__annotations__.pop("given", None)
    wrapper.__doc__ = _completed(function.__doc__ or "", rules, declared, options)
    return wrapper  # type: ignore[return-value]


def option_words(name: str, value: Any) -> list[str]:
    """The words on a command line that give a setting.

    Examples
    --------
    >>> option_words("wall_margin", 0.04), option_words("opaque", False)
    (['--wall-margin', '0.04'], ['--no-opaque'])
    """
    option = name.replace("_", "-")
    if is_boolean(value):
        return [f"--{option}" if value else f"--no-{option}"]
    return [f"--{option}", str(value)]


def _option_type(rule: Rule, default: Any) -> Any:
    """The type by which the command line reads a setting."""
    kind = Literal[rule.choices] if rule.choices else OPTION_TYPES.get(rule.kind, str)
    kind = QUANTITIES.get(rule.unit, kind) if kind is float else kind
    return kind | None if default is None else kind


def _completed(text: str, rules: dict[str, Rule], declared: dict[str, Field[Any]], options: bool) -> str:
    """A docstring in which the settings replace the line ``**given``."""
    lines = inspect.cleandoc(text).splitlines()
    if "**given" not in lines:
        return text
    entries: list[str] = []
    for name, rule in rules.items():
        unit = f" [{rule.unit}]" if rule.unit else ""
        default = declared[name].default
        if options:
            entries += [name, _paragraph(rule.meaning.rstrip(".") + unit + ".")]
        else:
            kind = "{" + ", ".join(f'"{choice}"' for choice in rule.choices) + "}" if rule.choices else rule.kind
            ending = "" if default is REQUIRED else ", optional" if default is None else f", default {default!r}"
            entries += [f"{name} : {kind}{unit}{ending}", _paragraph(rule.meaning)]
    at = lines.index("**given")
    return "\n".join([*lines[:at], *entries, *lines[at + 1 :]])


def _paragraph(text: str) -> str:
    return indent(fill(text, LINE_WIDTH, break_long_words=False, break_on_hyphens=False), "    ")
