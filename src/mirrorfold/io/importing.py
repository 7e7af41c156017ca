"""Import of measured data as sweeps: the verb ``import``."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from mirrorfold.common.arguments import in_message, is_boolean, path_of, wrong_kind
from mirrorfold.common.reading import quoting_nothing_outside
from mirrorfold.common.types import Progress
from mirrorfold.errors import InputError
from mirrorfold.io.mapping.assembly import assemble, join
from mirrorfold.io.mapping.model import Mapping, load_mapping, shipped
from mirrorfold.io.readers import Contents, read_contents
from mirrorfold.io.readers.contents import listed
from mirrorfold.io.scans.networks import networks_by_name
from mirrorfold.io.scans.scan import import_scan
from mirrorfold.sweep import check_sweep

POSITIONS = ("scan.toml", "scan.json", "positions.toml", "positions.json", "positions.csv")
"""Names under which the table of positions is searched in the folder of a scan."""


@quoting_nothing_outside()
def import_data(
    files: str | Path | Sequence[str | Path] | Any,
    *,
    mapping: str | Path | dict[str, Any] | Mapping | None = None,
    positions: str | Path | dict[str, Any] | None = None,
    parameter: str | None = None,
    reader: str | None = None,
    frame: int | str | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Read measured data of any origin as a sweep.

    Parameters
    ----------
    files : path or list of paths; or skrf.Network, skrf.NetworkSet or list of Networks
        One file, several files that a mapping joins, or the files or the folder of a scan with one file for each
        position. Networks of scikit-rf are treated like Touchstone files of their names.
    mapping : path, name or dict, optional
        A description of what the variables are: a mapping file, the name of a shipped one, or its content. By default
        what the file says itself, or the shipped mapping that fits.
    positions : path or dict, optional
        Table (CSV, TOML or JSON) with the positions of the antennas for each file, or the content of such a TOML file.
        In a folder it is found by its name, such as ``positions.csv`` or ``scan.toml``.
    parameter : str, optional
        For a scan: the scattering parameter to read, such as ``"S21"``; needed if the files hold several.
    reader : str, optional
        Format of the files; by default it is recognised.
    frame : int or "mean", optional
        For a recording of several frames: the frame to keep, or their mean; by default all frames.
    progress : callable (done, total), optional

    Returns
    -------
    xarray.Dataset
        The sweep, in the convention ``exp(+jwt)`` and SI units.

    Raises
    ------
    InputError
        If a file cannot be read, or something needed is missing or does not fit together. The message tells the file,
        the line if there is one, and the remedy.
    """
    networks = networks_by_name(files)
    if networks is not None:
        if positions is None or mapping is not None:
            raise InputError(
                f"{len(networks)} networks are given and nothing says where their antennas stood; give positions, a "
                "table or a dict that names each network, or the ports of one, and no mapping"
            )
        sweep = import_scan(networks, positions=positions, parameter=parameter, progress=progress)
        return sweep if frame is None else _one_frame(sweep, frame)
    given = [files] if isinstance(files, str | Path) or not isinstance(files, Sequence) else files
    for one in given:
        if not isinstance(one, str | Path):
            raise wrong_kind("import_data", one, "the path of a file, or a list of them")
    paths = [path_of("import_data", one) for one in given]
    sweep = _import(paths, mapping, positions, parameter, reader, progress)
    return sweep if frame is None else _one_frame(sweep, frame)


def _one_frame(sweep: xr.Dataset, frame: int | str) -> xr.Dataset:
    """One frame of a recording, or the mean of all frames."""
    if "frame" not in sweep["s"].dims:
        raise InputError(
            f"frame is {in_message(frame)}, and the samples have the dimensions {sweep['s'].dims}; leave it out"
        )
    count = sweep.sizes["frame"]
    if isinstance(frame, str) and frame == "mean":
        s = sweep["s"].mean("frame").astype("complex64")
        return check_sweep(sweep.drop_vars("s").assign(s=s))
    if is_boolean(frame) or not isinstance(frame, int | np.integer) or not -count <= frame < count:
        raise InputError(f"frame is {in_message(frame)}, expected a number from 0 to {count - 1}, or 'mean'")
    return sweep.isel(frame=frame)


