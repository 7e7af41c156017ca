"""The mapping file: which variable of a file is what, in which unit, order and sign convention.

It is a TOML file, for data files that do not tell this themselves; `mirrorfold import --guess FILE` proposes one::

    time_convention = "exp(+jwt)"
    s = {variable = "data.fp", dims = ["frequency", "position"]}
    frequency = {variable = "data.freq", unit = "Hz"}
    antenna = {x = "data.x", y = "data.y", z = "data.z"}
    compensation = {range = "data.r0"}
"""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from mirrorfold.common.arguments import path_of
from mirrorfold.common.units import (
    FARTHEST,
    KINDS,
    UNITS,
    Quantity,
    mixes_units,
    parse_quantity,
    unit_named,
    written_numbers,
)
from mirrorfold.errors import InputError
from mirrorfold.io.mapping.strict import read_written, validated

Finite = Annotated[float, Field(allow_inf_nan=False)]

Coordinate = Annotated[Finite, Field(ge=-FARTHEST, le=FARTHEST), Quantity("length")]


def _known_unit(value: Any) -> Any:
    """The unit of a name, such as "mm" for "millimetre"; a name of no unit is refused."""
    found = unit_named(value) if isinstance(value, str) else None
    if found is None:
        raise ValueError(f"{value!r} is no unit that is known, expected one of {', '.join(UNITS)}")
    return found


Unit = Annotated[str, BeforeValidator(_known_unit)]


def in_one_unit(content: Any, names: tuple[str, ...]) -> Any:
    """The content of a table with numbers such as ``"270 GHz"`` converted to the base unit, and with `unit` set.

    Raises
    ------
    ValueError
        If some of the numbers have a unit and others none, or units of several kinds, or `unit` is given besides.
    """
    if not isinstance(content, dict):
        return content
    given = {name: content[name] for name in names if content.get(name) is not None}
    written = {unit for _, unit in written_numbers(list(given.values())) if unit}
    if not written:
        return content
    kinds = {kind for kind, units in KINDS.items() if written & units.keys()}
    if mixes_units(list(given.values())) or len(kinds) > 1 or "unit" in content:
        raise ValueError(f"{given} mix numbers with and without units or of several kinds; give each its unit, or none")
    kind = kinds.pop()
    converted = {name: _converted(value, kind) for name, value in given.items()}
    return {**content, **converted, "unit": next(iter(KINDS[kind]))}


def _converted(value: Any, kind: str) -> Any:
    """A value, or nested lists of values, with numbers in the base unit."""
    if isinstance(value, list):
        return [_converted(item, kind) for item in value]
    return parse_quantity(value, kind) if isinstance(value, str) else value


