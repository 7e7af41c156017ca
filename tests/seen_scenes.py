"""Walls and things as the radar sees them by way of mirrors, and the tree that is found of them."""

from __future__ import annotations

import numpy as np
from synthetic import build_tree, radar_view, together

from mirrorfold.common.geometry import cross2, reflect, segment_normal
from mirrorfold.detection.image_echoes import find_ridges

NOISE = 0.01


def wall(middle, angle, length):
    """Ends of a wall around `middle`; the angle [degree] counts from +x."""
    half = 0.5 * length * np.array([np.cos(np.radians(angle)), np.sin(np.radians(angle))])
    return np.stack([middle - half, middle + half])


def seen_by(chain, points):
    """Where points appear that are seen through mirrors at their true places, the first one first."""
    for mirror in reversed(chain):
        points = reflect(points, mirror[0], segment_normal(*mirror))
    return points


def tree_of(*parts, reach=(0.3, 3.0), noise=NOISE, **settings):
    view = radar_view(*together(*parts), noise=noise, reach=reach)
    echoes = find_ridges(view)
    tree, sight = build_tree(echoes, view, **settings)
    return tree, sight, view, echoes


def line_errors(found, true):
    """Angle [degree] between two lines given by their ends, and distance [mm] of the middle of the first."""
    span, direction = found[1] - found[0], true[1] - true[0]
    sine = cross2(direction, span) / np.linalg.norm(direction) / np.linalg.norm(span)
    away = cross2(direction, found.mean(axis=0) - true[0]) / np.linalg.norm(direction)
    return np.degrees(np.arcsin(abs(sine))), 1e3 * abs(away)


def nearest(points, truth):
    return np.linalg.norm(points[:, None] - truth, axis=-1).min(axis=1)


def behind(range_, width, u=0.02, number=7):
    """Points side by side on an arc around the radar, at that range and that many radians wide."""
    angle = u + np.linspace(-0.5, 0.5, number) * width
    return range_ * np.stack([np.sin(angle), np.cos(angle)], axis=1)
