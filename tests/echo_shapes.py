"""Sweeps of echoes from points, flat faces and right-angled corners, by the lengths of their paths."""

from __future__ import annotations

import numpy as np
from scipy.constants import speed_of_light
from scipy.fft import next_fast_len
from scipy.spatial.distance import cdist

import mirrorfold as mf
from mirrorfold.detection.views.image_view import ImageView
from mirrorfold.focusing.echoes.coherence import OVERSAMPLING

ELEMENTS = 113
BAND = np.linspace(116e9, 128e9, 97)
PERIOD = 0.5 * speed_of_light / (BAND[1] - BAND[0])
"""The ambiguous range [m]: 1.2 m."""
STEP = 2.0 * PERIOD / next_fast_len(OVERSAMPLING * BAND.size)
"""From one point of a range profile to the next, along the path [m]."""


def array(behind=0.0):
    position = np.zeros((ELEMENTS, 3))
    position[:, 0] = 1.25e-3 * (np.arange(ELEMENTS) - 0.5 * (ELEMENTS - 1))
    position[:, 1] = -behind
    return position


def sweep_of(paths, tx, rx, noise=0.0):
    """The sum of echoes whose paths (tx, rx) [m] are given, of amplitude one, in noise."""
    k = 2.0 * np.pi * BAND / speed_of_light
    s = sum(np.exp(-1j * k[:, None, None] * path) for path in paths)
    s = s + noise * np.random.default_rng(0).standard_normal((*s.shape, 2)) @ [1.0, 1.0j]
    return mf.make_sweep(s.astype(np.complex64), frequency=BAND, tx_position=tx, rx_position=rx)


def point(range_, u, tx, rx):
    """Out to a point and back."""
    place = range_ * np.array([[u, np.sqrt(1.0 - u**2), 0.0]])
    return cdist(tx, place) + cdist(rx, place).T


def face(range_, u, tx, rx):
    """From the mirror image of each transmitter in a flat face whose normal points at the radar."""
    normal = np.array([u, np.sqrt(1.0 - u**2), 0.0])
    return cdist(tx + 2.0 * (range_ - tx @ normal)[:, None] * normal, rx)


def corner(range_, u, tx, rx):
    """Back along the way it came: from the mirror image of each transmitter in the vertex of two faces."""
    vertex = range_ * np.array([u, np.sqrt(1.0 - u**2), 0.0])
    return cdist(2.0 * vertex - tx, rx)


def view_of(tx, rx):
    """The radar's view with the arrays along x; only its axes count."""
    radar = 0.5 * (tx.mean(axis=0) + rx.mean(axis=0))[:2]
    axes, cells = (np.linspace(0.2, 1.1, 10), np.linspace(-0.9, 0.9, 10)), (0.0125, 0.01)
    return ImageView(radar, *np.eye(2), *axes, np.zeros((10, 10)), 1.0, *cells, 60.0, 60.0)