def _import(
    paths: list[Path],
    mapping: str | Path | dict[str, Any] | Mapping | None,
    positions: str | Path | dict[str, Any] | None,
    parameter: str | None,
    reader: str | None,
    progress: Progress | None,
) -> xr.Dataset:
    """The sweep in files, with all its frames; the arguments are those of `import_data`."""
    if not paths:
        raise InputError("no files are given; name the files to import")
    if positions is None and mapping is None and len(paths) == 1 and paths[0].is_dir():
        positions = next((paths[0] / name for name in POSITIONS if (paths[0] / name).is_file()), None)
    if positions is not None or _is_description(paths):
        if mapping is not None:
            raise InputError("mapping and positions are both given; a scan of files needs positions alone")
        return import_scan(paths, positions=positions, parameter=parameter, progress=progress)
    if parameter is not None:
        raise InputError("parameter is given without positions; give the table that says where the antennas stood")
    chosen = None if mapping is None else load_mapping(mapping)
    if reader is None and chosen is not None:
        reader = chosen.reader
    sweeps = []
    for done, path in enumerate(paths):
        contents = read_contents(path, reader)
        sweeps.append(_sweep(contents, chosen))
        if progress is not None:
            progress(done + 1, len(paths))
    if len(sweeps) == 1:
        return sweeps[0]
    if chosen is None or chosen.join is None:
        raise InputError(
            f"{len(paths)} files are given and nothing says how they belong together; import them one by one, or set "
            "join in the mapping, or give --positions for a scan of one file for each position, or --polarization "
            "TE,TM for a file of each polarization"
        )
    return join(sweeps, chosen.join, [str(path) for path in paths])


def _is_description(paths: list[Path]) -> bool:
    """Whether a single path is given, that of a description of a scan in JSON."""
    return len(paths) == 1 and paths[0].suffix.lower() == ".json"


def _sweep(contents: Contents, mapping: Mapping | None) -> xr.Dataset:
    """The sweep in the contents of one file, by a mapping, by what the file says itself, or by a shipped mapping."""
    if mapping is not None:
        return assemble(contents, mapping)
    if contents.mapping is not None:
        contents.warn_of_columns()
        return assemble(contents, load_mapping(dict(contents.mapping)))
    if {"s", "frequency"} <= set(contents.variables) and contents.reader == "hdf5":
        from mirrorfold.io.own.netcdf import read

        return _as_sweep(read(contents.path), contents.path)
    if contents.spectra is not None:
        unread = contents.not_understood()
        raise InputError(
            f"{contents.path}: holds {listed(contents.spectra.parameters)} and no positions that are understood"
            f"{f' ({unread})' if unread else ''}; give --positions, a table that says where the antennas stood for "
            "each file, or of one file with all pairs the place of each antenna (antenna, x_mm, y_mm)"
        )
    if (sweep := _known(contents)) is not None:
        return sweep
    held = listed(contents.variables) or "none"
    what = contents.not_understood() or f"does not say what its variables are ({held})"
    raise InputError(
        f"{contents.path}: {what}; give --mapping FILE, which `mirrorfold import --guess {contents.path}` proposes, or "
        "--image NAME where it holds an image"
    )


def _known(contents: Contents) -> xr.Dataset | None:
    """The sweep in a file whose variables fit exactly one of the shipped mappings; None where none or several fit."""
    found = []
    for name in shipped():
        with suppress(InputError):
            found.append(assemble(contents, load_mapping(name)))
    return found[0] if len(found) == 1 else None


def _as_sweep(found: Any, path: Path) -> xr.Dataset:
    """Refuse what was read from a file if it is no sweep."""
    if not isinstance(found, xr.Dataset):
        raise InputError(f"{path}: holds no sweep; fold and score read it as it is")
    return found
