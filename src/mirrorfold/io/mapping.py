"""The mapping file: which variable of a file is what, in which unit, order and sign convention.

A TOML file, for whatever does not say it itself; `mirrorfold import --guess FILE` proposes one::

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

from mirrorfold.errors import InputError
from mirrorfold.io.strict import read_written, validated

Finite = Annotated[float, Field(allow_inf_nan=False)]

UNITS: dict[str, float] = {
    "Hz": 1.0, "kHz": 1e3, "MHz": 1e6, "GHz": 1e9, "THz": 1e12,
    "m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "inch": 0.0254,
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "ps": 1e-12,
    "degree": 1.0, "radian": 57.29577951308232, "m/s": 1.0,
}  # fmt: skip
"""What a number has to be multiplied with: for Hz, m, s, degree or m/s."""

Unit = Literal[
    "Hz", "kHz", "MHz", "GHz", "THz", "m", "cm", "mm", "um", "inch", "s", "ms", "us", "ns", "ps", "degree", "radian",
    "m/s",
]  # fmt: skip

KINDS = {
    "frequency": ("Hz", "kHz", "MHz", "GHz", "THz"),
    "length": ("m", "cm", "mm", "um", "inch"),
    "time": ("s", "ms", "us", "ns", "ps"),
    "angle": ("degree", "radian"),
    "speed": ("m/s",),
    "number": (),
}
"""Units by the kind of quantity."""


class Strict(BaseModel):
    """A part of a mapping: unknown entries are mistakes."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Values(Strict):
    """A row of numbers: a variable of the file, a column of a table beside it, or given here.

    Attributes
    ----------
    variable : str
        Of the file itself.
    file : str
        A table beside it, with `column` (number from zero, or heading).
    values : list of float
    start, stop, step, points : float
        Equal steps: two of the last three, and the first.
    unit : str
        Of these numbers; SI (degrees for angles) unless given.
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
    """A name stands for a variable, numbers for themselves."""
    if isinstance(value, str):
        return {"variable": value}
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return {"values": [value]}
    return {"values": value} if isinstance(value, list) else value


Row = Annotated[Values, BeforeValidator(_short)]


class Samples(Strict):
    """The samples: one complex variable, or two that make one.

    Attributes
    ----------
    variable : str
    real, imaginary : str
        Variables.
    magnitude, phase : str
        Variables, in `magnitude_unit` and `phase_unit`.
    dims : list of str
        Axes in their order in the file: ``frequency``, ``time`` or ``range``, and ``tx``, ``rx``; ``pair``;
        ``position``; ``azimuth``, ``elevation`` or ``beam``; ``frame``, ``polarization``; ``re_im`` for an axis of
        length two; any other name needs a `select`.
    select : dict
        Index, or list of indices, to keep along an axis.
    skip : int
        First columns of a table that are no samples, such as one with the frequencies.
    shape : list of int
        What to make of the array before its axes are named, the last axis running fastest; -1 for what is left.
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
        return self


class Places(Strict):
    """Positions of antennas.

    Attributes
    ----------
    position : str or list
        A variable or list of places, (n, 2) or (n, 3); or `file`, a table beside the file.
    axes : list of str
        What its columns are, for example ``["x", "-z", "y"]``.
    x, y, z
        The coordinates one by one instead, each a row or one number.
    unit : str
    """

    position: str | list[list[Finite]] | None = None
    file: str | None = None
    axes: list[Literal["x", "y", "z", "-x", "-y", "-z"]] = ["x", "y", "z"]
    x: Row | None = None
    y: Row | None = None
    z: Row | None = None
    unit: Unit = "m"

    @model_validator(mode="after")
    def _one_source(self) -> Places:
        coordinates = any(axis is not None for axis in (self.x, self.y, self.z))
        if sum((self.position is not None, self.file is not None, coordinates)) != 1:
            raise ValueError("give one of position, file, or x, y and z")
        if len({axis[-1] for axis in self.axes}) != len(self.axes):
            raise ValueError(f"the axes {self.axes} hold a name twice")
        return self


class Pairs(Strict):
    """Which transmitter and which receiver a channel belongs to: numbers of the antennas, from `base`."""

    tx: Row
    rx: Row
    base: Literal[0, 1] = 1


class Carried(Strict):
    """A range profile about a carrier: where its samples stand [m] and the frequency they were mixed down from [Hz]."""

    variable: str | None = None
    start: Finite | None = None
    step: Finite | None = None
    unit: Unit = "m"
    carrier: Annotated[float, Field(gt=0, allow_inf_nan=False)]

    @model_validator(mode="after")
    def _one_source(self) -> Carried:
        if (self.variable is None) == (self.start is None or self.step is None):
            raise ValueError("give variable, or start and step")
        return self


class Compensation(Strict):
    """The range [m], one for each position, that every pulse was referred to (motion compensation)."""

    range: Row


class Mapping(Strict):
    """What the variables of a file are.

    Attributes
    ----------
    s : Samples
    frequency, time, range
        The axis that the samples have; times and ranges are turned into frequencies.
    band : (float, float) [Hz]
        Frequencies to keep.
    tx, rx : Places
        Of transmitters and receivers; or `elements` that are both; or one moving `antenna`.
    pairs : Pairs
        For samples with an axis ``pair``.
    reciprocal : bool
        Pairs that were measured one way only are the same the other way.
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
    range: Carried | None = None
    band: tuple[Finite, Finite] | None = None
    tx: Places | None = None
    rx: Places | None = None
    elements: Places | None = None
    antenna: Places | None = None
    pairs: Pairs | None = None
    reciprocal: bool = False
    azimuth: Row | None = None
    elevation: Row | None = None
    origin: tuple[Finite, Finite, Finite] = (0.0, 0.0, 0.0)
    compensation: Compensation | None = None
    wave_speed: Row | None = None
    relative_permittivity: Annotated[float, Field(ge=1, allow_inf_nan=False)] | None = None
    scene_center: tuple[Finite, Finite, Finite] | None = None
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
    """A mapping from a file, from a dict of the same form, or one that comes along, by its name.

    Raises
    ------
    InputError
        With every mistake and its place.
    """
    if isinstance(mapping, Mapping):
        return mapping
    if isinstance(mapping, dict):
        return validated(Mapping, mapping, "mapping")
    path = Path(mapping)
    if not path.exists() and not path.suffix and str(mapping) in shipped():
        path = Path(str(files("mirrorfold").joinpath("io", "mappings", f"{mapping}.toml")))
    elif not path.exists():
        known = ", ".join(shipped())
        raise InputError(f"{path}: does not exist; give the path of a mapping file, or one of those shipped: {known}")
    return validated(Mapping, read_written(path), str(path))


def shipped() -> list[str]:
    """Names of the mappings that come along."""
    folder = files("mirrorfold").joinpath("io", "mappings")
    return sorted(Path(item.name).stem for item in folder.iterdir() if item.name.endswith(".toml"))
