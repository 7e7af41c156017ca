"""What an image says of the array: its direction in the floor plan, and how much of it lies along that."""

from __future__ import annotations

import numpy as np
import pytest
from focusing_problems import BAND, line, noise, plane
from numpy.testing import assert_allclose

import mirrorfold as mf
from mirrorfold.sweep import make_sweep

PIXELS = {"x": np.linspace(-0.1, 0.1, 8), "y": np.linspace(0.3, 0.5, 8)}


def attrs(tx, rx=None):
    rx = tx if rx is None else rx
    sweep = make_sweep(noise((41, len(tx), len(rx))), frequency=BAND, tx_position=tx, rx_position=rx)
    return mf.focus(sweep, **PIXELS).attrs


def leaned(position, degrees):
    """Turned back about the x axis."""
    angle = np.radians(degrees)
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    return position @ turn.T


@pytest.mark.parametrize(("columns", "rows", "lean"), [(9, 13, 0.0), (13, 9, 0.0), (4, 30, 0.0), (9, 13, 5.0)])
def test_a_plane_of_antennas_is_as_wide_as_its_columns_however_tall(columns, rows, lean):
    found = attrs(leaned(plane(columns, rows, 2e-3), lean))
    assert_allclose(found["array_direction"], [1.0, 0.0, 0.0], atol=1e-12)
    width = (columns - 1) * 2e-3
    assert (found["tx_aperture"], found["rx_aperture"]) == pytest.approx((width, width))


@pytest.mark.parametrize("degrees", [0.0, 30.0, 80.0, 135.0, -60.0])
def test_a_line_points_along_itself_towards_plus_x(degrees):
    angle = np.radians(degrees)
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    found = attrs(line(8, 1e-3) @ np.array([along, [-along[1], along[0], 0.0], [0.0, 0.0, 1.0]]))
    sign = 1.0 if along[np.argmax(np.abs(along))] > 0.0 else -1.0
    assert_allclose(found["array_direction"], sign * along, atol=1e-12)
    assert found["tx_aperture"] == pytest.approx(7e-3)


def test_one_transmitter_has_no_aperture_and_an_upright_line_no_direction():
    found = attrs(line(1, 1e-3), line(8, 1e-3))
    assert (found["tx_aperture"], found["rx_aperture"]) == pytest.approx((0.0, 7e-3))
    upright = attrs(line(8, 1e-3)[:, [2, 1, 0]])
    assert_allclose(upright["array_direction"], [1.0, 0.0, 0.0])


def test_a_sweep_of_another_radar_is_refused_with_what_differs():
    tx, rx = line(9, pitch=1e-3), line(12, pitch=1e-3)

    def sweep(*, band=BAND, tx=tx, rx=rx):
        return make_sweep(noise((band.size, len(tx), len(rx))), frequency=band, tx_position=tx, rx_position=rx)

    image = mf.focus(sweep(), **PIXELS)
    mf.fold(image, sweep=sweep())
    away = np.array([0.5, 0.0, 0.0])
    for other, said in (
        (sweep(band=BAND[:20]), "20 frequencies in place of 41"),
        (sweep(band=BAND * 1.01), "Hz at first in place of"),
        (sweep(tx=tx + away, rx=rx + away), r"0.5, 0, 0 m as the radar's place in place of"),
        (sweep(tx=line(5, pitch=1e-3)), "0.004 m of transmitters in place of 0.008"),
    ):
        with pytest.raises(mf.InputError, match=f"{said}.*; give the sweep that the image was focused from"):
            mf.fold(image, sweep=other)
    mf.fold(image.drop_attrs(), sweep=sweep(band=BAND[:20]))
    # Images once told the size of an array in space, not along the line of it.
    tall = sweep(tx=tx + np.linspace(0.0, 0.02, 9)[:, None] * [0.0, 0.0, 1.0])
    mf.fold(mf.focus(tall, **PIXELS).assign_attrs(tx_aperture=np.hypot(0.008, 0.02)), sweep=tall)
