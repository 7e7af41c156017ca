"""Units: one small table, and numbers that people write with a unit, such as ``300 GHz`` or ``8 cm``.

Inside of the program, every number is in SI units, and angles are in degrees. Where people write numbers - in options
of the command line, scene files, mapping files, tables of positions - a number without a unit is in these units, too,
and a number with a unit is converted here.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from typing import Annotated, Any

from mirrorfold.errors import InputError

KINDS: dict[str, dict[str, float]] = {
    "frequency": {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9, "THz": 1e12},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "nm": 1e-9, "km": 1e3, "inch": 0.0254, "ft": 0.3048},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "ps": 1e-12, "min": 60.0},
    "angle": {"degree": 1.0, "radian": 57.29577951308232, "mrad": 0.05729577951308232},
    "speed": {"m/s": 1.0, "km/s": 1e3, "mm/us": 1e3},
    "memory": {"B": 1.0, "kB": 1e3, "MB": 1e6, "GB": 1e9, "MiB": 2.0**20, "GiB": 2.0**30},
    "number": {},
}
"""For each kind of quantity, the factor that converts each unit to Hz, m, s, degree, m/s or B."""

UNITS: dict[str, float] = {name: factor for units in KINDS.values() for name, factor in units.items()}
"""The factors of all units, whatever their kind."""

FARTHEST = 1e7
"""Largest distance of a place [m], a quarter of the way around the Earth. Anything farther is a mistake: no echo
returns from there, and numbers that are counted or squared on the way to an image would overflow."""

SLOWEST = 1.0
"""Lowest speed of waves [m/s]; slower ones carry no echo through air, water or matter."""

OTHER_NAMES = {
    "deg": "degree", "degrees": "degree", "°": "degree", "rad": "radian", "radians": "radian",
    "in": "inch", "inches": "inch", '"': "inch", "µm": "um", "μm": "um", "micron": "um", "µs": "us", "μs": "us",
    "sec": "s", "metre": "m", "meter": "m", "metres": "m", "meters": "m",
    "hertz": "Hz", "second": "s", "seconds": "s", "foot": "ft", "feet": "ft",
}  # fmt: skip
"""Other names that people write for units."""

PREFIXES = {"pico": "p", "nano": "n", "micro": "u", "milli": "m", "centi": "c", "kilo": "k", "mega": "M", "giga": "G",
            "tera": "T"}  # fmt: skip
"""Words before the names of units, and the letters that stand for them, as in ``millimetres``."""

OTHER_NAMES |= {
    f"{prefix}{name}": f"{short}{unit}"
    for prefix, short in PREFIXES.items()
    for name, unit in OTHER_NAMES.items()
    if f"{short}{unit}" in UNITS
}

NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*?)\s*")
"""A number, and the name of a unit, which may be empty."""


def unit_named(name: str) -> str | None:
    """The unit that a name stands for, None for anything else.

    An exact name counts first, then a name with other capitals.

    Examples
    --------
    >>> unit_named("ghz"), unit_named("deg"), unit_named("parsec")
    ('GHz', 'degree', None)
    """
    name = OTHER_NAMES.get(name, name)
    if name in UNITS:
        return name
    lower = name.lower()
    return next((unit for unit in UNITS if unit.lower() == OTHER_NAMES.get(lower, lower).lower()), None)


def other_unit(said: Any, unit: str) -> str | None:
    """The unit that `said`, such as an attribute `units`, names, if it is another one of the kind of `unit`.

    Examples
    --------
    >>> other_unit("mm", "m"), other_unit("metres", "m"), other_unit("pixels", "m"), other_unit(None, "m")
    ('mm', None, None, None)
    """
    named = unit_named(said) if isinstance(said, str) else None
    kind = next(units for units in KINDS.values() if unit in units)
    return named if named in kind and named != unit else None


def foreign_unit(value: Any, unit: str) -> str | None:
    """The unit that numbers carry along, as arrays of pint, astropy and xarray do, where it is another one than `unit`.

    NumPy drops such units, and takes the numbers as they are. Names in an attribute of xarray that are no unit of this
    kind mean nothing. In a list or a tuple, each item may carry a unit of its own.

    Examples
    --------
    >>> import xarray as xr
    >>> foreign_unit(xr.DataArray([1.0], attrs={"units": "mm"}), "m"), foreign_unit([1.0, 2.0], "m")
    ('mm', None)
    """
    if isinstance(value, list | tuple):
        return next((found for one in value if (found := foreign_unit(one, unit)) is not None), None)
    attrs = getattr(value, "attrs", None)
    held = value if attrs is None else getattr(value, "data", value)
    said = getattr(held, "units", None) or getattr(held, "unit", None)
    if said is None:
        return None if attrs is None else other_unit(attrs.get("units"), unit)
    return None if str(said) in ("", "dimensionless") or unit_named(str(said)) == unit else str(said)


LONGEST_QUANTITY = 200
"""Largest number of letters of a quantity: the time to look for a number in a text grows with the square of its
length."""


def split_quantity(text: str) -> tuple[float, str] | None:
    """Number and unit of a text such as ``80 mm``, with an empty unit if there is none; None for any other text.

    Examples
    --------
    >>> split_quantity("80mm"), split_quantity("3e11"), split_quantity("wall")
    ((80.0, 'mm'), (300000000000.0, ''), None)
    """
    match = NUMBER.fullmatch(text) if len(text) <= LONGEST_QUANTITY else None
    if match is None:
        return None
    unit = unit_named(match[2]) if match[2] else ""
    return None if unit is None else (float(match[1]), unit)


def parse_quantity(text: str, kind: str) -> float:
    """A number in SI units (degrees for angles) from a text with or without a unit.

    Parameters
    ----------
    text : str
    kind : {"frequency", "length", "time", "angle", "speed", "memory"}

    Raises
    ------
    InputError
        If the text is no number, or its unit is none of this kind.

    Examples
    --------
    >>> parse_quantity("300 GHz", "frequency"), parse_quantity("0.08", "length")
    (300000000000.0, 0.08)
    """
    found = split_quantity(text)
    if found is None or (found[1] and found[1] not in KINDS[kind]):
        raise InputError(f"{text!r} is no {kind}, expected a number, with a unit such as {', '.join(KINDS[kind])}")
    factor = KINDS[kind].get(found[1], 1.0)
    return float(Decimal(repr(found[0])) * Decimal(repr(factor)))  # 50 um is 5e-05 m to the last digit


def parse_quantities(text: str, kind: str, *, mark: str = ":", unit: str | None = None) -> list[float]:
    """Several numbers in SI units from one text, separated by a mark: all with a unit or none; zero needs none.

    Parameters
    ----------
    text : str
    kind : str
        As for `parse_quantity`.
    mark : str
        The separator.
    unit : str, optional
        The unit of numbers without one, if it is not that of SI.

    Raises
    ------
    InputError
        If one of them is no such number, or some have a unit and others do not.

    Examples
    --------
    >>> parse_quantities("270GHz:300GHz", "frequency")
    [270000000000.0, 300000000000.0]
    """
    parts = text.split(mark)
    values = [parse_quantity(part, kind) for part in parts]
    named = {bool((split_quantity(part) or (0.0, ""))[1]) for part, value in zip(parts, values, strict=True) if value}
    if len(named) > 1:
        raise InputError(f"{text!r} names a unit for some of its numbers and none for others; give each its unit")
    return [value * UNITS[unit] for value in values] if unit and named == {False} else values


def written_numbers(value: Any) -> list[tuple[float, str]]:
    """Numbers and units in a value of a file: a text, a number, or lists of them; other texts are names, and left out.

    A number that is no text, which may be too large for a float, is returned as 1, or as 0 for zero.

    Examples
    --------
    >>> written_numbers(["8 cm", "0.5", 2, "tx_x"])
    [(8.0, 'cm'), (0.5, ''), (1.0, '')]
    """
    if isinstance(value, list | tuple):
        return [pair for item in value for pair in written_numbers(item)]
    if isinstance(value, str):
        found = split_quantity(value)
        return [] if found is None else [found]
    return [(1.0 if value else 0.0, "")] if isinstance(value, int | float) else []


def mixes_units(value: Any) -> bool:
    """Whether some of the numbers in a value have a unit and others do not; zero needs none.

    Examples
    --------
    >>> mixes_units(["8 cm", "0.5"]), mixes_units(["8 cm", 0]), mixes_units([8, 0.5])
    (True, False, False)
    """
    written = written_numbers(value)
    return any(unit for _, unit in written) and any(number and not unit for number, unit in written)


@dataclass(frozen=True)
class Quantity:
    """Marks the type of a number that may be written with a unit: ``Annotated[float, Quantity("length")]``.

    Pydantic reads fields of this type from files, and the command line options of this type.

    Attributes
    ----------
    kind : str
    """

    kind: str

    def read(self, value: Any) -> Any:
        """The number that a text stands for; any other value unchanged."""
        return parse_quantity(value, self.kind) if isinstance(value, str) else value

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Read a text before the checks of the number."""
        from pydantic_core import core_schema

        return core_schema.no_info_before_validator_function(self.read, handler(source))


