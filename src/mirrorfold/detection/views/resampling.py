"""Resampling of an image from its pixels (y, x) to the polar grid of the radar's view, range and direction."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, spline_filter1d

from mirrorfold.common.threads import for_each
from mirrorfold.common.types import Array
from mirrorfold.detection.views.view import in_pieces

if TYPE_CHECKING:
    from mirrorfold.detection.views.image_view import ImageView

ROWS = 64
"""Number of rows of an image, or ranges of a view, that are computed at once."""


def sampled(view: ImageView, image: xr.DataArray, axes: tuple[Array, ...]) -> NDArray[Any]:
    """Amplitude of the image on the polar grid of the view, (nr, nu).

    `axes` are x and y of the pixels. The carrier is removed from a complex image before it is interpolated, if the
    wavelength is known.
    """
    x, y = axes
    if not (np.iscomplexobj(image.values) and np.isfinite(view.wavelength)):
        # Whole numbers become floating-point ones, so that interpolation does not round.
        held = image.values.astype(np.float32) if image.dtype.kind in "iu" else image.values
        return np.abs(interpolated(view, np.abs(held), axes, order=1))
    # The carrier is removed a few rows at a time: the phases of all pixels would take more memory than the image.
    values = np.empty(image.shape, dtype=image.dtype)

    def demodulate(rows: slice) -> None:
        across, ahead = (x[None, :] - view.radar[0]) ** 2, (y[rows, None] - view.radar[1]) ** 2
        distance = np.sqrt(across + ahead + view.height**2)
        carrier = np.exp(-4j * np.pi / view.wavelength * distance).astype(np.complex64)
        np.multiply(image.values[rows], carrier, out=values[rows])

    for_each(demodulate, in_pieces(y.size, ROWS))
    parts = []
    for part in (values.real, values.imag):
        parts.append(interpolated(view, _splines(part), axes, order=3, output=np.float32, prefilter=False))
    return np.hypot(*parts)


def _splines(values: NDArray[Any]) -> Array:
    """Spline coefficients of pixels (y, x), the same as of `scipy.ndimage.spline_filter`, computed on all cores."""
    coefficients = values.astype(np.float64)

    def along(axis: int, part: Array) -> None:
        spline_filter1d(part, axis=axis, output=part)

    for_each(lambda columns: along(0, coefficients[:, columns]), in_pieces(values.shape[1], ROWS))
    for_each(lambda rows: along(1, coefficients[rows]), in_pieces(values.shape[0], ROWS))
    return coefficients


def interpolated(view: ImageView, values: NDArray[Any], axes: tuple[Array, ...], **given: Any) -> NDArray[Any]:
    """Pixels (y, x) interpolated on the polar grid of the view, (nr, nu); options as of `map_coordinates`."""
    x, y = axes
    found = np.empty((view.range.size, view.u.size), dtype=given.pop("output", values.dtype))

    def interpolate(rows: slice) -> None:
        where = view.to_points(view.range[rows, None], view.u[None, :])
        pixels = [(where[..., 1] - y[0]) / (y[1] - y[0]), (where[..., 0] - x[0]) / (x[1] - x[0])]
        map_coordinates(values, pixels, output=found[rows], **given)

    for_each(interpolate, in_pieces(view.range.size, ROWS))
    return found
