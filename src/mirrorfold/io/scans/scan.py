"""The sweep of a scan for which a network analyser has written one file for each position."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from mirrorfold.common.arguments import in_message, path_of, wrong_kind
from mirrorfold.common.statistics import mean_step
from mirrorfold.common.types import Progress
from mirrorfold.common.units import frequency_text
from mirrorfold.errors import InputError
from mirrorfold.io.mapping.arrangements import fill_matrix, grid_beams
from mirrorfold.io.mapping.assembly import assemble
from mirrorfold.io.mapping.model import Mapping
from mirrorfold.io.mapping.quantities import Quantities
from mirrorfold.io.mapping.spectral import STEP_TOLERANCE
from mirrorfold.io.mapping.strict import validated
from mirrorfold.io.readers import Contents, Spectra, read_contents, touchstone
from mirrorfold.io.readers.contents import check_memory, damaged, listed
from mirrorfold.io.readers.pair_tables import PLACE_DIGITS, distinct, numbers_of, sweep_of_wide_table
from mirrorfold.io.readers.table import usual_phase_unit
from mirrorfold.io.scans.networks import SpectraInMemory
from mirrorfold.io.scans.positions import FilePosition, Scan, arrangement_of, match_pattern, read_positions
from mirrorfold.sweep import AXES, TIME_CONVENTION, check_sweep, unit_doubts

DEFAULTS = {"pair": "S21", "position": "S11", "beam": "S11"}
"""The scattering parameter that is taken by default where files hold several."""

LONGEST_NAME = 1024
"""Largest number of letters of a file name with its folders, or of a pattern, as longer ones take minutes to match."""


def import_scan(
    paths: Sequence[Path] | dict[str, SpectraInMemory],
    *,
    positions: str | Path | dict[str, Any] | None,
    parameter: str | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Read a scan with one file for each position as a sweep.

    Parameters
    ----------
    paths : list of Path, or dict of SpectraInMemory
        The files, or their folder; or the JSON description alone, with the files beside it; or networks in memory.
    positions : path or dict, optional
        Table or description of the positions; by default the only path is the description.
    parameter : str, optional
    progress : callable (done, total), optional

    Raises
    ------
    InputError
        If files and positions do not fit together, or a file cannot be read.
    """
    if parameter is not None and not isinstance(parameter, str):
        raise wrong_kind("parameter", parameter, 'the name of a scattering parameter, such as "S21"', reader="")
    if positions is not None and not isinstance(positions, dict):
        positions = path_of("positions", positions, "the path of a table, or its content as a dict")
    if isinstance(paths, dict):
        files: Files = dict(paths)
        listed_all = True
        table = Path("positions") if isinstance(positions, dict) or positions is None else positions
    else:
        listed_all = not any(path.is_dir() for path in paths) and positions is not None
        table = Path("positions")
        if not isinstance(positions, dict):
            table = positions if positions is not None else paths[0]
        files = _files([table.parent] if positions is None else paths, table)
    scan, lines = read_positions(positions if isinstance(positions, dict) else table)
    if scan.ports is not None:
        return _all_ports(table, scan, scan.ports, files)
    if lines is None and scan.files is None:
        return _all_pairs(table, scan, files)
    lines = match_pattern(table, scan, list(files)) if lines is None else lines
    kind, numbers = arrangement_of(table, lines)
    chosen = _chosen(table, lines, files, listed=listed_all)
    frequency, s = _spectra(chosen, parameter or scan.parameter, kind, progress)
    if scan.time_convention == "exp(-jwt)":
        s = s.conj()
    attrs = _attrs(scan, table)
    quantities = Quantities(Contents(table, "table", {}))
    coords: dict[str, Any] = {"frequency": ("frequency", frequency, {"units": "Hz"})}
    if kind == "beam":
        azimuth, elevation, full = grid_beams(quantities, s, numbers[:, 0], numbers[:, 1])
        coords |= {"azimuth": ("azimuth", azimuth, {"units": "degree"})}
        coords |= {"elevation": ("elevation", elevation, {"units": "degree"})}
        sweep = xr.Dataset(
            {"s": (("frequency", "azimuth", "elevation"), full)}, coords, attrs | {"origin": np.array(scan.origin)}
        )
        return _checked(sweep, table)
    coords["axis"] = list(AXES)
    if kind == "position":
        coords["antenna_position"] = (("position", "axis"), numbers, {"units": "m"})
        return _checked(xr.Dataset({"s": (("frequency", "position"), s)}, coords, attrs), table)
    tx, at_tx = distinct(numbers[:, :3])
    rx, at_rx = distinct(numbers[:, 3:])
    _once(lines, at_tx, at_rx)
    full, measured = fill_matrix(quantities, s, at_tx, at_rx, (len(tx), len(rx)), reciprocal=False)
    coords["tx_position"] = (("tx", "axis"), tx, {"units": "m"})
    coords["rx_position"] = (("rx", "axis"), rx, {"units": "m"})
    if not measured.all():
        warnings.warn(
            f"{measured.size - int(measured.sum())} of {measured.size} pairs were not measured and count as zero",
            stacklevel=2,
        )
        coords["measured"] = (("tx", "rx"), measured)
    return _checked(xr.Dataset({"s": (("frequency", "tx", "rx"), full)}, coords, attrs), table)


