"""Exact sweeps of points, and the same as elements with delays and gains of their own measure it."""

from __future__ import annotations

import numpy as np
from instruments import line
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.calibration.reflectors import sphere_paths


def echoes(frequency, tx, rx, points, amplitude=None):
    """Samples of point scatterers, (frequencies, tx, rx)."""
    k = 2 * np.pi * frequency / speed_of_light
    s = np.zeros((len(frequency), len(tx), len(rx)), dtype=complex)
    for point, a in zip(points, np.ones(len(points)) if amplitude is None else amplitude, strict=True):
        s += a * np.exp(-1j * k[:, None, None] * sphere_paths(tx, rx, point))
    return s


def sweep_of(points, amplitude=None, *, elements=15, start=290e9, stop=300e9, frequencies=101, shift=0.0):
    """The exact sweep of points, seen by two arrays that may be displaced."""
    frequency = np.linspace(start, stop, frequencies)
    tx, rx = line(elements, centre=(-shift / 2, 0, 0)), line(elements, centre=(shift / 2, 0, 0))
    s = echoes(frequency, tx, rx, points, amplitude)
    return mf.make_sweep(s, frequency=frequency, tx_position=tx, rx_position=rx, processing=["made"])


def with_delays(sweep, tx_delay, rx_delay, tx_gain=1.0, rx_gain=1.0):
    """The sweep as elements with delays [m] and gains of their own measure it."""
    k = 2 * np.pi * sweep["frequency"].values / speed_of_light
    turn = np.exp(-1j * k[:, None, None] * (np.asarray(tx_delay)[:, None] + rx_delay))
    gain = np.broadcast_to(tx_gain, len(tx_delay))[:, None] * np.broadcast_to(rx_gain, len(rx_delay))
    return sweep.assign(s=sweep["s"].copy(data=(sweep["s"].values * turn * gain).astype(np.complex64)))