Frequency = Annotated[float, Quantity("frequency")]
Length = Annotated[float, Quantity("length")]
Time = Annotated[float, Quantity("time")]
Angle = Annotated[float, Quantity("angle")]
Speed = Annotated[float, Quantity("speed")]
Memory = Annotated[float, Quantity("memory")]

QUANTITIES = {"Hz": Frequency, "m": Length, "s": Time, "degree": Angle, "m/s": Speed, "B": Memory}
"""The type of each quantity, by the unit of a number that is written without a unit."""


def length_text(length: float) -> str:
    """A length [m] as people write it: below 0.1 m in millimetres, from 10 km in kilometres, without an exponent.

    Examples
    --------
    >>> [length_text(length) for length in (0.0005, 0.132, 12.5, 1840.0, 10200.0)]
    ['0.5 mm', '0.132 m', '12.5 m', '1840 m', '10.2 km']
    """
    unit, scale = ("mm", 1e-3) if abs(length) < 0.1 else ("m", 1.0) if abs(length) < 1e4 else ("km", 1e3)
    return f"{float(f'{length / scale:.3g}'):g} {unit}"


def frequency_text(frequency: float) -> str:
    """A frequency [Hz] as people write it, with nine digits and the largest unit that it reaches.

    Examples
    --------
    >>> frequency_text(2.9e11), frequency_text(300000.0), frequency_text(0.5)
    ('290 GHz', '300 kHz', '0.5 Hz')
    """
    units = KINDS["frequency"]
    unit = max(
        (name for name in units if units[name] <= abs(frequency) and name != "THz"), key=units.__getitem__, default="Hz"
    )
    return f"{frequency / units[unit]:.9g} {unit}"
