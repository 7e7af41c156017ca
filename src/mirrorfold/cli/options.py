"""The application, the options that several verbs share, with their types and help, and the running command line."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from contextvars import ContextVar
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from cyclopts import App, Parameter

from mirrorfold.common.units import Quantity, parse_quantities, split_quantity
from mirrorfold.errors import InputError

app = App(
    name="mirrorfold",
    help_format="plaintext",
    version_flags=[],
    suppress_keyboard_interrupt=False,
    default_parameter=Parameter(negative="", negative_iterable=()),
)
"""The application; `mirrorfold.cli.program` registers the verbs with it."""

# Types of options that several verbs share; the annotation holds the help.
Output = Annotated[Path, Parameter(alias="-o")]
OptionalOutput = Annotated[Path | None, Parameter(alias="-o")]
Numbers = Annotated[str | None, Parameter(allow_leading_hyphen=True)]
"""Option with several numbers in one text, such as ``-2:2:0.005`` or ``0,1.5``."""

CrossRanges = Annotated[
    Numbers,
    Parameter(
        help="Cross-range of the pixels as START:STOP:STEP [m], for example -2:2:0.005, or one number; chosen from the "
        "sweep by default."
    ),
]
Ranges = Annotated[Numbers, Parameter(help="Range of the pixels, likewise.")]
Heights = Annotated[Numbers, Parameter(help="Height of the pixels, likewise, for a volume; the floor plan by default.")]

Preset = Annotated[
    Literal["default", "published"],
    Parameter(
        help="The algorithm with all its tests, or as it was published. Settings of folding that are given count "
        "instead of those of the preset."
    ),
]
Mirrors = Annotated[
    Path | None,
    Parameter(
        help="Mirrors that are known or drawn (JSON), or a floor plan (DXF, GeoJSON), of which those walls are mirrors "
        "that the radar sees; found in the image by default."
    ),
]
FloorPlanFile = Annotated[
    Path | None, Parameter(name="--plan", help="Known floor plan (DXF, GeoJSON) to lay over the pictures.")
]
Frame = Annotated[int | None, Parameter(help="Which frame of a recording, from 0.")]
Export = Annotated[Path | None, Parameter(help="File for other programs to write too: see `mirrorfold export --help`.")]

LARGEST_INTEGER = 2.0**63
"""Limit of whole numbers, exclusive; files hold no larger ones."""

command: ContextVar[str] = ContextVar("command", default="mirrorfold")
"""The running command line, which is stored in results."""


def parse_numbers(
    text: str, option: str, form: str, kind: str, *, mark: str = ":", unit: str | None = None
) -> list[float]:
    """The numbers in the text of an option, in SI units; see `parse_quantities`.

    Parameters
    ----------
    text : str
        Numbers with or without units.
    option : str
        Name of the option, for the message.
    form : str
        The expected form, for the message, such as ``START:STOP in metres, for example 0.3:4``.
    kind : str
        Kind of the units, such as ``length``.
    mark : str
        Character between the numbers.
    unit : str, optional
        Unit of numbers that are written without one.

    Raises
    ------
    InputError
        If the text has no such numbers.
    """
    try:
        return parse_quantities(text, kind, mark=mark, unit=unit)
    except InputError as error:
        raise InputError(f"--{option} is {text!r}, expected {form} ({error})") from None


def completed(function: Callable[..., Any]) -> Callable[..., Any]:
    """Complete the options of a verb; changes the function in place, and returns it.

    A flag that is on by default gets an opposite, ``--no-NAME``; a flag that is off by default, such as ``--json``,
    gets none. A number with a unit (`Quantity`) may be written with another unit of its kind, as in ``80mm``. A
    fraction is refused where a whole number is expected.
    """
    signature = inspect.signature(function)
    hints = get_type_hints(function, include_extras=True)
    changed: dict[str, Any] = {}
    for name, parameter in signature.parameters.items():
        if parameter.default is True:
            changed[name] = Annotated[bool, Parameter(negative=f"--no-{name.replace('_', '-')}")]
            continue
        quantity = _quantity(hints.get(name))
        names = _whole_names(hints.get(name))
        whole = None if names is None else partial(_whole_number, names=names)
        read = whole if quantity is None else quantity.read
        if read is not None:
            changed[name] = Annotated[hints[name], Parameter(converter=_converter(read), allow_leading_hyphen=True)]
    if changed:
        parameters = [one.replace(annotation=changed.get(one.name, one.annotation))
                      for one in signature.parameters.values()]  # fmt: skip
        function.__annotations__ |= changed
        function.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return function


def _quantity(hint: Any) -> Quantity | None:
    """The `Quantity` in a type such as ``Length | None``; None for types without one."""
    found = [item for item in getattr(hint, "__metadata__", ()) if isinstance(item, Quantity)]
    found += [inner for part in getattr(hint, "__args__", ()) if (inner := _quantity(part)) is not None]
    return found[0] if found else None


def _converter(read: Callable[[Any], Any]) -> Callable[[Any, Sequence[Any]], Any]:
    """The converter that cyclopts calls with the type and the tokens of an option; `read` reads the first token."""
    return lambda _, tokens: read(tokens[0].value)


def _whole_names(hint: Any) -> tuple[str, ...] | None:
    """The names that are allowed in place of a whole number, in a type such as ``int | Literal["mean"] | None``.

    None for types without a whole number.
    """
    if get_origin(hint) is Annotated:
        return _whole_names(get_args(hint)[0])
    if int not in (hint, *get_args(hint)):
        return None
    others = [part for part in get_args(hint) if part not in (int, type(None))]
    if any(get_origin(part) is not Literal for part in others):
        return None
    return tuple(name for part in others for name in get_args(part))


def _whole_number(text: str, names: Sequence[str]) -> int | str:
    """A whole number, which may be written as ``1e6``, or one of the names; cyclopts would cut off fractions."""
    if text in names:
        return text
    found = split_quantity(text)
    if found is None or found[1] or not found[0].is_integer() or abs(found[0]) >= LARGEST_INTEGER:
        raise InputError(f"{text!r} is not valid, expected {' or '.join(('a whole number', *names))}")
    return int(text) if text.lstrip("+-").isdecimal() else int(found[0])
