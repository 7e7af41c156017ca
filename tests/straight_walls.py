"""Straight walls as the radar sees them, alone or with others, and the mirrors that are found of them."""

from __future__ import annotations

import numpy as np
from synthetic import diffuse, empty_view, radar_view

from mirrorfold.common.geometry import cross2
from mirrorfold.detection import find_mirrors
from mirrorfold.detection.image_echoes import find_ridges

NOISE = 0.01


def look(points, amplitude, seed=0, **where):
    view = radar_view(points, amplitude, noise=NOISE, seed=seed, **where)
    echoes = find_ridges(view)
    return view, echoes, find_mirrors(view, echoes)


def errors(mirror, start, end):
    """Angle [degree] between a mirror and the line start-end, and distance [mm] of its middle from it."""
    direction = (end - start) / np.linalg.norm(end - start)
    angle = np.degrees(np.arcsin(abs(cross2(direction, mirror.direction))))
    return angle, 1e3 * abs(float(cross2(direction, mirror.center - start)))


def wall_at(middle, incidence, length):
    """Ends of a wall around `middle` that the radar at the origin sees at that angle [degree] to its normal."""
    angle = np.arctan2(middle[1], middle[0]) + np.radians(90.0 + incidence)
    half = 0.5 * length * np.array([np.cos(angle), np.sin(angle)])
    return middle - half, middle + half


def random_wall(seed, length=0.8, obliquity=70.0):
    random = np.random.default_rng([seed, 1])
    middle = empty_view().to_points(random.uniform(0.9, 1.9), random.uniform(-0.5, 0.5))
    return wall_at(middle, random.uniform(-obliquity, obliquity), length)


INSIDE = {
    "exponential": lambda depth, share: -depth * np.log1p(-share),
    "uniform": lambda depth, share: 2.0 * depth * share,
    "front and back": lambda depth, share: 3.0 * depth * (share > 2.0 / 3.0),
    "rising": lambda depth, share: 1.5 * depth * np.sqrt(share),
}
"""Depths [m] of scatterers inside a wall, of a mean depth, by the share of the power that scatters from above them."""


def thick(start, end, seed, depth, inside="exponential"):
    """Scatterers behind a face, in the mean so deep [m]."""
    points, amplitude = diffuse(start, end, seed, spacing=0.001)
    random = np.random.default_rng([seed, 9])
    away = np.array([start[1] - end[1], end[0] - start[0]]) / np.linalg.norm(end - start)
    away = away * np.sign(away @ start)
    return points + INSIDE[inside](depth, random.uniform(size=len(points)))[:, None] * away, amplitude
