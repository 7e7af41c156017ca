"""Images and views of echoes made without any solver: what a radar would see of given points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light
from scipy.ndimage import map_coordinates

from mirrorfold.common.windows import hann
from mirrorfold.detection import usual_settings
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.folding import FoldSettings
from mirrorfold.tree.rounds import find_tree

FREQUENCY_START, FREQUENCY_STOP, FREQUENCY_POINTS = 290e9, 300e9, 401
BAND = (FREQUENCY_STOP - FREQUENCY_START) * FREQUENCY_POINTS / (FREQUENCY_POINTS - 1)
WAVELENGTH = speed_of_light / 295e9
APERTURE = 0.08
"""Length [m] of the transmitting and of the receiving array."""

RANGE_CELL = speed_of_light / BAND
"""Between half amplitudes, with a Hann taper [m]: 3 cm."""

U_CELL = 1.207 / np.hypot(APERTURE / WAVELENGTH, APERTURE / WAVELENGTH)


def unit_vectors(direction):
    """Along an array of that direction [degree], and broadside of it to the left."""
    angle = np.radians(direction)
    return np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])


def empty_view(radar=(0.0, 0.0), direction=0.0, reach=(0.3, 3.0), samples=3, widest=0.9):
    """A ImageView of nothing."""
    half = int(widest / U_CELL * samples)
    range_ = np.arange(*reach, RANGE_CELL / samples)
    u = np.arange(-half, half + 1) * U_CELL / samples
    wavelengths = APERTURE / WAVELENGTH
    return ImageView(
        np.array(radar, dtype=float), *unit_vectors(direction), range_, u, np.zeros((range_.size, u.size)),
        1.0, RANGE_CELL, U_CELL, wavelengths, wavelengths, window=hann(FREQUENCY_POINTS),
    )  # fmt: skip


def envelope(view, points, amplitude):
    """The complex image of scatterers without its carrier, (nr, nu).

    In range the transform of a Hann window, whose first null is at a full cell; in u a sinc for each of the arrays.
    """
    range_, u = view.to_polar(points)
    bins = (view.range[:, None] - range_) * 2.0 * BAND / speed_of_light
    in_range = np.sinc(bins) + 0.5 * np.sinc(bins - 1.0) + 0.5 * np.sinc(bins + 1.0)
    in_u = np.sinc(view.aperture_tx * (view.u[:, None] - u)) * np.sinc(view.aperture_rx * (view.u[:, None] - u))
    phase = np.exp(-4j * np.pi / WAVELENGTH * range_)
    return (in_range * (amplitude * phase)) @ in_u.T


def radar_view(points, amplitude, *, noise=0.0, seed=0, **where):
    """The normalised ImageView of scatterers, in noise of that standard deviation at a range of 1 m."""
    view = empty_view(**where)
    random = np.random.default_rng([seed, 77])
    white = random.standard_normal((2, view.range.size, view.u.size))
    found = envelope(view, points, amplitude) + noise / np.sqrt(2.0) * (white[0] + 1j * white[1]) * view.range[:, None]
    return replace(view, amplitude=np.abs(found))


def radar_image(points, amplitude, x, y, *, radar=(0.0, 0.0), direction=0.0):
    """The complex image of scatterers on a grid, as focusing returns it: spread with range, with carrier and attrs."""
    far = 1.01 * float(
        np.hypot(*(np.max(np.abs([np.array(a)[[0, -1]] - c for a, c in zip((x, y), radar, strict=True)]), 1)))
    )
    view = empty_view(radar, direction, (0.2, far), samples=6, widest=1.0)
    found = envelope(view, points, amplitude)
    range_, u = view.to_polar(np.stack(np.broadcast_arrays(x, y[:, None]), axis=-1))
    where = [(range_ - view.range[0]) / view.dr, (np.nan_to_num(u, nan=9.0) - view.u[0]) / view.du]
    values = map_coordinates(found.real, where) + 1j * map_coordinates(found.imag, where)
    values *= np.exp(4j * np.pi / WAVELENGTH * range_) / range_
    attrs = {
        "mirrorfold_kind": "image",
        "radar_position": np.array([*radar, 0.0]),
        "array_direction": np.array([*unit_vectors(direction)[0], 0.0]),
        "frequency_start": FREQUENCY_START,
        "frequency_stop": FREQUENCY_STOP,
        "frequency_points": FREQUENCY_POINTS,
        "tx_aperture": APERTURE,
        "rx_aperture": APERTURE,
        "ambiguous_range": speed_of_light * (FREQUENCY_POINTS - 1) / (2.0 * (FREQUENCY_STOP - FREQUENCY_START)),
    }
    return xr.DataArray(values.astype(np.complex64), dims=("y", "x"), coords={"y": y, "x": x}, attrs=attrs)


def diffuse(start, end, seed, strength=1.0, spacing=0.002):
    """Scatterers of a rough wall, every 2 mm: positions (n, 2) [m] and complex Gaussian amplitudes (n,)."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    count = int(np.ceil(np.linalg.norm(end - start) / spacing))
    random = np.random.default_rng([seed, 5])
    along = (np.arange(count) + 0.5) / count
    amplitude = random.standard_normal(count) + 1j * random.standard_normal(count)
    return start + along[:, None] * (end - start), strength * amplitude


def together(*parts):
    """Several groups of scatterers as one."""
    return np.concatenate([p for p, _ in parts]), np.concatenate([a for _, a in parts])


def build_tree(echoes, view, *, known=None, measured=None, **settings):
    """Tree and lines of sight of the echoes of a view: steps 2 to 4."""
    settings = FoldSettings(**settings).completed(**usual_settings(view, echoes))
    found = find_tree(view, echoes, settings, known=known, measured=measured)
    return found.tree, found.sight


def echoes_at(view, places, amplitude=1.0, *, threshold=0.1):
    """Echoes at places (n, d) [m], strong above the threshold; the reference is one."""
    places = np.atleast_2d(np.asarray(places, dtype=float))
    range_, direction, _ = view.locate(places)
    one = np.ones(len(places))
    return Echoes.found(places, range_, direction, amplitude * one, one, 0.0 * one, threshold, 1.0)


def on_line(start, end, spacing=0.01):
    """Places every so many metres from one end of a line to the other, (n, 2) [m]."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    return start + np.linspace(0.0, 1.0, round(np.linalg.norm(end - start) / spacing) + 1)[:, None] * (end - start)
