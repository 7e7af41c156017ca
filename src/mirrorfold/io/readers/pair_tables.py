"""Text tables of whole sweeps: wide ones, with a column for each pair of antennas, and long ones, with a line for each
sample.

Wide tables are read like any spectra, with headings such as ``S_3_12`` for receiver 3 and transmitter 12. Long tables
have a line for each frequency and pair, ``freq, tx, rx, re, im``. There tx and rx are numbers, or coordinates such as
``tx_x_mm, rx_x_mm``. Instead of pairs, a table may have places of one moving antenna, ``x_mm, y_mm``, or directions of
a beam, ``azimuth_deg, elevation_deg``. All of them become samples ``s`` and a row ``frequency`` [Hz].
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.units import KINDS, unit_named
from mirrorfold.errors import InputError
from mirrorfold.io.readers.contents import Spectra, Variable

SIDES = {
    "tx": re.compile(
        r"^(?:tx|transmit(?:ter)?|source|emitter)(?:[_ ]?(?:index|number|no|id|element|antenna|port|#)\.?)?$"
    ),
    "rx": re.compile(r"^(?:rx|receive(?:r)?|detector)(?:[_ ]?(?:index|number|no|id|element|antenna|port|#)\.?)?$"),
}
COORDINATE = re.compile(r"^(tx|rx)_?([xyz])(?:[_ ]*[\[(]?\s*(\w+?)\s*[\])]?)?$")
ALONE = re.compile(
    r"^(?:(?:antenna|position|pos)_?)?([xyz]|az(?:imuth)?|el(?:evation)?)(?:[_ ]+(\w+)|\s*[\[(]\s*(\w+)\s*[\])])?$"
)
"""Heading of a coordinate of one moving antenna, or of an angle of a beam, with its unit."""

PARAMETER = re.compile(r"^S(\d+),(\d+)$|^S(\d)(\d)$")

PLACE_DIGITS = 9
"""Digits after the point to which places [m] must agree to be the same: to a nanometre, far below any wavelength."""


@dataclass
class TableSweep:
    """The content of a table of pairs, of positions or of beams.

    Attributes
    ----------
    variables : dict of Variable
        Of pairs: ``s(frequency, tx, rx)``, or ``s(frequency, pair)`` with the numbers ``tx`` and ``rx`` if some pairs
        are missing; ``tx_position`` and ``rx_position`` [m], if the table holds them. Of a single antenna:
        ``s(frequency, position)`` and ``antenna_position`` [m], or ``s(frequency, beam)``, ``azimuth`` and
        ``elevation`` [degree]. Always ``frequency`` [Hz].
    mapping : dict, optional
        The content of a mapping file for these variables, if the table tells all that is needed.
    """

    variables: dict[str, Variable] = field(default_factory=dict)
    mapping: dict[str, Any] | None = None


def numbers_of(parameter: str) -> tuple[int, int] | None:
    """Numbers of the receiver and of the transmitter in the name of a scattering parameter; None for other names.

    Examples
    --------
    >>> numbers_of("S21"), numbers_of("S10,1"), numbers_of("S")
    ((2, 1), (10, 1), None)
    """
    match = PARAMETER.match(parameter)
    if match is None:
        return None
    rx, tx = (int(part) for part in match.groups() if part)
    return rx, tx


def sweep_of_wide_table(spectra: Spectra, *, two_ports: bool = False) -> TableSweep | None:
    """The pairs of a wide table, where ``S_i_j`` was received by i from j; None for spectra of other names.

    Spectra of two ports at most are pairs only with `two_ports`: they may as well be those of one position of many.
    """
    numbers = [found for name in spectra.parameters if (found := numbers_of(name)) is not None]
    if not numbers or len(numbers) < len(spectra.parameters) or (np.max(numbers) <= 2 and not two_ports):
        return None
    rx, tx = np.array(numbers).T
    return _arranged(spectra.frequency, np.stack(list(spectra.parameters.values()), axis=-1), tx, rx)


def sweep_of_long_table(
    path: Path,
    headings: Sequence[str],
    values: NDArray,
    frequency: NDArray[np.float64],
    samples: NDArray[np.complex128],
) -> TableSweep | None:
    """The content of a long table, `values` (lines, columns), of known frequencies [Hz] and samples (lines,).

    None for a table without pairs, places or beams.

    Raises
    ------
    InputError
        If a pair, a place or a beam lacks a frequency that others have, or has it twice.
    """
    sides: dict[str, NDArray] = {}
    positions: dict[str, NDArray[np.float64]] = {}
    for side, pattern in SIDES.items():
        column = next((n for n, heading in enumerate(headings) if pattern.match(heading.strip().lower())), None)
        places = _places(path, side, headings, values)
        if places is not None:
            positions[f"{side}_position"], which = np.unique(places.round(PLACE_DIGITS), axis=0, return_inverse=True)
            sides[side] = which.ravel()
        elif column is not None:
            sides[side] = values[:, column].real
    if not sides:
        return _of_one_antenna(path, headings, values, frequency, samples)
    if len(sides) < 2:
        return None
    numbers = np.stack([sides["tx"], sides["rx"]], axis=-1)
    row, pairs, s = _by_frequency(path, frequency, samples, numbers, "the pair of tx {:g} and rx {:g}")
    found_pairs = _arranged(row, s, pairs[:, 0], pairs[:, 1])
    found_pairs.variables |= {name: Variable.of(places, (), {"units": "m"}) for name, places in positions.items()}
    if len(positions) == 2:
        held = found_pairs.variables["s"].dims
        found_pairs.mapping = {"s": {"variable": "s", "dims": list(held)}, "frequency": "frequency"}
        found_pairs.mapping |= {side: {"position": f"{side}_position"} for side in SIDES}
        if "pair" in held:
            found_pairs.mapping["pairs"] = {"tx": "tx", "rx": "rx", "base": 0}
    return found_pairs


def _of_one_antenna(
    path: Path, headings: Sequence[str], values: NDArray, frequency: NDArray[np.float64], samples: NDArray
) -> TableSweep | None:
    """The content of a long table of places of a moving antenna, or of beams; None if it has a single one of them."""
    columns = {
        found[0]: found[1] * values[:, n].real for n, heading in enumerate(headings) if (found := _alone(heading))
    }
    axes = ("azimuth", "elevation") if {"azimuth", "elevation"} & set(columns) else ("x", "y", "z")
    places = np.stack([columns.get(axis, np.zeros(len(values))) for axis in axes], axis=-1)
    if np.unique(frequency).size == frequency.size or not np.ptp(places, axis=0).any():
        return None
    named = f"the {'beam' if 'azimuth' in axes else 'position'} {', '.join(f'{axis} {{:.9g}}' for axis in axes)}"
    row, places, s = _by_frequency(path, frequency, samples, places, named)
    variables = {"frequency": Variable.of(row, ("frequency",), {"units": "Hz"})}
    mapping: dict[str, Any] = {"frequency": "frequency"}
    if "azimuth" in axes:
        variables |= {axis: Variable.of(places[:, n], (), {"units": "degree"}) for n, axis in enumerate(axes)}
        mapping |= {axis: axis for axis in axes}
    else:
        variables["antenna_position"] = Variable.of(places, (), {"units": "m"})
        mapping["antenna"] = {"position": "antenna_position"}
    dims = ("frequency", "beam" if "azimuth" in axes else "position")
    return TableSweep(variables | {"s": Variable.of(s, dims)}, {"s": {"variable": "s", "dims": list(dims)}, **mapping})


def distinct(places: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """The distinct places, in the order of their first appearance, and the index of the place of each line."""
    _, first, which = np.unique(places.round(PLACE_DIGITS), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty_like(order)
    rank[order] = np.arange(order.size)
    return places[first[order]], rank[which.ravel()]


def _by_frequency(
    path: Path, frequency: NDArray[np.float64], samples: NDArray, places: NDArray[np.float64], named: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128]]:
    """Rising frequencies, the distinct places (or numbers), and samples (frequencies, places).

    Raises
    ------
    InputError
        If a place lacks a frequency or has it twice; `named` is the form in which the message describes the place.
    """
    row, at = np.unique(frequency, return_inverse=True)
    found, which = distinct(places)
    counts = np.zeros((row.size, len(found)), dtype=int)
    np.add.at(counts, (at, which), 1)
    if (counts != 1).any():
        wrong = np.argwhere(counts != 1)[0]
        count = counts[tuple(wrong)]
        raise InputError(
            f"{path}: {named.format(*found[wrong[1]])} has {count or 'no'} line{'s' if count > 1 else ''} at "
            f"{row[wrong[0]]:.9g} Hz, expected one for each frequency"
        )
    s = np.zeros(counts.shape, dtype=np.complex128)
    s[at, which] = samples
    return row, found, s


def is_known(heading: str) -> bool:
    """Whether a heading names a transmitter, a receiver, a coordinate of one, or a coordinate or angle alone."""
    text = heading.strip().lower()
    named = any(pattern.match(text) for pattern in (*SIDES.values(), COORDINATE))
    return named or _alone(heading) is not None


def _alone(heading: str) -> tuple[str, float] | None:
    """The axis or angle that a heading names, such as "x" or "azimuth", and the factor of its unit; else None."""
    match = ALONE.match(heading.strip().lower())
    if match is None:
        return None
    name = {"a": "azimuth", "e": "elevation"}.get(match[1][0], match[1])
    units = KINDS["angle" if len(name) > 1 else "length"]
    said = match[2] or match[3]
    unit = unit_named(said) if said else next(iter(units))
    return (name, units[unit]) if unit in units else None


def _places(path: Path, side: str, headings: Sequence[str], values: NDArray) -> NDArray[np.float64] | None:
    """Coordinates of one side, tx or rx, (lines, 3) [m]; zero where a column is missing, None where all are."""
    places = np.zeros((len(values), 3))
    seen = False
    for n, heading in enumerate(headings):
        match = COORDINATE.match(heading.strip().lower())
        if match is None or match[1] != side:
            continue
        unit = unit_named(match[3]) if match[3] else "m"
        if unit not in KINDS["length"]:
            raise InputError(f"{path}: the heading {heading!r} has no unit of length, expected tx_x_mm or tx_x [mm]")
        places[:, "xyz".index(match[2])] = values[:, n].real * KINDS["length"][unit]
        seen = True
    return places if seen else None


def _arranged(frequency: NDArray[np.float64], s: NDArray, tx: NDArray, rx: NDArray) -> TableSweep:
    """Samples (frequencies, pairs) as (frequency, tx, rx) if all pairs are there, else as a list of pairs."""
    variables = {"frequency": Variable.of(frequency, ("frequency",), {"units": "Hz"})}
    numbers: Mapping[str, NDArray] = {"tx": np.unique(tx), "rx": np.unique(rx)}
    if tx.size == numbers["tx"].size * numbers["rx"].size:
        cube = np.empty((frequency.size, numbers["tx"].size, numbers["rx"].size), dtype=s.dtype)
        cube[:, np.searchsorted(numbers["tx"], tx), np.searchsorted(numbers["rx"], rx)] = s
        return TableSweep(variables | {"s": Variable.of(cube, ("frequency", "tx", "rx"))})
    variables |= {"s": Variable.of(s, ("frequency", "pair")), "tx": Variable.of(tx), "rx": Variable.of(rx)}
    return TableSweep(variables)
