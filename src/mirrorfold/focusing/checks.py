"""Checks of a sweep, the settings and single frames; from sweep and settings follows the problem to be computed."""

from __future__ import annotations

import warnings

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mirrorfold.common.arguments import wrong_kind
from mirrorfold.common.memory import check_room
from mirrorfold.common.types import Array
from mirrorfold.common.windows import window
from mirrorfold.errors import InputError
from mirrorfold.focusing.exact.exact_sum import TABLE_BYTES
from mirrorfold.focusing.grid import default_grid, extent, scene_centre
from mirrorfold.focusing.problem import Problem, pixel_axis
from mirrorfold.focusing.settings import FocusSettings
from mirrorfold.sweep import (
    AXES_REMEDY,
    MONOSTATIC_DIMENSIONS,
    PAIR_DIMENSIONS,
    antenna_positions,
    check_sweep,
    check_waves,
    is_raster,
    misaligned_axis,
    wave_speed,
    wavenumber,
)
from mirrorfold.sweep.facts import CONJUGATED
from mirrorfold.sweep.samples import check_level, complex_samples, real_numbers

IMAGE_COPIES = 3
"""Number of complex arrays of the size of the image that focusing holds at once."""

SAME_STEP = 0.1
"""Largest deviation of a frame's frequencies from those of its plan, in frequency steps, that may be rounding."""

SAME_PLACE = 1e-3
"""Largest deviation of a frame's antenna positions from those of its plan, in wavelengths, that may be rounding."""

NEAREST_PIXEL = 1e-3
"""Distance of a pixel from an antenna, in wavelengths, below which the pixel counts as standing on the antenna."""


def make_problem(sweep: xr.Dataset, settings: FocusSettings) -> tuple[xr.Dataset, Problem]:
    """The checked sweep (or its geometry alone) at the chosen wave speed, and the focusing problem with its pixels.

    Raises
    ------
    InputError
        If the sweep or a setting cannot be used; see `focus`.
    """
    sweep = _check_measurement(sweep)
    if settings.wave_speed is not None:
        sweep = sweep.assign_attrs(wave_speed=float(settings.wave_speed))
    check_waves(sweep)
    x, y, z = settings.x, settings.y, settings.z
    monostatic = "antenna_position" in sweep.variables
    tx, rx = antenna_positions(sweep)
    centre = scene_centre(sweep)
    frequency = np.asarray(sweep["frequency"].values, dtype=np.float64)
    if len(tx) * (1 if monostatic else len(rx)) < 2 and (x is None or y is None or np.size(x) > 1 or np.size(y) < 2):
        raise InputError(
            "the sweep has one element, which sees no direction; measure at two positions at least, or ask for a range "
            "profile: a single x and many y"
        )
    if x is None or y is None:
        along = misaligned_axis(sweep)
        if along is not None:
            warnings.warn(
                f"the antennas stand along {along}: in the floor plan before them, which lies in y, they tell ranges "
                f"and hardly a direction; {AXES_REMEDY}",
                stacklevel=4,  # the line that called `focus` or `FocusPlan`
            )
        own_x, own_y = default_grid(frequency, tx, rx, wave_speed(sweep), centre=centre)
        x, y = own_x if x is None else x, own_y if y is None else y
    apodization = settings.apodization
    tx_window, rx_window = apodization if isinstance(apodization, tuple) else (apodization, apodization)
    problem = Problem(
        k=wavenumber(sweep),
        tx=tx,
        rx=rx,
        taper=window(settings.taper, frequency.size, "taper"),
        tx_weight=window(tx_window, len(tx), "apodization"),
        rx_weight=window(None if monostatic else rx_window, len(rx), "apodization"),
        x=pixel_axis(x, "x"),
        y=pixel_axis(y, "y"),
        z=pixel_axis(_height(tx, rx, centre) if z is None else z, "z"),
        monostatic=monostatic,
    )
    _check_pixels(problem, extent(frequency, tx, rx, wave_speed(sweep)).ambiguous_range, centre)
    return sweep, problem


