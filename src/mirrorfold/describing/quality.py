"""How well hidden things can be expected to be folded, before anything is measured."""

from __future__ import annotations

import numpy as np
from scipy.constants import speed_of_light


def cell_diagonal(frequency: float, bandwidth: float, aperture: float, range: float) -> float:
    """Diagonal of the resolution cell [m], ``sqrt((c / 2B)^2 + (lambda r / D)^2)``.

    Parameters
    ----------
    frequency, bandwidth : float [Hz]
        Middle and width of the band.
    aperture : float [m]
    range : float [m]
        The whole way, by way of walls.
    """
    return float(np.hypot(speed_of_light / (2.0 * bandwidth), speed_of_light / frequency * range / aperture))
