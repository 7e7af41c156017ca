"""The verbs ``import``, for measured data of any lab, and ``export``, for other programs."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import mirrorfold as mf
from mirrorfold.cli.options import Frame, OptionalOutput, Output, command
from mirrorfold.cli.terminal import progress, remark, say, show_files, show_info, show_json
from mirrorfold.cli.writing import netcdf_file, output_directory, output_file, required
from mirrorfold.common.records import Record, fact
from mirrorfold.common.units import Length
from mirrorfold.errors import InputError

if TYPE_CHECKING:
    import xarray as xr


class InferredFact(Record):
    """One line of a proposed mapping."""

    what: str
    sure: str
    why: str


class MappingProposal(Record):
    """A proposed mapping, of ``import --guess``."""

    kind: Literal["mapping"]
    findings: list[InferredFact]
    missing: list[str] = fact("what could not be found")
    works: str | None = fact("what the mapping makes of the file; null if something is missing")
    mapping: str = fact("the text (TOML)")
    files: list[str] = fact("what was written")


class Exported(Record):
    """A file for other programs."""

    kind: Literal["export"]
    format: str = fact("its suffix, such as vtp")
    files: list[str] = fact("what was written")


class TouchstoneScan(Record):
    """A folder of Touchstone files."""

    kind: Literal["scan"]
    positions: str = fact("the table of the positions")
    files: list[str] = fact("what was written")


def import_(
    *files: Path,
    output: OptionalOutput = None,
    mapping: str | None = None,
    positions: Path | None = None,
    parameter: str | None = None,
    reader: str | None = None,
    frame: int | Literal["mean"] | None = None,
    polarization: str | None = None,
    guess: bool = False,
    image: str | None = None,
    x: str | None = None,
    y: str | None = None,
    z: str | None = None,
    order: str | None = None,
    unit: str = "m",
    decibel: bool = False,
    cell: Length | None = None,
    json: bool = False,
) -> None:
    """Import measured data.

    Parameters
    ----------
    files
        Files, or the folder of a scan: Touchstone, MATLAB, HDF5, netCDF, NumPy, CSV, CITI; images and point clouds.
    output
        Sweep or image to write (netCDF); with --guess the mapping file (TOML).
    mapping
        Mapping file (TOML) that says what the variables mean, or the name of a shipped one: arim, gotcha, merit. Files
        of acconeer need none.
    positions
        Table (CSV) or description (TOML, JSON) of where the antennas stood for each file.
    parameter
        Scattering parameter to take from files with several, such as S21.
    reader
        Format of the files, if it is not recognised.
    frame
        Frame to keep of a recording with several, or mean for the mean of all.
    polarization
        Polarization of each file, folder or sweep, TE (E along the vertical axis) or TM (E in the floor plan):
        `mirrorfold import te.nc tm.nc --polarization TE,TM -o both.nc` makes one sweep of two. The other options apply
        to each of them.
    guess
        Propose a mapping: print what was inferred, how sure each finding is, and the text of the mapping file.
    image
        Name of the variable with an image; imports an image instead of a sweep.
    x
        Name of the variable with the cross-range of the pixels, if it is not recognised.
    y
        Name of the variable with the range of the pixels, likewise.
    z
        Name of the variable with the height of the pixels, likewise.
    order
        Order of the axes of an image in the file, such as xy.
    unit
        Unit of the coordinates of an image or point cloud.
    decibel
        The amplitudes of the image or points are in dB.
    cell
        Width of the cells of the grid on which a point cloud is put [m].
    json
        Print what was found as one JSON object.
    """
    from mirrorfold.sweep import unit_doubts

    if not files:
        raise InputError("no files are given; name the files to import, or the folder of a scan")
    if output is not None:
        (output_file if guess else netcdf_file)(
            output, inputs=[*files, positions, None if mapping is None else Path(mapping)]
        )
    if polarization is not None and (guess or image is not None):
        raise InputError("--polarization is that of sweeps; leave it out, or --guess and --image")
    if guess:
        _guess(list(files), output, reader, json=json)
        return
    output = required(output, "sweep.nc")
    notes: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = lambda message, *_, **__: notes.append(str(message))
        if image is not None or _is_image(list(files), mapping, positions):
            if len(files) != 1:
                raise InputError(f"{len(files)} files are given, expected one image or point cloud")
            options: dict[str, Any] = {"image": image, "x": x, "y": y, "z": z, "order": order}
            found: Any = mf.import_image(files[0], **options, unit=unit, decibel=decibel, cell=cell)
        else:
            with progress("importing") as report:
                read = partial(
                    mf.import_data, mapping=mapping, positions=positions, parameter=parameter, reader=reader,
                    frame=frame, progress=report,
                )  # fmt: skip
                found = read(list(files)) if polarization is None else _polarized(files, polarization, read)
    mf.save(found.assign_attrs(command=command.get()), output)
    facts = mf.info(found)
    findings = facts.get("findings", ())
    # `facts.remarks` repeats the warnings of findings, with their remedy. A finding is surer than what lengths suggest.
    named = [finding.what for finding in findings]
    guesses = unit_doubts(found) if findings else []
    named += [guess.what for guess in guesses if guess.name in {finding.name for finding in findings}]
    notes = [one for one in notes if not any(one.startswith(what) for what in named)]
    remarks = [*notes, *facts.remarks]
    remark(remarks)
    if json:
        show_json(facts.but(remarks=remarks, files=[str(output)]))
        return
    show_info(facts.but(remarks=[]))
    show_files([output])


def _polarized(files: Sequence[Path], text: str, read: Callable[[Path], xr.Dataset]) -> xr.Dataset:
    """One sweep from files that were measured with one polarization each.

    Parameters
    ----------
    files : list of path
    text : str
        Names of the polarizations of the files, in their order, such as ``TE,TM``.
    read : callable
        Reads the sweep of a file.

    Raises
    ------
    InputError
        If there is not one name for each file, or the sweeps do not fit together.
    """
    from mirrorfold.common.slabs import POLARIZATIONS
    from mirrorfold.sweep.polarization import join_polarizations

    names = [name.strip() for name in text.split(",")]
    if not set(names) <= set(POLARIZATIONS) or len(set(names)) != len(names):
        raise InputError(f"--polarization is {text!r}, expected TE, TM, or both in the order of the files, as TE,TM")
    if len(names) != len(files):
        raise InputError(
            f"{len(files)} files are given and --polarization has {len(names)} of them, {text}; name one for each file"
        )
    sweeps = {name: read(file) for name, file in zip(names, files, strict=True)}
    if len(names) > 1:
        return join_polarizations(sweeps)
    (sweep,) = sweeps.values()
    if (said := sweep.attrs.get("polarization", names[0])) != names[0]:
        raise InputError(f"{files[0]}: says of itself that its polarization is {said}, not {names[0]}; name that one")
    return sweep.assign_attrs(polarization=names[0])


def _is_image(files: list[Path], mapping: str | None, positions: Path | None) -> bool:
    """Whether the files are point clouds, which are imported as images."""
    from mirrorfold.io.images import is_cloud

    return mapping is None and positions is None and all(map(is_cloud, files))


def _guess(files: list[Path], output: Path | None, reader: str | None, *, json: bool) -> None:
    """Propose a mapping for the first file: print it, and write it if an output is given."""
    from mirrorfold.io.files import written_atomically
    from mirrorfold.io.guessing.guess import guess_mapping

    found = guess_mapping(files[0], reader=reader)
    text = found.to_toml()
    if output is not None:
        with written_atomically(output) as temporary:
            temporary.write_text(text, encoding="utf-8")
    written = [] if output is None else [str(output)]
    if json:
        findings = [InferredFact(**vars(finding)) for finding in found.findings]
        proposal = MappingProposal(
            kind="mapping", findings=findings, missing=found.missing, works=found.works, mapping=text, files=written
        )
        show_json(proposal)
        return
    say(text, end="")
    works = f"this makes {found.works}" if found.works else "this is not complete yet: see TO DO"
    remark([works])
    show_files(written)


def export(
    file: Path,
    *,
    output: Output,
    what: Literal["points", "mirrors"] = "points",
    min_confidence: float | None = None,
    frame: Frame = None,
    json: bool = False,
) -> None:
    """Export a file.

    Parameters
    ----------
    file
        Sweep, image or reconstruction (netCDF).
    output
        For a sweep, a folder: a Touchstone file for each position, and a table of the positions. For a reconstruction,
        a file: points (.ply, .pcd, .csv, .xyz, .vtp), pictures (.vti), floor plan (.dxf, .geojson). For an image .vti,
        for the volume of a raster scan .vts.
    what
        Content of a .vtp file of a reconstruction: its points, or its mirrors as walls, with their images.
    min_confidence
        Least confidence of points that are written, from 0 to 1; by default as the reconstruction was folded.
    json
        Print what was written as one JSON object.
    """
    from mirrorfold.cli.results import read
    from mirrorfold.io.exports.scan_folder import DESCRIPTION, POSITIONS
    from mirrorfold.io.suffixes import check_suffix

    found = read(file, "sweep", "image", "reconstruction")
    if frame is not None or hasattr(found, "s"):
        found = mf.pick_frame(found, frame)
    if not hasattr(found, "s"):
        output_file(output, inputs=[file])
        mf.export(found, output, what=what, min_confidence=min_confidence)
        if json:
            show_json(Exported(kind="export", format=output.suffix.lower().lstrip("."), files=[str(output)]))
            return
        show_files([output])
        return
    check_suffix(output, "a sweep is exported as a folder of Touchstone files")
    output_directory(output, names=(POSITIONS, DESCRIPTION), inputs=[file])
    with progress("writing the scan") as report:
        positions = mf.save_touchstone(found, output, progress=report)
    if json:
        show_json(TouchstoneScan(kind="scan", positions=str(positions), files=[str(output)]))
        return
    show_files([output])
    say(f"read it back with: mirrorfold import {output} --positions {positions} -o sweep.nc")
