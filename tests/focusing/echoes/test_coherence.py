"""Coherence of waves with paths by way of a point, a flat face and a right-angled corner."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.focusing.echoes.coherence import CORNER, FACE, POINT, coherence

pytestmark = pytest.mark.nojit

SHAPES = POINT, FACE, CORNER
ALONG, AHEAD = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])


def line(count):
    places = np.zeros((count, 3))
    places[:, 0] = 0.03 * (np.arange(count) - count // 2)
    return places


def every_pair(count):
    return (part.ravel() for part in np.meshgrid(np.arange(count), np.arange(count)))


def longer(shape, rho, u, a, b):
    """How much longer than 2 rho the paths of pairs are, by geometry: images of the antennas, (n,)."""
    direction = u * ALONG + np.sqrt(1.0 - u * u) * AHEAD
    there = rho * direction
    if shape == POINT:
        path = np.linalg.norm(a - there, axis=1) + np.linalg.norm(b - there, axis=1)
    elif shape == FACE:  # square to the direction: the mirror image of b
        image = b - 2.0 * ((b - there) @ direction)[:, None] * direction
        path = np.linalg.norm(a - image, axis=1)
    else:  # the mirror image of b at the vertex
        path = np.linalg.norm(a - (2.0 * there - b), axis=1)
    return path - 2.0 * rho


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_an_echo_comes_from_adds_up_in_phase(run, shape, sign):
    """Seen as what it is, all of the echo adds up; seen as another shape, less of it does."""
    rho, u, centre = 0.5, 0.2, 600.0
    places, (tx_of, rx_of) = line(9), every_pair(9)
    wave = np.exp(-1j * centre * sign * longer(shape, rho, u, places[tx_of], places[rx_of]))
    windows = np.repeat(np.stack([wave.real, wave.imag], -1)[:, None, :, None], 3, axis=1).astype(np.float32)
    found = {}
    for assumed in SHAPES:
        out = np.zeros(1)
        run(
            coherence, windows, 0.1, 0.0, assumed, places, places, tx_of, rx_of, centre, np.array([sign * u]),
            sign / rho, ALONG, AHEAD, out,
        )  # fmt: skip
        found[assumed] = out[0]
    assert found[shape] > 0.999
    assert all(value < 0.9 for other, value in found.items() if other != shape)


@pytest.mark.parametrize("gates", [1, 3])
@pytest.mark.parametrize("shift", [1.0, -1.0])
@pytest.mark.parametrize("shape", SHAPES)
def test_samples_are_taken_where_their_paths_lead(run, rng, shape, shift, gates):
    """Against the plain sum in double precision: of windows of noise, between cells, the best of three directions."""
    rho, centre, step, directions = 0.8, 700.0, 4e-3, np.array([-0.5, 0.1, 0.6])
    places, (tx_of, rx_of) = line(4), every_pair(4)
    windows = rng.normal(size=(16, 81, 2, gates)).astype(np.float32)
    samples, found, expected = windows[:, :, 0] + 1j * windows[:, :, 1], np.zeros(gates), np.zeros(gates)
    for u in directions:
        path = longer(shape, rho, u, places[tx_of], places[rx_of])
        cell, rest = np.divmod(40.0 + shift * path / step, 1.0)
        here, beyond = (samples[np.arange(16), cell.astype(int) + n] for n in (0, 1))
        y = (here + rest[:, None] * (beyond - here)) * np.exp(1j * centre * path)[:, None]
        expected = np.maximum(expected, np.abs(y.sum(0)) ** 2 / (16 * (np.abs(y) ** 2).sum(0)))
    run(
        coherence, windows, step, shift, shape, places, places, tx_of, rx_of, centre, directions, 1.0 / rho, ALONG,
        AHEAD, found,
    )  # fmt: skip
    np.testing.assert_allclose(found, expected, rtol=1e-3)