def samples_of_frame(s: ArrayLike | xr.DataArray | xr.Dataset, problem: Problem, speed: float) -> NDArray[np.complex64]:
    """The samples of one frame as a contiguous array, checked to have the shape that the problem expects.

    Parameters
    ----------
    s : array or Dataset
        Frequencies that samples carry along, and antenna positions of a sweep, must be those of the problem.
    problem : Problem
    speed : float [m/s]
        Wave speed of the problem.

    Raises
    ------
    InputError
        If they are no finite complex numbers, of another shape, or measured at other frequencies or places.
    """
    frame = s
    if isinstance(frame, xr.Dataset):
        if "s" not in frame:
            raise wrong_kind("the frame", frame, "the samples of one frame, or a sweep of one")
        conjugated = frame.attrs.get("time_convention") == CONJUGATED
        s = np.conj(frame["s"]) if conjugated else frame["s"]
    dims = MONOSTATIC_DIMENSIONS if problem.monostatic else PAIR_DIMENSIONS
    samples = complex_samples("the frame", s, dims)
    check_level("the frame", samples)
    data = np.ascontiguousarray(samples, dtype=np.complex64)
    if data.shape != problem.data_shape:
        raise InputError(
            f"the frame has shape {data.shape}, expected {problem.data_shape} as in the plan's geometry; "
            f"transpose it to ({', '.join(dims)}) or make a plan of its own"
        )
    if not np.isfinite(data.sum()) and not np.isfinite(data).all():  # a sum takes a tenth of the time
        raise InputError("the frame holds samples that are not finite (NaN or infinite); replace them, with zero")
    if isinstance(frame, xr.DataArray | xr.Dataset):
        _check_labels(frame, problem, speed)
    return data


def _check_labels(frame: xr.DataArray | xr.Dataset, problem: Problem, speed: float) -> None:
    """Refuse a frame whose own frequencies or antenna positions are not those of the problem."""
    turns, step = problem.k / (2.0 * np.pi), problem.wavenumber_step / (2.0 * np.pi) or problem.k[0]
    places = {"antenna_position": problem.tx, "tx_position": problem.tx, "rx_position": problem.rx}
    expected = {"frequency": (turns * speed, "Hz", SAME_STEP * step * speed)}
    expected |= {name: (place, "m", SAME_PLACE / turns[-1]) for name, place in places.items()}
    for name, (wanted, unit, most) in expected.items():
        if name not in (frame if isinstance(frame, xr.Dataset) else frame.coords):
            continue
        found = real_numbers(f"the frame's {name}", frame[name], unit)
        away = np.abs(found - wanted).max() if found.shape == wanted.shape else np.inf
        if not away <= most:
            raise InputError(
                f"the frame has another {name} than the plan's sweep, up to {away:.3g} {unit} away; sort the frame as "
                "that sweep, or make a plan of its own"
            )


def _check_measurement(sweep: xr.Dataset) -> xr.Dataset:
    """Return the sweep, checked: of antenna pairs or of one moving antenna, with samples or as a geometry alone."""
    if not isinstance(sweep, xr.Dataset) or "s" in sweep:
        sweep = check_sweep(sweep)
        if is_raster(sweep):
            raise InputError("sweep: is a raster scan, which is imaged beam by beam and needs no plan; call focus")
        return sweep
    if "frequency" in sweep.variables:
        dims: tuple[str, ...] = PAIR_DIMENSIONS
        names: tuple[str, ...] = ("frequency", "tx_position", "rx_position")
        if "antenna_position" in sweep.variables:
            dims, names = MONOSTATIC_DIMENSIONS, ("frequency", "antenna_position")
        if set(names) <= set(sweep.variables):
            for name, dim in zip(names, dims, strict=True):
                if sweep[name].dims[:1] != (dim,):
                    raise InputError(f"sweep: {name} has dimensions {dict(sweep[name].sizes)}, expected {dim!r} first")
            shape = tuple(len(sweep[name]) for name in names)
            checked = check_sweep(sweep.assign(s=(dims, np.broadcast_to(np.complex64(1.0), shape))))
            return sweep.assign_coords(frequency=checked["frequency"])
    return check_sweep(sweep)


