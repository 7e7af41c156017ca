"""Small focusing problems, white noise to focus, and the focusing sum written out."""

from __future__ import annotations

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

from mirrorfold.common.windows import window
from mirrorfold.focusing.exact.direct_sum import direct_sum
from mirrorfold.focusing.problem import Problem
from mirrorfold.sweep import make_sweep

BAND = np.linspace(296e9, 300e9, 41)


def line(count: int, pitch: float, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> np.ndarray:
    position = np.zeros((count, 3))
    position[:, 0] = x + pitch * (np.arange(count) - 0.5 * (count - 1))
    position[:, 1], position[:, 2] = y, z
    return position


def plane(columns: int, rows: int, pitch: float, y: float = 0.0) -> np.ndarray:
    x, z = np.meshgrid(line(columns, pitch)[:, 0], line(rows, pitch)[:, 0])
    return np.stack([x.ravel(), np.full(x.size, y), z.ravel()], axis=1)


def problem(tx, rx, frequency, x, y, z=0.0, taper="hann", monostatic=False, wave_speed=speed_of_light) -> Problem:
    return Problem(
        k=2 * np.pi * np.asarray(frequency) / wave_speed,
        tx=tx,
        rx=rx,
        taper=window(taper, len(frequency), "taper"),
        tx_weight=window(None, len(tx), "apodization"),
        rx_weight=window(None, len(rx), "apodization"),
        x=np.atleast_1d(x),
        y=np.atleast_1d(y),
        z=np.atleast_1d(z).astype(float),
        monostatic=monostatic,
    )


def noise(shape, seed=0) -> np.ndarray:
    """Complex white noise, single precision; real and imaginary part have variance one."""
    rng = np.random.default_rng(seed)
    return rng.standard_normal((*shape, 2)).astype(np.float32).view(np.complex64)[..., 0]


def small_sweep(**changes) -> xr.Dataset:
    """White noise as 8 x 8 antennas measure it, with changes of its variables."""
    tx = line(8, 0.5e-3)
    return make_sweep(noise((41, 8, 8)), frequency=BAND, tx_position=tx, rx_position=tx).assign(**changes)


def literal_sum(p: Problem, s: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The formula, written out."""
    total = np.zeros(len(points), complex)
    for n, point in enumerate(points):
        r_tx = np.linalg.norm(p.tx - point, axis=1)
        r_rx = np.linalg.norm(p.rx - point, axis=1)
        for m, k in enumerate(p.k):
            path = 2 * r_tx if p.monostatic else r_tx[:, None] + r_rx[None, :]
            weight = p.tx_weight * p.rx_weight if p.monostatic else np.outer(p.tx_weight, p.rx_weight)
            total[n] += p.taper[m] * np.sum(weight * s[m] * np.exp(1j * k * path))
    return total


def relative_error(image: np.ndarray, p: Problem, s: np.ndarray, pixels: int = 60, seed: int = 1) -> float:
    """Relative L2 error of an image on random pixels, against the float64 sum."""
    flat = np.random.default_rng(seed).integers(0, p.pixels, pixels)
    reference = direct_sum(p, s, p.points(flat))
    return float(np.linalg.norm(image.ravel()[flat] - reference) / np.linalg.norm(reference))