Files = dict[str, Path | SpectraInMemory]


def _files(paths: Sequence[Path], table: Path) -> Files:
    """The files by name, those in folders by their paths relative to the folder; the table is left out."""
    found: Files = {}
    for path in paths:
        if not path.exists():
            raise InputError(f"{path}: does not exist; give the folder of the scan or its files")
        members = sorted(item for item in path.rglob("*") if item.is_file()) if path.is_dir() else [path]
        for member in members:
            if table.exists() and member.samefile(table):
                continue
            found[str(member.relative_to(path)) if path.is_dir() else member.name] = member
    if not found:
        raise InputError(f"{paths[0]}: holds no files; give the folder of the scan")
    return found


def _chosen(table: Path, lines: Sequence[FilePosition], files: Files, *, listed: bool) -> list[Path | SpectraInMemory]:
    """The file of each line.

    Raises
    ------
    InputError
        If a line names no file or several, two lines name the same file, or a file that was given is in no line.
    """
    by_name = {Path(name).name: path for name, path in files.items()}
    by_name |= {Path(path.name).stem: path for path in files.values() if isinstance(path, SpectraInMemory)}
    chosen: dict[Path | SpectraInMemory, FilePosition] = {}
    for number, line in enumerate(lines):
        if len(line.file) > LONGEST_NAME:
            said = f"names a file by {len(line.file)} letters, expected at most {LONGEST_NAME}; name one of the files"
            raise InputError(f"{table}: line {number + 1} {said}")
        path = files.get(line.file) or by_name.get(Path(line.file.replace("\\", "/")).name)
        if path is None and any(mark in line.file for mark in "*?["):
            fitting = [name for name in files if fnmatchcase(name, line.file)]
            if len(fitting) > 1:
                raise InputError(f"{line.where}: {line.file!r} fits {fitting[0]} and {fitting[1]}; make it fit one")
            path = files[fitting[0]] if fitting else None
        if path is None:
            ended = next((name for name in files if Path(name).stem == Path(line.file).name), None)
            remedy = f"write {ended}, with its ending" if ended else f"expected a name such as {next(iter(files))}"
            raise InputError(
                f"{line.where}: names {line.file!r}, which is not among the {len(files)} files given; {remedy}"
            )
        if path in chosen:
            raise InputError(f"{line.where}: names {path.name}, as {chosen[path].where} does; a file has one place")
        chosen[path] = line
    left = [path for path in files.values() if path not in chosen and touchstone.SUFFIX.search(path.name)]
    if left and listed:
        raise InputError(f"{table}: says nothing of {left[0].name}, one of {len(left)} such files; add their places")
    if left:
        names = left[0].name if len(left) == 1 else f"{left[0].name} and {len(left) - 1} more"
        warnings.warn(f"no line of {table.name} names {names}, which the folder holds, too", stacklevel=3)
    return list(chosen)


def read_spectra(path: Path | SpectraInMemory) -> Spectra:
    """Read the scattering parameters in a file of a network analyser, or take them from memory."""
    if isinstance(path, SpectraInMemory):
        return path.spectra
    if touchstone.SUFFIX.search(path.name):
        try:
            return touchstone.read_spectra(path)
        except InputError:
            raise
        except Exception as error:  # scikit-rf, which reads version 2, reports damage by exceptions of many types
            raise damaged(path, error) from None
    contents = read_contents(path)
    if contents.spectra is None:
        raise InputError(
            f"{path}: holds no scattering parameters against frequency; name the columns, or use a mapping"
        )
    return contents.spectra


