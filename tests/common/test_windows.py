"""Side lobes of windows."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.common.windows import WINDOWS, cell_of, half_amplitude_width, side_lobe_envelope


@pytest.mark.parametrize(
    ("name", "peaks", "level", "within"),
    [
        ("uniform", np.arange(1.5, 20.0), lambda x: 1.0 / (np.pi * x), 0.1),
        ("hann", np.arange(2.5, 20.0), lambda x: 1.0 / (np.pi * x * (x**2 - 1.0)), 0.1),
        ("triangular", np.arange(3.0, 20.0, 2.0), lambda x: 4.0 / (np.pi * x) ** 2, 0.1),
        ("taylor", np.array([1.4, 2.4, 3.4]), lambda x: np.full(x.shape, 10.0 ** (-30.0 / 20.0)), 0.25),
    ],
)
def test_side_lobes_of_windows_are_those_of_theory(name, peaks, level, within):
    """Where the lobes of that window have their peaks; the nearest ones of Taylor's are of about one height."""
    assert side_lobe_envelope(WINDOWS[name](401), peaks) == pytest.approx(level(peaks), rel=within)


def test_the_envelope_never_rises_and_knows_no_phase():
    weights = np.random.default_rng(0).random(64)
    level = side_lobe_envelope(weights, np.linspace(0.0, 31.0, 400))
    assert level[0] == pytest.approx(1.0)
    assert (np.diff(level) <= 0.0).all()
    turned = weights * np.exp(2j * np.pi * np.random.default_rng(1).random(64))
    np.testing.assert_allclose(
        side_lobe_envelope(turned, np.arange(20.0)), side_lobe_envelope(weights, np.arange(20.0))
    )


@pytest.mark.parametrize(
    ("name", "width"), [("uniform", 1.2067), ("hann", 2.0), ("triangular", 1.772), ("taylor", 1.556)]
)
def test_main_lobes_of_windows_are_as_wide_as_theory_says(name, width):
    """``sinc(x/2) = 1/2``; twice that for Hann; ``sinc(x/4)^2 = 1/2`` for the triangle."""
    weights = WINDOWS[name](4001)
    assert half_amplitude_width(weights) == pytest.approx(width, rel=2e-3)
    assert cell_of(weights) == pytest.approx(width, rel=2e-3)


def test_cells_without_weights_are_those_of_hann():
    assert cell_of([]) == cell_of(WINDOWS["hann"](31)) == 2.0
    assert half_amplitude_width([0.0, 1.0, 0.0]) == 3.0  # one sample: nothing falls