def _height(tx: Array, rx: Array, centre: Array | None) -> float:
    """Default height z [m] of the pixels: that of the scene's centre; without one, zero or the height of the array.

    The height of the array is taken where all antennas are farther from the plane z = 0 than the array is long. In the
    plane z = 0, an echo at the height z of the array and at range r would seem too near by ``z^2 / 2r``.
    """
    if centre is not None:
        return float(centre[2])
    heights = np.concatenate([tx[:, 2], rx[:, 2]])
    gap = max(float(heights.min()), -float(heights.max()), 0.0)
    length = max(float(np.linalg.norm(np.ptp(places, axis=0))) for places in (tx, rx))
    return float(0.5 * (tx[:, 2].mean() + rx[:, 2].mean())) if gap > length else 0.0


def _check_pixels(problem: Problem, ambiguous_range: float, centre: Array | None) -> None:
    """Refuse pixels on an antenna, grids all beyond the ambiguous range, and images that do not fit into memory.

    Ranges count from the radar. Where the scene has a centre they count from there, up to half the ambiguous range.
    """
    check_room(
        IMAGE_COPIES * 8.0 * problem.pixels + TABLE_BYTES,
        f"an image of {problem.pixels} pixels and its tables",
        "ask for fewer pixels",
    )
    axes = (problem.x, problem.y, problem.z)
    antennas = np.unique(np.concatenate([problem.tx, problem.rx]), axis=0)
    nearest = np.sqrt(sum(_gap(antennas[:, n], axis) ** 2 for n, axis in enumerate(axes)))
    wavelength = 2.0 * np.pi / float(problem.k[-1])
    if nearest.min() < NEAREST_PIXEL * wavelength:
        spot = ", ".join(f"{value:g}" for value in antennas[int(np.argmin(nearest))])
        raise InputError(f"a pixel stands on the antenna at ({spot}) m; move or shorten the grid")
    origin_name, origin = "the radar", problem.radar_position
    if centre is not None:
        origin_name, origin, ambiguous_range = "the centre of the scene", centre, 0.5 * ambiguous_range
    spans = [np.abs(axis - origin[n]) for n, axis in enumerate(axes)]
    closest = float(np.sqrt(sum(span.min() ** 2 for span in spans)))
    if closest > ambiguous_range:
        raise InputError(
            f"the grid begins {closest:.3g} m from {origin_name}, beyond the ambiguous range of "
            f"{ambiguous_range:.3g} m; move it nearer, or measure with a smaller frequency step"
        )
    beyond = [name for name, span in zip("xyz", spans, strict=True) if span.max() > ambiguous_range]
    if beyond:
        warnings.warn(
            f"{' and '.join(beyond)} {'reach' if len(beyond) > 1 else 'reaches'} beyond the ambiguous range of "
            f"{ambiguous_range:.3g} m: what is imaged there also stands nearer by that range",
            stacklevel=5,  # the line that called `focus` or `FocusPlan`
        )


def _gap(places: Array, axis: Array) -> Array:
    """Distance (n,) [m] of each place (n,) [m] from the nearest coordinate of an axis [m]."""
    sorted_axis = np.sort(axis)
    after = np.searchsorted(sorted_axis, places)
    before, after = (np.clip(n, 0, sorted_axis.size - 1) for n in (after - 1, after))
    return np.asarray(np.minimum(np.abs(places - sorted_axis[before]), np.abs(places - sorted_axis[after])))
