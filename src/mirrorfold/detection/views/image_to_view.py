"""The radar's own view of an image, made from its pixels and from what its attributes tell of the radar."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.constants import speed_of_light

from mirrorfold.common.arguments import one_of
from mirrorfold.common.facts import radar_place, tells_band
from mirrorfold.common.geometry import turned, unit
from mirrorfold.common.memory import check_room
from mirrorfold.common.normalization import RANGE_POWERS
from mirrorfold.common.types import Array
from mirrorfold.common.windows import MOST_WEIGHTS, cell_of, half_amplitude_width, known_weights
from mirrorfold.detection.echoes import noise_level
from mirrorfold.detection.views.complex_image import ComplexImage
from mirrorfold.detection.views.image_view import LARGEST_SINE, SAMPLES_PER_CELL, UNIFORM_CELL, ImageView, uniform_cell
from mirrorfold.detection.views.resampling import interpolated, sampled
from mirrorfold.detection.views.view import check_samples
from mirrorfold.errors import InputError

SAMPLE_BYTES = 64
"""Memory [bytes] of a polar sample during resampling: its position, its pixel coordinates, real and imaginary part."""


def to_image_view(image: xr.DataArray, *, normalization: str | None = None) -> ImageView:
    """Resample an image to the radar's view and undo the decay of amplitudes with range.

    The attrs of the image tell what is known of the radar: `radar_position`, `array_direction`, `frequency_start`,
    `frequency_stop`, `frequency_points`, `tx_aperture`, `rx_aperture` [m], `ambiguous_range` [m], `monostatic` if one
    antenna both sends and receives, and `normalization`, which was applied already. Where they are missing, the radar
    is taken to stand at the origin with its array along x, and two pixels to make a resolution cell.
    Complex images are demodulated before they are interpolated. The `normalization`, "r", "none" or "r2", is by default
    "r": the amplitude of a line source falls as ``1/sqrt(r)``, there and back.

    Raises
    ------
    InputError
        If the image cannot be used; see `check_samples`.
    """
    view = outline_of(image, normalization)
    axes = tuple(image[name].values.astype(float) for name in "xy")
    amplitude = sampled(view, image, axes).astype(np.float64)
    done = one_of("image: normalization", str(image.attrs.get("normalization", "none")), RANGE_POWERS)
    amplitude *= view.range[:, None] ** float(view.power - RANGE_POWERS[done])
    blank = image.values == 0
    if blank.any():  # masked pixels stay empty: splines overshoot beside the edges of a mask
        amplitude[interpolated(view, blank, axes, order=0)] = 0.0
    waves = ComplexImage.of(image, view)
    return replace(view, amplitude=amplitude, noisy=noise_level(image.values) > 0.0, waves=waves)


def outline_of(image: xr.DataArray, normalization: str | None = None) -> ImageView:
    """`to_image_view` without the amplitudes, which take most of the time: only where cells lie and how large they are.

    It needs the coordinates and attributes of the image alone.
    """
    check_samples(image, ("y", "x"))
    normalization = one_of("normalization", normalization or "r", RANGE_POWERS)
    attrs = image.attrs
    x, y = image["x"].values.astype(float), image["y"].values.astype(float)
    place = radar_place(attrs)
    radar, height = place[:2], float(place[2] - image.coords.get("z", 0.0))
    along = unit(np.asarray(attrs.get("array_direction", (1.0, 0.0)), dtype=float)[:2])
    broadside = turned(along)
    corners = np.array([[a, b] for a in (x[0], x[-1]) for b in (y[0], y[-1])]) - radar
    broadside = -broadside if corners.mean(axis=0) @ broadside < 0.0 else broadside

    pixel = max(x[1] - x[0], y[1] - y[0])
    nearest = float(np.hypot(*(np.clip(radar, [x[0], y[0]], [x[-1], y[-1]]) - radar)))
    farthest = float(np.linalg.norm(corners, axis=1).max())
    known = _known_cell(attrs)
    wavelength, weights = np.inf, np.zeros(0)
    if known is not None:
        range_cell, u_cell, aperture, wavelength, weights = known
        # A scene beyond the ambiguous range is seen over one ambiguous range, from its nearest pixel on. Any other view
        # ends a cell before the ambiguous range, where the main lobe of what stands at the radar itself begins anew.
        ambiguous = float(attrs.get("ambiguous_range", np.inf))
        farthest = min(farthest, ambiguous - range_cell if nearest < ambiguous else nearest + ambiguous)
        # Of a radar at the height h, a cell on the ground at the distance d is ``sqrt(1 + (h / d)^2)`` times as wide.
        slant = float(np.hypot(1.0, height / farthest))
        range_cell, u_cell = max(slant * range_cell, 2.0 * pixel), slant * u_cell
    else:
        range_cell = 2.0 * pixel
        u_cell = 2.0 * pixel / max(0.5 * farthest, pixel)
        aperture = np.full(2, UNIFORM_CELL / np.sqrt(2.0) / u_cell)
    ahead = corners @ broadside
    sines = corners @ along / np.linalg.norm(corners, axis=1) if ahead.min() > 0.0 else np.array([-1.0, 1.0])
    range_, u = _polar_grid((nearest, farthest), (sines.min(), sines.max()), range_cell, u_cell)
    return ImageView(radar, along, broadside, range_, u, np.empty((0, 0)), RANGE_POWERS[normalization],
                     range_cell, u_cell, aperture[0], aperture[1], normalization, wavelength, height=height,
                     window=weights, aperture_filled=float(attrs.get("filled_aperture", 0.0)) / wavelength)  # fmt: skip


def _polar_grid(
    ranges: tuple[float, float], sines: tuple[float, float], range_cell: float, u_cell: float
) -> tuple[Array, Array]:
    """Ranges [m] and sines u of the samples of a view, `SAMPLES_PER_CELL` in each resolution cell.

    They hold an image that reaches over these `ranges` [m] and `sines`, as far aside as the array looks. An image
    smaller than a cell is refused, and one whose view would not fit into the memory.
    """
    nearest, farthest = ranges
    samples = (farthest - nearest) / range_cell * 2.0 / u_cell * SAMPLES_PER_CELL**2
    check_room(
        SAMPLE_BYTES * samples,
        f"{samples:.3g} samples of a view with resolution cells of {range_cell:.3g} m by {u_cell:.3g} rad",
        "see whether the image says the right wave_speed, frequencies and apertures",
    )
    range_ = np.arange(max(nearest, range_cell), farthest, range_cell / SAMPLES_PER_CELL)
    half = int(LARGEST_SINE / u_cell * SAMPLES_PER_CELL)
    u_step = u_cell / SAMPLES_PER_CELL
    u = u_step * np.arange(max(-half, np.floor(sines[0] / u_step)), min(half, np.ceil(sines[1] / u_step)) + 1)
    if range_.size < 4:
        raise InputError("image: is too small, it spans less than one resolution cell; focus a larger grid")
    if u.size < 4:
        raise InputError(
            "image: spans less than one resolution cell in direction, or lies farther than 80 degrees aside of where "
            "the array looks; focus a larger grid ahead of it, or correct the attr array_direction"
        )
    return range_, u


def _known_cell(attrs: dict[Any, Any]) -> tuple[float, float, Array, float, Array] | None:
    """The resolution cell of a radar, as the attributes of its image tell; None if they do not.

    Returns its width in range [m] and in u, the lengths of the transmitting and of the receiving array in wavelengths,
    (2,), the wavelength [m], and the weights over frequency (n,), empty if these are not known.
    """
    points = int(attrs["frequency_points"]) if tells_band(attrs) else 0
    aperture = np.array([attrs.get("tx_aperture", 0.0), attrs.get("rx_aperture", 0.0)], dtype=float)
    if points <= 1 or aperture.max() <= 0.0:
        return None
    low, high = attrs["frequency_start"], attrs["frequency_stop"]
    speed = float(attrs.get("wave_speed", speed_of_light))
    wavelength = speed / (0.5 * (low + high))
    weights = known_weights(attrs.get("taper", "hann"), points)
    range_cell = cell_of(weights) * 0.5 * speed / ((high - low) * points / (points - 1))
    aperture /= wavelength
    if attrs.get("monostatic"):  # one antenna goes along the aperture: sinc(2 D u)
        aperture = np.array([aperture.sum(), 0.0])
    u_cell = uniform_cell(*aperture) * _widening(attrs.get("apodization", "uniform"))
    return range_cell, u_cell, aperture, wavelength, weights


def _widening(apodization: ArrayLike) -> float:
    """By how much a window over the antennas widens the main lobe; 1 for one that is not known by its name."""
    weights = known_weights(apodization, MOST_WEIGHTS) if isinstance(apodization, str) else np.zeros(0)
    return half_amplitude_width(weights) / half_amplitude_width(np.ones(MOST_WEIGHTS)) if weights.size else 1.0
