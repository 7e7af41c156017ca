"""A complex image, with all that its response to a point depends on: band, windows and arrays.

Of such an image, the least-squares fits of `mirrorfold.detection.search.coherent` ask what points scatter.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

from mirrorfold.common.kernels import njit
from mirrorfold.common.normalization import RANGE_POWERS
from mirrorfold.common.types import Array, Complex, Index
from mirrorfold.common.windows import known_weights

if TYPE_CHECKING:
    from mirrorfold.detection.views.image_view import ImageView

NODES = 10
"""Number of antennas of each array, and of frequencies, by which the response to a point is computed within three and a
half resolution cells: two for each of its lobes on the way there."""


@dataclass(frozen=True, eq=False)
class ComplexImage:
    """A complex image: its `values` (ny, nx) at `x` and `y` [m], which were multiplied by ``range ** power``.

    The `taper` are weights over frequency at the wavenumbers `k` [rad/m] across the band, and the `apodization` weights
    over the antennas, (`NODES`,) each; the sum of either is one. The antennas are at `arrays` (1 or 2, `NODES`, 2) [m],
    evenly along the array of transmitters and that of receivers, or only one if both are the same, with the `radar`
    (2,) [m] in the middle. If it is `monostatic`, one antenna goes along the array, and each place receives only what
    was sent from there.
    """

    values: Complex
    x: Array
    y: Array
    radar: Array
    k: Array
    taper: Array
    arrays: Array
    apodization: Array
    monostatic: bool
    power: int

    @classmethod
    def of(cls, image: xr.DataArray, view: ImageView) -> ComplexImage | None:
        """The image; None if it is not complex, or if it does not tell band, windows and arrays without gaps."""
        attrs, known = image.attrs, np.iscomplexobj(image.values) and np.isfinite(view.wavelength)
        if not known or not view.window.size or view.aperture_filled > 0.0 or abs(view.height) > view.range_cell:
            return None
        antennas = attrs.get("apodization", "uniform")
        weights = known_weights(antennas, NODES) if isinstance(antennas, str) else np.zeros(0)
        if not weights.size:
            return None
        # Each node stands for an equal part of the band, or of an array, and lies in its middle. So does each frequency
        # and each antenna: band and arrays reach half a step beyond the outermost ones.
        share, points = (np.arange(NODES) + 0.5) / NODES, view.window.size
        low, high = float(attrs["frequency_start"]), float(attrs["frequency_stop"])
        beyond = 0.5 * (high - low) / (points - 1)
        frequency = low - beyond + share * (high - low + 2.0 * beyond)
        taper = np.interp(points * share - 0.5, np.arange(points), view.window)
        monostatic = bool(attrs.get("monostatic"))
        pitch = view.wavelength * (0.25 if monostatic else 0.5)
        lengths = [float(attrs.get(name, 0.0)) for name in ("tx_aperture", "rx_aperture")]
        lengths = [length + pitch * (length > 0.0) for length in lengths]
        lengths = lengths[:1] if lengths[0] == lengths[1] or monostatic else lengths
        return cls(
            *(image.values, image["x"].values.astype(float), image["y"].values.astype(float), view.radar),
            k=2.0 * np.pi * frequency / float(attrs.get("wave_speed", speed_of_light)),
            taper=taper / taper.sum(),
            arrays=np.stack([view.radar + np.outer((share - 0.5) * length, view.along) for length in lengths]),
            apodization=weights / weights.sum(),
            monostatic=monostatic,
            power=RANGE_POWERS[str(attrs.get("normalization", "none"))],
        )

    def samples(self, rows: Index, columns: Index) -> tuple[Array, Complex]:
        """The pixels of some rows and columns, (n, 2) [m], and their amplitudes without the carrier, (n,).

        Pixels that are masked are left out: they tell nothing.
        """
        pixel = np.stack(np.meshgrid(self.x[columns], self.y[rows]), axis=-1).reshape(-1, 2)
        value = self.values[np.ix_(rows, columns)].ravel()
        shown = np.isfinite(value) & (value != 0.0)
        pixel, value = pixel[shown], value[shown]
        range_ = np.linalg.norm(pixel - self.radar, axis=1)
        return pixel, value * np.exp(-1j * (self.k[0] + self.k[-1]) * range_) / range_**self.power

    def response(self, pixels: Array, points: Array, pixel: Index, point: Index) -> Complex:
        """How pixels (p, 2) show points (q, 2) of amplitude one, without the carrier, for n pairs of numbers, (n,).

        It is the sum over frequencies and antennas that focusing is.
        """
        response = np.empty(pixel.size, dtype=complex)
        weights = self.k, self.taper, self.apodization
        _respond(pixels, points, pixel, point, self.radar, self.arrays, self.monostatic, *weights, response)
        return response


@njit(makes_arrays=True, nogil=True, error_model="numpy")
def _respond(  # type: ignore[no-untyped-def]
    pixels, points, pixel, point, radar, arrays, monostatic, k, taper, apodization, response
):
    """The response (n,) of pixels (p, 2) to points (q, 2), for n pairs of their numbers; see `ComplexImage.response`.

    The phases of each antenna turn by equal steps from one wavenumber to the next.
    """
    lines, count = arrays.shape[:2]
    turn, step = np.empty((2, lines, count), dtype=np.complex128)
    for i in range(pixel.size):
        p, q = pixels[pixel[i]], points[point[i]]
        deeper = np.hypot(p[0] - radar[0], p[1] - radar[1]) - np.hypot(q[0] - radar[0], q[1] - radar[1])
        for a in range(lines):
            for x in range(count):
                place = arrays[a, x]
                way = np.hypot(p[0] - place[0], p[1] - place[1]) - np.hypot(q[0] - place[0], q[1] - place[1]) - deeper
                way *= 2.0 if monostatic else 1.0
                turn[a, x], step[a, x] = np.exp(1j * k[0] * way), np.exp(1j * (k[1] - k[0]) * way)
        carrier, change = np.exp(1j * (k[0] - k[-1]) * deeper), np.exp(2j * (k[1] - k[0]) * deeper)
        total = 0.0j
        for f in range(k.size):
            both = 1.0 + 0.0j
            for a in range(lines):
                arriving = 0.0j
                for x in range(count):
                    arriving += apodization[x] * turn[a, x]
                    turn[a, x] *= step[a, x]
                both *= arriving
            if lines == 1 and not monostatic:
                both *= both
            total += taper[f] * carrier * both
            carrier *= change
        response[i] = total
