"""The Sweep: one raw radar measurement as an `xarray.Dataset`; its checks, its resolution, and added noise.

The samples are a complex64 variable ``s``. There are three kinds of sweeps:

* pairs of antennas: ``s(frequency, tx, rx)`` with the coordinates ``frequency`` [Hz], ``tx_position(tx, axis)`` and
  ``rx_position(rx, axis)`` [m];
* monostatic, where each antenna receives only its own signal, as one moving antenna does: ``s(frequency, position)``
  with ``antenna_position(position, axis)`` [m];
* raster scans: ``s(frequency, azimuth, elevation)`` with ``azimuth`` and ``elevation`` [degree] and the attr ``origin``
  [m].

The time convention is ``exp(+jwt)``, so that a path of length d contributes ``exp(-j k d)``.

Optional: the attr ``wave_speed`` [m/s], where waves do not travel at the speed of light; the attr ``scene_center`` [m],
around which the unambiguous range then lies, instead of beginning at the antennas; the coordinate ``measured(tx, rx)``,
false for pairs that were not measured or are masked. Samples of such pairs are zero and contribute to no sum.
"""

from __future__ import annotations

from mirrorfold.sweep.checks import UnitDoubt, check_sweep, check_waves, frequency_unit_of, place_doubts, unit_doubts
from mirrorfold.sweep.facts import (
    AXES,
    AXES_REMEDY,
    MONOSTATIC_DIMENSIONS,
    PAIR_DIMENSIONS,
    RASTER_DIMENSIONS,
    STEP_TOLERANCE,
    TIME_CONVENTION,
    ambiguous_range,
    antenna_positions,
    frequency_step,
    is_monostatic,
    is_raster,
    misaligned_axis,
    radar_position,
    range_resolution,
    uneven_steps,
    wave_speed,
    wavenumber,
    without_rounding,
)
from mirrorfold.sweep.making import add_noise, make_monostatic_sweep, make_raster_sweep, make_sweep
from mirrorfold.sweep.polarization import join_polarizations

__all__ = [
    "AXES",
    "AXES_REMEDY",
    "MONOSTATIC_DIMENSIONS",
    "PAIR_DIMENSIONS",
    "RASTER_DIMENSIONS",
    "STEP_TOLERANCE",
    "TIME_CONVENTION",
    "UnitDoubt",
    "add_noise",
    "ambiguous_range",
    "antenna_positions",
    "check_sweep",
    "check_waves",
    "frequency_step",
    "frequency_unit_of",
    "is_monostatic",
    "is_raster",
    "join_polarizations",
    "make_monostatic_sweep",
    "make_raster_sweep",
    "make_sweep",
    "misaligned_axis",
    "place_doubts",
    "radar_position",
    "range_resolution",
    "uneven_steps",
    "unit_doubts",
    "wave_speed",
    "wavenumber",
    "without_rounding",
]
