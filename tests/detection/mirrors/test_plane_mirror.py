"""Where a beam sees a plane: its formula against the integral over its footprint."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.constants import speed_of_light

from mirrorfold.common.beams import beam_radius
from mirrorfold.detection.mirrors.plane_mirror import PlaneMirror

BEAM = {"spot_radius": 0.05, "focus_distance": 4.0, "wavelength": speed_of_light / 78.5e9}


def centroid_by_integration(angle, range_):
    """Centroid of power [m] along the beam, of a plane that the axis meets at an angle [rad] and at a range [m].

    The plane scatters by Lambert's law, there and back ``cos^2``; the beam's intensity is ``2 / (pi w^2) exp(-2
    rho^2 / w^2)``, there and back squared.
    """
    half = 4.0 * beam_radius(range_, **BEAM)
    along, across = np.meshgrid(np.linspace(-half, half, 801) / np.cos(angle), np.linspace(-half, half, 401))
    y, x = range_ + along * np.sin(angle), along * np.cos(angle)
    distance = np.sqrt(x**2 + y**2 + across**2)
    rho = distance * np.sqrt(x**2 + across**2) / np.sqrt(y**2 + x**2 + across**2)
    width = beam_radius(distance, **BEAM)
    power = (range_ * np.cos(angle) / distance) ** 2 * width**-4 * np.exp(-4.0 * (rho / width) ** 2)
    return float(np.sum(power * distance) / np.sum(power))


@pytest.mark.parametrize("angle_deg", [0.0, 30.0, 60.0, 78.0])
@pytest.mark.parametrize("range_", [2.0, 4.0, 5.0])
def test_the_centroid_of_a_footprint_is_that_of_its_integral(angle_deg, range_):
    angle = np.radians(angle_deg)
    normal = np.array([np.sin(angle), -np.cos(angle), 0.0])
    place = np.array([0.0, range_, 0.0])
    mirror = PlaneMirror(place, normal, place[None], np.ones(1, dtype=bool))
    view = SimpleNamespace(radar=np.zeros(3), width=lambda at: beam_radius(at, **BEAM))
    expected = centroid_by_integration(angle, range_) - range_
    assert mirror.off_axis(view, place[None])[0] == pytest.approx(expected, rel=0.1, abs=1e-6)