def _spectra(
    files: Sequence[Path | SpectraInMemory], parameter: str | None, kind: str, progress: Progress | None
) -> tuple[NDArray[np.float64], NDArray[np.complex64]]:
    """Frequencies [Hz] and samples (frequencies, files) of the files; all must have the same frequencies."""
    first = read_spectra(files[0])
    name = _parameter(files[0], first, parameter, kind)
    frequency = first.frequency
    check_memory(files[0].parent, 2.0 * 8 * frequency.size * len(files), f"the scan of {len(files)} files")
    s, phases = np.empty((len(files), frequency.size), dtype=np.complex64), []
    for n, path in enumerate(files):
        found = first if n == 0 else read_spectra(path)
        if found.frequency.shape != frequency.shape or not np.allclose(
            found.frequency, frequency, rtol=0.0, atol=STEP_TOLERANCE * _step(frequency)
        ):
            raise InputError(
                f"{path}: has {_band(found.frequency)}, and {files[0].name} {_band(frequency)}; measure all with the "
                "same"
            )
        if name not in found.parameters:
            raise InputError(f"{path}: holds {listed(found.parameters)} and not {name}; measure it again")
        s[n] = found.parameters[name]
        phases += [found.bare_phases[name]] if name in found.bare_phases else []
        if progress is not None and ((n + 1) % 64 == 0 or n + 1 == len(files)):
            progress(n + 1, len(files))
    if len(phases) == len(files):
        phase = np.stack(phases)
        unit = usual_phase_unit(files[0].parent, phase.ravel())
        s = np.abs(s) * np.exp(1j * (phase if unit == "radian" else np.radians(phase))).astype(np.complex64)
    return frequency, np.ascontiguousarray(s.T)


def _band(frequency: NDArray[np.float64]) -> str:
    """Number and ends of a row of frequencies [Hz], in words."""
    ends = f"{frequency_text(frequency[0])} to {frequency_text(frequency[-1])}"
    return f"{frequency.size} frequencies from {ends}"


def _step(frequency: NDArray[np.float64]) -> float:
    """Mean step of frequencies [Hz]; of a single one the frequency itself."""
    return abs(mean_step(frequency) or float(frequency[0]))


def _parameter(path: Path | SpectraInMemory, spectra: Spectra, parameter: str | None, kind: str) -> str:
    """Name of the scattering parameter to take: the given one, the only one, or that of `DEFAULTS`."""
    names = list(spectra.parameters)
    if parameter is not None:
        known = {name.upper(): name for name in names}
        if parameter.upper() not in known:
            raise InputError(f"parameter is {in_message(parameter)}, and {path} holds {listed(names)}")
        return known[parameter.upper()]
    if len(names) == 1:
        return names[0]
    if DEFAULTS[kind] in names:
        warnings.warn(
            f"the files hold {listed(names)}; {DEFAULTS[kind]} was taken, --parameter says otherwise", stacklevel=4
        )
        return DEFAULTS[kind]
    raise InputError(f"{path}: holds {listed(names)}; say which with --parameter")


def _once(lines: Sequence[FilePosition], tx: NDArray[np.intp], rx: NDArray[np.intp]) -> None:
    """Refuse two lines with the same pair of places."""
    seen: dict[tuple[int, int], FilePosition] = {}
    for line, pair in zip(lines, zip(tx.tolist(), rx.tolist(), strict=True), strict=True):
        if pair in seen:
            raise InputError(f"{line.where}: gives {line.file} the same places as {seen[pair].where}; correct one")
        seen[pair] = line


def _checked(sweep: xr.Dataset, table: Path) -> xr.Dataset:
    """Check the sweep, and return it, with a warning if the unit of its places looks wrong."""
    sweep = check_sweep(sweep, source=str(table))
    for doubt in unit_doubts(sweep):
        warnings.warn(f"{doubt.what} Say so in the headings of {table}, as in tx_x_mm, or as unit.", stacklevel=3)
    return sweep


def _attrs(scan: Scan, table: Path) -> dict[str, Any]:
    """Attributes of the sweep from the description."""
    attrs: dict[str, Any] = {"mirrorfold_kind": "sweep", "time_convention": TIME_CONVENTION}
    names = ("title", "instrument", "wave_speed", "spot_radius", "focus_distance", "polarization")
    attrs |= {name: getattr(scan, name) for name in names if getattr(scan, name) is not None}
    if scan.scene_center is not None:
        attrs["scene_center"] = np.array(scan.scene_center)
    return attrs | {"source": table.name, "processing": ["imported, one file for each position"]}