class Strict(BaseModel):
    """A part of a mapping, in which unknown entries are mistakes."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Values(Strict):
    """A row of numbers: a variable of the file, a column of a table beside it, or numbers in the mapping.

    Attributes
    ----------
    variable : str
        Name of a variable of the file itself.
    file : str
        Name of a table beside it, with `column` (number from zero, or heading).
    values : list of float
    start, stop, step, points : float
        Equal steps: `start`, `points` and one of `stop` and `step`.
    unit : str
        Unit of these numbers; by default SI (degrees for angles).
    """

    variable: str | None = None
    file: str | None = None
    column: int | str = 0
    values: list[Finite] | None = None
    start: Finite | None = None
    stop: Finite | None = None
    step: Finite | None = None
    points: Annotated[int, Field(gt=0, le=100_000_000)] | None = None
    unit: Unit | None = None

    @model_validator(mode="before")
    @classmethod
    def _units(cls, content: Any) -> Any:
        return in_one_unit(content, ("values", "start", "stop", "step"))

    @model_validator(mode="after")
    def _one_source(self) -> Values:
        given = [name for name in ("variable", "file", "values", "start") if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"give one of variable, file, values or start; found {', '.join(given) or 'none'}")
        steps = [name for name in ("stop", "step", "points") if getattr(self, name) is not None]
        if (given == ["start"] and not {"points"} < set(steps)) or len(steps) > 2:
            raise ValueError(f"start needs points and one of stop and step; found {', '.join(steps) or 'none'}")
        return self


def _short(value: Any) -> Any:
    """The content of `Values` for a short form: a name stands for a variable, numbers for themselves."""
    if isinstance(value, str):
        return {"values": [value]} if any(unit for _, unit in written_numbers(value)) else {"variable": value}
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return {"values": [value]}
    return {"values": value} if isinstance(value, list) else value


Row = Annotated[Values, BeforeValidator(_short)]


class Samples(Strict):
    """The samples: one variable, or two with their parts.

    Attributes
    ----------
    variable : str
        Name of a variable with complex samples, or real ones over time.
    real, imaginary : str
        Names of variables.
    magnitude, phase : str
        Names of variables, in `magnitude_unit` and `phase_unit`.
    dims : list of str
        Axes in their order in the file: ``frequency``, ``time`` or ``range``, and ``tx``, ``rx``; ``pair``;
        ``position``; ``azimuth``, ``elevation`` or ``beam``; ``frame``, ``polarization``; ``re_im`` for an axis of
        length two with real and imaginary part; any other name needs a `select`.
    select : dict
        Index, or list of indices, to keep along an axis.
    skip : int
        Number of first columns of a table that are no samples, such as one with the frequencies.
    shape : list of int
        Shape that the array gets before its axes are named, the last axis running fastest; -1 for what is left.
    beat : bool
        Whether real samples over frequency are the beat signal of a chirp, from a mixer without I and Q.
    """

    variable: str | None = None
    real: str | None = None
    imaginary: str | None = None
    magnitude: str | None = None
    phase: str | None = None
    magnitude_unit: Literal["linear", "dB"] = "linear"
    phase_unit: Literal["degree", "radian"] = "radian"
    dims: Annotated[list[str], Field(min_length=1)]
    select: dict[str, int | list[int]] = {}
    skip: Annotated[int, Field(ge=0)] = 0
    shape: Annotated[list[int], Field(min_length=1, max_length=10)] | None = None
    beat: bool = False

    @model_validator(mode="after")
    def _one_source(self) -> Samples:
        groups = {"variable": (self.variable,), "real, imaginary": (self.real, self.imaginary)}
        groups["magnitude, phase"] = (self.magnitude, self.phase)
        given = [name for name, values in groups.items() if any(value is not None for value in values)]
        if len(given) != 1 or None in groups[given[0]]:
            raise ValueError(f"give variable, or real and imaginary, or magnitude and phase; found {given or 'none'}")
        if len(set(self.dims)) != len(self.dims):
            raise ValueError(f"the dims {self.dims} hold a name twice")
        ranges = [name for name in ("frequency", "time", "range") if name in self.dims]
        if len(ranges) != 1:
            raise ValueError(f"the dims {self.dims} must hold one of frequency, time and range")
        if self.beat and (self.variable is None or "frequency" not in self.dims or "re_im" in self.dims):
            raise ValueError("beat is for one variable with real samples along frequency; leave it out")
        return self


class Places(Strict):
    """Positions of antennas.

    Attributes
    ----------
    position : str or list
        Name of a variable, or a list of places, (n, 2) or (n, 3); or `file`, a table beside the file.
    axes : list of str
        The axes of its columns, for example ``["x", "-z", "y"]``.
    x, y, z
        Instead, the coordinates one by one, each a row or one number.
    unit : str
        By default the one that the variable names, else metres.
    """

    position: str | list[list[Finite]] | None = None
    file: str | None = None
    axes: list[Literal["x", "y", "z", "-x", "-y", "-z"]] = ["x", "y", "z"]
    x: Row | None = None
    y: Row | None = None
    z: Row | None = None
    unit: Unit | None = None

    @model_validator(mode="before")
    @classmethod
    def _units(cls, content: Any) -> Any:
        return in_one_unit(content, ("position",))

    @model_validator(mode="after")
    def _one_source(self) -> Places:
        coordinates = any(axis is not None for axis in (self.x, self.y, self.z))
        if sum((self.position is not None, self.file is not None, coordinates)) != 1:
            raise ValueError("give one of position, file, or x, y and z")
        if len({axis[-1] for axis in self.axes}) != len(self.axes):
            raise ValueError(f"the axes {self.axes} hold a name twice")
        return self


class Pairs(Strict):
    """The transmitter and the receiver of each channel, by the numbers of the antennas, counted from `base`."""

    tx: Row
    rx: Row
    base: Literal[0, 1] = 1


class RangeAxis(Strict):
    """The ranges [m] of the samples of range profiles, and the carrier [Hz] from which these were mixed down."""

    variable: str | None = None
    start: Finite | None = None
    step: Finite | None = None
    unit: Unit = "m"
    carrier: Annotated[float, Field(gt=0, allow_inf_nan=False), Quantity("frequency")]

    @model_validator(mode="before")
    @classmethod
    def _units(cls, content: Any) -> Any:
        return in_one_unit(content, ("start", "step"))

    @model_validator(mode="after")
    def _one_source(self) -> RangeAxis:
        if (self.variable is None) == (self.start is None or self.step is None):
            raise ValueError("give variable, or start and step")
        return self


class Compensation(Strict):
    """The reference range [m] of the pulses at each position, to which motion compensation has shifted them."""

    range: Row


class Mapping(Strict):
    """What the variables of a file are.

    Attributes
    ----------
    s : Samples
    frequency, time, range
        Values along that axis which the samples have; samples over time or range are transformed to frequency.
    band : (float, float) [Hz]
        Lowest and highest frequency to keep.
    tx, rx : Places
        Places of transmitters and receivers; or of `elements` that are both; or of one moving `antenna`.
    pairs : Pairs
        For samples with an axis ``pair``.
    reciprocal : bool
        Whether the samples of pairs measured in one direction hold for the exchanged pairs, too.
    azimuth, elevation : Values
        Directions of the beams of a raster scan, with `origin`.
    compensation : Compensation
    wave_speed : Values [m/s]; or relative_permittivity of a medium.
    scene_center : (x, y, z) [m]
        The unambiguous range lies around this place.
    join : str
        Dimension along which several files are joined.
    time_convention : {"exp(+jwt)", "exp(-jwt)"}
    title, instrument, description : str
    reader : str
    """

    s: Samples
    frequency: Row | None = None
    time: Row | None = None
    range: RangeAxis | None = None
    band: tuple[Annotated[Finite, Quantity("frequency")], Annotated[Finite, Quantity("frequency")]] | None = None
    tx: Places | None = None
    rx: Places | None = None
    elements: Places | None = None
    antenna: Places | None = None
    pairs: Pairs | None = None
    reciprocal: bool = False
    azimuth: Row | None = None
    elevation: Row | None = None
    origin: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    compensation: Compensation | None = None
    wave_speed: Row | None = None
    relative_permittivity: Annotated[float, Field(ge=1, allow_inf_nan=False)] | None = None
    scene_center: tuple[Coordinate, Coordinate, Coordinate] | None = None
    join: Literal["position", "frame"] | None = None
    time_convention: Literal["exp(+jwt)", "exp(-jwt)"] = "exp(+jwt)"
    title: str | None = None
    instrument: str | None = None
    description: str | None = None
    reader: str | None = None

    @model_validator(mode="after")
    def _fits(self) -> Mapping:
        dims = set(self.s.dims)
        wanted = {
            "frequency": self.frequency is not None,
            "time": self.time is not None,
            "range": self.range is not None,
            "tx": self.tx is not None or self.elements is not None,
            "rx": self.rx is not None or self.elements is not None,
            "pair": self.pairs is not None
            and (self.elements is not None or (self.tx is not None and self.rx is not None)),
            "position": self.antenna is not None,
            "azimuth": self.azimuth is not None,
            "elevation": self.elevation is not None,
            "beam": self.azimuth is not None and self.elevation is not None,
        }
        missing = [name for name, given in wanted.items() if name in dims and not given]
        if missing:
            need = {"pair": "pairs, and elements or tx and rx", "position": "antenna", "beam": "azimuth and elevation"}
            need |= dict.fromkeys(("tx", "rx"), "tx and rx, or elements")
            said = ", ".join(f"{name!r} needs {need.get(name, name)}" for name in missing)
            raise ValueError(f"the dims {self.s.dims} name what is not described: {said}")
        if self.wave_speed is not None and self.relative_permittivity is not None:
            raise ValueError("give one of wave_speed and relative_permittivity")
        if self.band is not None and not 0.0 <= self.band[0] < self.band[1]:
            raise ValueError(f"the band {list(self.band)} is not a lower and an upper frequency")
        if self.compensation is not None and "position" not in dims:
            raise ValueError("compensation needs the dims to hold 'position'")
        return self


def load_mapping(mapping: str | Path | dict[str, Any] | Mapping) -> Mapping:
    """Read a mapping from a file, a dict of the same form, or the name of a shipped one, which has precedence.

    Raises
    ------
    InputError
        The message tells every mistake and its place.
    """
    if isinstance(mapping, Mapping):
        return mapping
    if isinstance(mapping, dict):
        return validated(Mapping, mapping, "mapping")
    path = path_of("mapping", mapping, "the path of a mapping file, its content as a dict, or the name of one shipped")
    if str(mapping) in shipped():
        path = Path(str(files("mirrorfold").joinpath("io", "mapping", "shipped", f"{mapping}.toml")))
    elif not path.exists():
        known = ", ".join(shipped())
        raise InputError(f"{path}: does not exist; give the path of a mapping file, or one of those shipped: {known}")
    return validated(Mapping, read_written(path), str(path))


def shipped() -> list[str]:
    """Names of the mappings that are shipped with the package."""
    folder = files("mirrorfold").joinpath("io", "mapping", "shipped")
    return sorted(Path(item.name).stem for item in folder.iterdir() if item.name.endswith(".toml"))
