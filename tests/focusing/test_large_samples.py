"""Samples whose sum exceeds single precision are told to be too large; smaller ones give the same image to a factor."""

from __future__ import annotations

import numpy as np
import pytest
from scans import point_sweep

import mirrorfold as mf
from mirrorfold.errors import InputError

X, Y = np.linspace(-0.1, 0.1, 21), np.linspace(0.3, 0.5, 21)

TOO_LARGE = "holds samples as large as .*, or their sum exceeds single precision; divide all of them by one number"


@pytest.mark.parametrize(("level", "kind"), [(1e38, np.complex64), (1e38, np.complex128), (1e60, np.complex128)])
def test_samples_that_are_too_large_are_refused_as_such(sweep, level, kind):
    large = sweep.assign(s=(sweep["s"].dims, (sweep["s"].values.astype(complex) * level).astype(kind)))
    with pytest.raises(InputError, match=rf"sweep: s {TOO_LARGE}"):
        mf.focus(large, x=X, y=Y)
    with pytest.raises(InputError, match=rf"the frame {TOO_LARGE}"):
        mf.FocusPlan(sweep, x=X, y=Y)(large["s"])


def test_scans_with_samples_that_are_too_large_are_refused_as_such():
    scan = point_sweep((0.0, 2.0, 0.0))
    with pytest.raises(InputError, match=rf"sweep: s {TOO_LARGE}"):
        mf.focus(scan.assign(s=scan["s"] * np.float32(1e38)))


@pytest.mark.parametrize("level", [2.0**100, 2.0**-100])
def test_large_and_small_samples_give_the_same_image(sweep, level):
    scaled = sweep.assign(s=sweep["s"] * np.float32(level))
    usual = mf.focus(sweep, x=X, y=Y)
    np.testing.assert_allclose(mf.focus(scaled, x=X, y=Y) / level, usual, atol=1e-6 * float(np.abs(usual).max()))
