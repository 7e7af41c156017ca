"""The verb `calibrate`: its options in the order in which they are applied."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

import mirrorfold as mf
from mirrorfold.cli.forecast import show_forecast
from mirrorfold.cli.options import Numbers, OptionalOutput, command, parse_numbers
from mirrorfold.cli.terminal import progress, say, show_files, show_json
from mirrorfold.cli.writing import netcdf_file, output_file, required
from mirrorfold.common.records import LEFT_OUT, Number, Record, fact
from mirrorfold.common.units import FARTHEST, Length, Memory
from mirrorfold.errors import InputError

if TYPE_CHECKING:
    import xarray as xr

    from mirrorfold.calibration.elements import ElementCalibration

    Corrected = tuple[xr.Dataset, dict[str, Any], ElementCalibration | None]
    """A corrected sweep, found facts of `Calibration`, and the calibration of the elements if it was found."""


CABLE_ERROR = 0.1
"""Largest error of a given length of cable that a sphere may correct, as a share of the length. The length may come
from the velocity factor of a catalogue, from a measurement by hand, or from what `info` reads from the waves."""


class Calibration(Record):
    """A calibrated sweep."""

    kind: Literal["sweep"]
    processing: list[str] = fact("every step so far")
    rx_displacement_m: list[float] | None = fact(default=LEFT_OUT)
    rx_displacement_error_m: list[Number] | None = fact(
        "standard errors by what the receivers disagree; none where the places of the sphere do not tell",
        default=LEFT_OUT,
    )
    cable_length_m: Number = fact("electrical length that all pairs share, by the sphere", default=LEFT_OUT)
    cable_period_m: Number = fact("length of cable that the sweep cannot tell from none, c / df", default=LEFT_OUT)
    elements_residual_m: Number = fact(default=LEFT_OUT)
    silent_tx: int | None = fact(default=LEFT_OUT)
    silent_rx: int | None = fact(default=LEFT_OUT)
    files: list[str] = fact("what was written")


def calibrate(
    sweep: Path,
    *,
    output: OptionalOutput = None,
    frequency_unit: str | None = None,
    sort_frequencies: bool = False,
    swap_axes: str | None = None,
    conjugate: bool = False,
    swap_iq: bool = False,
    reverse_frequency: bool = False,
    position_unit: str | None = None,
    angle_unit: str | None = None,
    swap_tx_rx: bool = False,
    mask: bool = False,
    background: Path | None = None,
    match_background: bool = False,
    scan_mean: bool = False,
    reference: Path | None = None,
    reference_at: Numbers = None,
    reference_normal: Numbers = None,
    reference_per_channel: bool = False,
    cable_length: Length | None = None,
    sphere: list[Path] | None = None,
    sphere_at: Annotated[list[str] | None, Parameter(allow_leading_hyphen=True)] = None,
    sphere_radius: Length = 0.0,
    save_elements: Path | None = None,
    elements: Path | None = None,
    find_displacement: bool = False,
    rx_displacement: Numbers = None,
    gate: Numbers = None,
    autofocus: bool = False,
    memory_limit: Memory | None = None,
    dry_run: bool = False,
    json: bool = False,
) -> None:
    """Calibrate a sweep.

    Parameters
    ----------
    sweep
        Sweep to read (netCDF).
    output
        Calibrated sweep to write; its history lists every step, in the order of these options. A dry run needs none.
    frequency_unit
        Unit that the frequencies were stored in, such as GHz; they are converted to hertz.
    sort_frequencies
        Put falling frequencies in rising order, samples and all.
    swap_axes
        Two axes of the samples to exchange, which were named the wrong way round, as frequency,tx.
    conjugate
        Conjugate the samples: they were stored with the time convention exp(-jwt).
    swap_iq
        Exchange I and Q, the real and the imaginary part of the samples.
    reverse_frequency
        Reverse the samples along frequency: they were stored from the highest to the lowest.
    position_unit
        Unit that the positions were stored in, such as mm; they are converted to metres.
    angle_unit
        Unit that the directions of a raster scan were stored in, such as radian; they are converted to degrees.
    swap_tx_rx
        Exchange the positions of transmitters and receivers.
    mask
        Set bad channels to zero and fill in bad frequencies.
    background
        Sweep to subtract from the sweep and from that of the sphere, measured without a scene or in front of absorber.
        Everything in it is removed, so a wall that is to serve as a mirror must not be in it.
    match_background
        Fit gain and phase of the background first.
    scan_mean
        Subtract what all channels have in common: leakage.
    reference
        Sweep of a reflector to divide by.
    reference_at
        Position of the apex of the reflector, or of a point of the plate, as X,Y or X,Y,Z [m].
    reference_normal
        Normal of the plate as X,Y or X,Y,Z; without it the reflector is point-like.
    reference_per_channel
        Divide each pair by its own response.
    cable_length
        Electrical length of cable to remove, there and back together [m]. With a sphere it need not be given; if it
        is, the sphere corrects it by a tenth at most.
    sphere
        Sweep of a sphere, from which to calibrate the elements and the cables; several for several positions.
    sphere_at
        Centre of the sphere as X,Y or X,Y,Z [m], one for each sweep of it.
    sphere_radius
        Radius of the sphere [m].
    save_elements
        File to write the calibration of the elements to (JSON).
    elements
        Calibration of the elements that --save-elements has written (JSON).
    find_displacement
        Estimate from the sphere the displacement of the whole receiving aperture, instead of a delay of each element.
    rx_displacement
        Vector to move all receivers by, as X,Y or X,Y,Z [m].
    gate
        Ranges to keep, as START:STOP [m]; START or STOP may be left out.
    autofocus
        Remove small position errors that blur the image.
    memory_limit
        Memory that the process may hold in all; work that needs more is refused before it begins [B].
    dry_run
        Print the memory that each part of the work would need; write nothing.
    json
        Print the history and the files as one JSON object.
    """
    from scipy.constants import speed_of_light

    from mirrorfold.calibration.memory import calibration_parts
    from mirrorfold.calibration.record import check_same_steps
    from mirrorfold.common.forecasts import expect, forecast
    from mirrorfold.sweep import ambiguous_range, wave_speed

    _check_options(locals())
    if not dry_run:
        output = required(output, "clean.nc")
    inputs = [sweep, background, reference, elements, *(sphere or [])]
    if output is not None:
        netcdf_file(output, inputs=inputs)
        if save_elements is not None:
            output_file(save_elements, inputs=[*inputs, output])
    gate_ranges = parse_gate(gate) if gate is not None else None
    displacement = parse_place(rx_displacement, "rx-displacement") if rx_displacement is not None else None
    places = [parse_place(text, "sphere-at") for text in sphere_at or []]
    apex = parse_place(reference_at, "reference-at") if reference_at is not None else None
    normal = parse_place(reference_normal, "reference-normal") if reference_normal is not None else None

    def repaired(path: Path) -> xr.Dataset:
        """A sweep with its mistakes corrected; all sweeps of one measurement session have the same mistakes."""
        found = read_as_is(path)
        found = mf.calibrate.scale_frequencies(found, frequency_unit) if frequency_unit else found
        found = mf.calibrate.sort_frequencies(found) if sort_frequencies else found
        found = mf.calibrate.swap_axes(found, tuple(swap_axes.split(","))) if swap_axes else found
        found = mf.calibrate.mask_bad(found) if mask else found
        found = mf.calibrate.scale_angles(found, angle_unit) if angle_unit else found
        found = mf.calibrate.scale_positions(found, position_unit) if position_unit else found
        found = mf.check_sweep(found, source=str(path))
        for wanted, repair in (
            (conjugate, mf.calibrate.conjugate),
            (swap_iq, mf.calibrate.swap_iq),
            (reverse_frequency, mf.calibrate.reverse_frequency),
            (swap_tx_rx, mf.calibrate.swap_tx_rx),
        ):
            found = repair(found) if wanted else found
        return found

    measured = repaired(sweep)
    steps = {"background": bool(background), "reference": bool(reference), "per_channel": reference_per_channel}
    steps["changed"] = any((conjugate, swap_iq, reverse_frequency, scan_mean, cable_length, gate, elements))
    parts = calibration_parts(measured, **steps, spheres=len(sphere or ()), mask=mask, autofocus=autofocus)
    remedy = "take fewer steps at a time, close other programs, or raise the limit"
    samples = 8.0 * measured["s"].size
    expect(parts, f"{sweep}: the steps of the calibration", remedy, held=samples, limit=memory_limit)
    if dry_run or output is None:
        show_forecast(forecast(parts), json=json)
        return
    empty = repaired(background) if background else None
    if background and empty is not None and not empty.attrs.get("title"):
        empty = empty.assign_attrs(title=background.name)
    response = repaired(reference) if reference else None

    def prepared(one: xr.Dataset) -> xr.Dataset:
        """A repaired sweep with the background subtracted and the response of the instrument removed."""
        if empty is not None:
            one = mf.calibrate.subtract_background(one, empty, match=match_background)
        one = mf.calibrate.subtract_mean(one) if scan_mean else one
        if response is not None:
            one = mf.calibrate.normalise_by_reference(
                one, response, at=apex or (), normal=normal, per_channel=reference_per_channel
            )
        return mf.calibrate.remove_cable(one, cable_length) if cable_length is not None else one

    waiting, as_measured = [measured], measured.drop_vars("s")
    del measured  # so that a sweep is freed as soon as a step has replaced it
    result = prepared(waiting.pop())
    facts: dict[str, Any] = {}
    found: ElementCalibration | None = None
    with progress("calibrating") as report:
        electrical = speed_of_light / wave_speed(result)  # lengths of cable refer to the speed of light in vacuum
        known: dict[str, Any] = {"at": places, "radius": sphere_radius}
        if cable_length:
            known["largest_common"] = CABLE_ERROR * abs(cable_length) / electrical
        if sphere:
            spheres = []
            for path in sphere:
                one = repaired(path)
                check_same_steps(as_measured, one, "sphere")
                spheres.append(prepared(one))
                del one
            empty = response = None
            facts["cable_period_m"] = 2.0 * ambiguous_range(result) * electrical
            correct = _displaced_by if find_displacement else _corrected_by
            result, told, found = correct(result, spheres, known, electrical)
            facts |= told
        if elements is not None:
            result = mf.calibrate.apply_elements(result, mf.calibrate.load_elements(elements))
        result = mf.calibrate.displace_receivers(result, displacement) if displacement is not None else result
        result = mf.calibrate.time_gate(result, *gate_ranges) if gate_ranges is not None else result
        result = mf.calibrate.autofocus(result, progress=report) if autofocus else result
    files = [mf.save(result.assign_attrs(command=command.get()), output)]
    if save_elements is not None and found is not None:
        files.append(mf.calibrate.save_elements(found, save_elements))
    history = [str(step) for step in result.attrs.get("processing", [])]
    if json:
        show_json(Calibration(kind="sweep", processing=history, **facts, files=list(map(str, files))))
        return
    for step in history:
        say(step)
    if "rx_displacement_m" in facts:
        errors = [f"{1e3 * one:.2g}" if math.isfinite(one) else "unknown" for one in facts["rx_displacement_error_m"]]
        say(f"standard errors of the displacement: {', '.join(errors)} mm")
        say(f"the length of cable is known modulo {facts['cable_period_m']:.6g} m")
    if "elements_residual_m" in facts:
        say(f"left unexplained by the elements: {1e6 * facts['elements_residual_m']:.3g} um")
    show_files(files)


def _displaced_by(sweep: xr.Dataset, spheres: list[xr.Dataset], known: dict[str, Any], electrical: float) -> Corrected:
    """The sweep with its receivers displaced, all alike, and its cable removed as sweeps of a sphere tell.

    `known` tells where the sphere was, and how large; a length of cable is `electrical` times that of the waves.
    """
    from mirrorfold.calibration.displacement import fit_displacement

    vector, length, error = fit_displacement(spheres, **known)
    facts = {"rx_displacement_m": vector.tolist(), "rx_displacement_error_m": error.tolist()}
    moved = mf.calibrate.remove_cable(mf.calibrate.displace_receivers(sweep, vector), length * electrical)
    return moved, facts | {"cable_length_m": length * electrical}, None


def _corrected_by(sweep: xr.Dataset, spheres: list[xr.Dataset], known: dict[str, Any], electrical: float) -> Corrected:
    """As `_displaced_by`, with a delay and a gain of each element; the sweeps of the sphere are freed."""
    found = mf.calibrate.estimate_elements(spheres, **known)
    spheres.clear()
    facts = {
        "cable_length_m": found.common_delay * electrical,
        "elements_residual_m": found.residual,
        "silent_tx": int((~found.tx_valid).sum()),
        "silent_rx": int((~found.rx_valid).sum()),
    }
    return mf.calibrate.apply_elements(sweep, found), facts, found


def _check_options(given: dict[str, Any]) -> None:
    """Refuse options that lack another option that they need, before the work begins.

    Raises
    ------
    InputError
        With the option that is missing.
    """
    needs = (
        ("match_background", "background"),
        ("reference", "reference_at"),
        ("reference_at", "reference"),
        ("reference_normal", "reference"),
        ("reference_per_channel", "reference"),
        ("sphere", "sphere_at"),
        ("sphere_at", "sphere"),
        ("sphere_radius", "sphere"),
        ("save_elements", "sphere"),
        ("find_displacement", "sphere"),
    )
    for option, other in needs:
        if given[option] and not given[other]:
            words = [name.replace("_", "-") for name in (option, other)]
            raise InputError(f"--{words[0]} needs --{words[1]} too; give it, or leave --{words[0]} out")
    if given["find_displacement"] and given["save_elements"]:
        raise InputError("--find-displacement finds one vector and no delays of elements; leave --save-elements out")
    if given["sphere"] and len(given["sphere"]) != len(given["sphere_at"]):
        raise InputError(
            f"--sphere is given {len(given['sphere'])} times and --sphere-at {len(given['sphere_at'])} times; "
            "give one place for each sweep"
        )


def read_as_is(path: Path) -> xr.Dataset:
    """The sweep in a file; its samples or the order of its frequencies may be wrong, because they are to be repaired.

    Raises
    ------
    InputError
        If the file holds something else.
    """
    from mirrorfold.cli.results import read
    from mirrorfold.io.own.netcdf import read_unchecked

    try:
        return read(path, "sweep")
    except InputError:
        if path.suffix.lower() == ".toml":
            raise
        found = read_unchecked(path)
        if "s" not in found or "image" in found or found["s"].dtype.kind != "c":
            raise
        return found


def parse_place(text: str, name: str) -> tuple[float, ...]:
    """A position or direction from the text X,Y or X,Y,Z; `name` is that of the option.

    Raises
    ------
    InputError
        If the text is not two or three numbers, or names a place that is impossibly far away.
    """
    form = "X,Y or X,Y,Z in metres or with units, for example 0,1.5 or 0,150cm"
    place = tuple(parse_numbers(text, name, form, "length", mark=","))
    if len(place) not in (2, 3):
        raise InputError(f"--{name} is {text!r}, expected {form}")
    if max(map(abs, place)) > FARTHEST:
        raise InputError(f"--{name} is {text!r}, farther away than {FARTHEST:g} m; expected {form}")
    return place


def parse_gate(text: str) -> tuple[float | None, float | None]:
    """First and last range [m] from the text START:STOP; None for a side that is empty.

    Raises
    ------
    InputError
        If the text is something else.
    """
    form = "START:STOP in metres or with units, for example 0.3:4 or 30cm:"
    sides = text.split(":")
    given = [side for side in sides if side.strip()]
    numbers = parse_numbers(":".join(given), "gate", form, "length") if given else []
    if len(sides) != 2:
        raise InputError(f"--gate is {text!r}, expected {form}")
    start, stop = (numbers.pop(0) if side.strip() else None for side in sides)
    return start, stop