def _all_pairs(table: Path, scan: Scan, files: Files) -> xr.Dataset:
    """The sweep of one file with all pairs of the transmitters and receivers of a description."""
    if len(files) != 1:
        raise InputError(f"{table}: gives tx and rx for one file with all pairs, and {len(files)} are given")
    path = next(iter(files.values()))
    if isinstance(path, SpectraInMemory):
        raise InputError(f"{table}: gives tx and rx for a table; the antennas of a network's ports are called ports")
    contents = read_contents(path)
    if "s" not in contents.variables and contents.spectra is not None:
        pairs = sweep_of_wide_table(contents.spectra, two_ports=True)
        contents = replace(contents, variables={**contents.variables, **(pairs.variables if pairs else {})})
    if "s" not in contents.variables or "frequency" not in contents.variables:
        raise InputError(
            f"{path}: {contents.not_understood() or 'holds no pairs that are understood'}; expected columns S_1_1, "
            "S_1_2 ..., or freq, tx, rx, re, im"
        )
    contents.warn_of_columns()
    described: dict[str, Any] = {"s": {"variable": "s", "dims": list(contents.variables["s"].dims)}}
    described |= {"frequency": {"variable": "frequency", "unit": "Hz"}, "tx": scan.tx, "rx": scan.rx}
    counts = {side: _one_place_each(table, contents, described, side) for side in ("tx", "rx")}
    if "tx" in contents.variables and "pair" in contents.variables["s"].dims:
        numbers = {side: np.unique(contents.array(side), return_inverse=True) for side in counts}
        if all(numbers[side][0].size == count for side, count in counts.items()):  # places in the order of numbers
            described["pairs"] = {side: {"values": which.tolist()} for side, (_, which) in numbers.items()}
            described["pairs"]["base"] = 0
        else:
            first = min(int(values[0]) for values, _ in numbers.values())
            described["pairs"] = {"tx": "tx", "rx": "rx", "base": 0 if first == 0 else 1}
    described["time_convention"] = scan.time_convention
    sweep = assemble(contents, validated(Mapping, described, str(table)))
    return check_sweep(sweep.assign_attrs(_attrs(scan, table)), source=str(path))


def _one_place_each(table: Path, contents: Contents, described: dict[str, Any], side: str) -> int:
    """The number of places that a description gives to a side, tx or rx.

    Where the table itself holds the places of this side, the samples are in their order, and so they are taken.

    Raises
    ------
    InputError
        If table and description disagree.
    """
    places = Quantities(contents).places(described[side], side)
    name = f"{side}_position"
    if name in contents.variables:
        if not np.array_equal(np.unique(places.round(PLACE_DIGITS), axis=0), contents.array(name)):
            raise InputError(
                f"{table}: gives other places of {side} than the columns of {contents.path} hold; leave out one of them"
            )
        described[side] = {"position": name}
    return len(places)


def _all_ports(table: Path, scan: Scan, ports: Any, files: Files) -> xr.Dataset:
    """The sweep of one file with a port for each antenna."""
    if len(files) != 1:
        raise InputError(f"{table}: describes the ports of one file, and {len(files)} are given")
    path = next(iter(files.values()))
    spectra = read_spectra(path)
    places = Quantities(Contents(table, "table", {})).places(ports, "ports")
    count = len(places)
    numbered = {numbers_of(name): values for name, values in spectra.parameters.items()}
    if len(spectra.parameters) != count**2 or set(numbered) != set(product(range(1, count + 1), repeat=2)):
        raise InputError(f"{table}: gives {count} ports, and {path} holds {listed(spectra.parameters)}")
    pairs = [numbered[out, into] for into in range(1, count + 1) for out in range(1, count + 1)]
    s = np.stack(pairs, axis=-1).reshape(-1, count, count).astype(np.complex64)
    coords = {
        "frequency": ("frequency", spectra.frequency, {"units": "Hz"}),
        "tx_position": (("tx", "axis"), places, {"units": "m"}),
        "rx_position": (("rx", "axis"), places, {"units": "m"}),
        "axis": list(AXES),
    }
    s = s.conj() if scan.time_convention == "exp(-jwt)" else s
    return check_sweep(xr.Dataset({"s": (("frequency", "tx", "rx"), s)}, coords, _attrs(scan, table)), source=str(path))
