"""A simulated network analyser: cables, elements with gains and phases, direct coupling, drift and noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.calibration.reflectors import sphere_paths


@dataclass(frozen=True)
class Instrument:
    """What it adds to what an ideal one would measure.

    Attributes
    ----------
    cable : float [m]
        Electrical length that all pairs share.
    tx_delay, rx_delay : (tx,) and (rx,) arrays [m]
        Of the elements.
    tx_gain, rx_gain : (tx,) and (rx,) complex arrays
    coupling : float
        Amplitude of what goes straight from a transmitter to a receiver at a metre.
    drift : float [rad]
        Phase at the end of a scan against its beginning; the gain falls by a tenth of it.
    """

    tx_position: np.ndarray
    rx_position: np.ndarray
    frequency: np.ndarray
    cable: float
    tx_delay: np.ndarray
    rx_delay: np.ndarray
    tx_gain: np.ndarray
    rx_gain: np.ndarray
    coupling: float = 0.0
    drift: float = 0.0

    @classmethod
    def random(cls, tx_position, rx_position, frequency, seed, *, cable=None, largest_delay=2e-3, **kind):
        """An instrument with up to ten metres of cable and elements of any phase."""
        random = np.random.default_rng([seed, 17])
        delays, gains = [], []
        for count in (len(tx_position), len(rx_position)):
            delays.append(random.uniform(-largest_delay, largest_delay, count))
            gains.append(random.uniform(0.5, 1.5, count) * np.exp(2j * np.pi * random.random(count)))
        length = random.uniform(0.0, 10.0) if cable is None else cable
        return cls(tx_position, rx_position, frequency, length, *delays, *gains, **kind)

    @property
    def wavenumber(self) -> np.ndarray:
        """(frequencies, 1, 1) [rad/m]."""
        return 2 * np.pi * self.frequency[:, None, None] / speed_of_light

    @property
    def period(self) -> float:
        """Length of path that the sweep cannot tell from none [m]."""
        return float(speed_of_light / (self.frequency[1] - self.frequency[0]))

    def sphere(self, centre, radius=0.0) -> np.ndarray:
        """What a sphere returns, of amplitude one in the middle of the array, (frequencies, tx, rx)."""
        away = [np.linalg.norm(p - np.array([*centre, 0.0][:3]), axis=1) for p in (self.tx_position, self.rx_position)]
        amplitude = np.mean(away[0]) * np.mean(away[1]) / (away[0][:, None] * away[1])
        return amplitude * np.exp(
            -1j * self.wavenumber * sphere_paths(self.tx_position, self.rx_position, centre, radius)
        )

    def measure(self, ideal: np.ndarray, seed: int, *, noise: float = 0.0, title: str = "") -> xr.Dataset:
        """The sweep of what an ideal instrument would measure, (frequencies, tx, rx).

        Noise is the standard deviation of a sample's; drift begins anywhere.
        """
        random = np.random.default_rng([seed, 23])
        apart = np.linalg.norm(self.tx_position[:, None] - self.rx_position, axis=-1)
        s = ideal + self.coupling / np.maximum(apart, 1e-2) * np.exp(-1j * self.wavenumber * apart)
        delay = self.cable + self.tx_delay[:, None] + self.rx_delay
        s = s * np.exp(-1j * self.wavenumber * delay) * self.tx_gain[:, None] * self.rx_gain
        clock = np.linspace(0.0, 1.0, apart.size).reshape(apart.shape) + random.random()
        s *= np.exp((1j - 0.1) * self.drift * clock)
        s += noise * np.sqrt(0.5) * random.standard_normal((*s.shape, 2)).view(complex)[..., 0]
        return mf.make_sweep(
            s, frequency=self.frequency, tx_position=self.tx_position, rx_position=self.rx_position, title=title
        )


def line(elements, *, pitch=0.5e-3, centre=(0.0, 0.0, 0.0)) -> np.ndarray:
    """Antennas on a line along x, (elements, 3) [m]."""
    return np.asarray(centre) + np.outer(pitch * (np.arange(elements) - (elements - 1) / 2), [1.0, 0.0, 0.0])
