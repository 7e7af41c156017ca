"""Arrays of which one has gaps that the pairs of antennas fill: their side lobes are those of one array alone."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.constants import speed_of_light

import mirrorfold as mf
from mirrorfold.detection.finding import find_echoes, see

FREQUENCY = np.linspace(58e9, 66e9, 161)
HALF = 0.5 * speed_of_light / 62e9
GRID = {"x": np.arange(-1.4, 1.4, 0.01), "y": np.arange(0.4, 2.0, 0.01)}
POINT = np.array([0.3, 1.2])


def image_of_point(senders, apart, receivers=16, pitch=HALF, point=POINT):
    """The image of a point by a number of senders, so far `apart` [m], and of receivers at a `pitch` [m]."""
    arrays = []
    for count, step in ((senders, apart), (receivers, pitch)):
        place = np.zeros((count, 3))
        place[:, 0] = step * (np.arange(count) - 0.5 * (count - 1))
        arrays.append(place)
    tx, rx = (np.linalg.norm(place[:, :2] - point, axis=1) for place in arrays)
    s = np.exp(-2j * np.pi / speed_of_light * FREQUENCY[:, None, None] * (tx[:, None] + rx))
    real, imag = np.random.default_rng(0).standard_normal((2, *s.shape))
    s += 0.02 * (real + 1j * imag)
    return mf.focus(mf.make_sweep(s, frequency=FREQUENCY, tx_position=arrays[0], rx_position=arrays[1]), **GRID)


@pytest.mark.parametrize(
    ("senders", "apart", "filled"),
    [
        pytest.param(4, 16, True, id="side by side"),
        pytest.param(4, 10, False, id="with overlap"),
        pytest.param(4, 20, False, id="with gaps"),
        pytest.param(16, 1, False, id="both full"),
        pytest.param(1, 1, False, id="one sender"),
    ],
)
def test_an_image_knows_the_array_that_the_pairs_fill(senders, apart, filled):
    image = image_of_point(senders, apart * HALF)
    view = see(image)
    if filled:
        length = ((senders - 1) * apart + 15) * HALF
        assert image.attrs["filled_aperture"] == pytest.approx(length)
        assert view.aperture_filled == pytest.approx(length / (2.0 * HALF), rel=1e-6)
    else:
        assert "filled_aperture" not in image.attrs
        assert view.aperture_filled == 0.0


@pytest.mark.parametrize("senders", [3, 4])
def test_the_lobes_of_a_filled_array_lie_below_their_bound_and_are_no_echoes(senders):
    view = see(image_of_point(senders, 16 * HALF))
    range_, u = view.to_polar(POINT)
    row, aside = view.row(range_), np.abs(view.u - u)
    beside = (aside > 2.0 * view.u_cell) & (aside < 0.9)
    lobes, bound = view.amplitude[row, beside], 2.0 * view.side_lobes[row, beside]  # with the margin for echoes
    assert (lobes < bound).all()
    # With full arrays of these lengths the bound would be far too low.
    full = view.amplitude.max() / np.prod(
        [np.pi * d * aside[beside] for d in (view.aperture_tx, view.aperture_rx)], axis=0
    )
    assert (lobes > 2.0 * full).mean() > 0.3
    echoes = find_echoes(view)
    # Farther aside, where the phase from place to place nears a whole turn, lobes rise again.
    echoes = echoes.take(np.abs(view.u[echoes.direction] - u) < 1.0)
    assert len(echoes) > 0
    assert np.linalg.norm(echoes.position - POINT, axis=1).max() < 1.5 * view.cell_at(POINT)
