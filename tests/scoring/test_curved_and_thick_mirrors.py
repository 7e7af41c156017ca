"""Curved mirrors are judged by the nearest true curve, and walls with a thickness by the face that is seen."""

from __future__ import annotations

import floor_plans
import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf

CENTER, RADIUS = np.array([0.3, 2.0]), 0.35
PILLAR = {"kind": "circle", "center": CENTER.tolist(), "radius": RADIUS}
DOOR = {"kind": "segment", "start": [-0.4, 1.0], "end": [0.4, 1.0], "material": "glass", "thickness": 6e-3}


def on_circle(radius, center=CENTER, first=200.0, last=300.0):
    """Start, middle and end of an arc between two angles [degree]."""
    angle = np.radians(np.linspace(first, last, 3))
    return center + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def with_mirror(reconstruction, start, end, middle=None, curvature=0.0):
    """The reconstruction with one mirror in line of sight."""
    values = dict(zip(("x0", "y0", "x1", "y1"), (*start, *end), strict=True))
    if middle is not None:
        values |= {"xm": middle[0], "ym": middle[1]}
    values |= {f"folded_{name}": value for name, value in values.items()}
    values |= {"parent": -1, "generation": 1, "strength": 1.0}
    if middle is not None:
        values["curvature"] = curvature
    reconstruction["mirrors"] = xr.Dataset({name: ("mirror", np.array([value])) for name, value in values.items()})
    return reconstruction


@pytest.mark.parametrize(("radius", "shift"), [(RADIUS, 0.0), (1.02 * RADIUS, 0.0), (RADIUS, 0.004)])
def test_an_arc_is_judged_by_offset_and_curvature(reconstruction, radius, shift):
    start, middle, end = on_circle(radius)
    outward = (middle - CENTER) / radius
    away = shift * outward
    held = with_mirror(reconstruction, start + away, end + away, middle + away, 1.0 / radius)
    (found,) = mf.score(held, floor_plans.make_scene(PILLAR)).mirrors
    assert found.surface == "surface 0"
    assert found.offset_error_mm == pytest.approx(1e3 * (radius - RADIUS + shift), abs=1e-2)
    assert found.angle_error_deg == pytest.approx(0.0, abs=1e-2)
    assert found.curvature_error == pytest.approx(1.0 - RADIUS / radius, abs=1e-3)
    assert found.length_m == pytest.approx(radius * np.radians(100.0), rel=1e-3)


def test_an_arc_bent_the_other_way_has_the_wrong_curvature(reconstruction):
    touching = CENTER + (RADIUS + 0.02) * np.array([0.0, -1.0])
    start, middle, end = on_circle(2.0, touching - np.array([0.0, 2.0]), 80.0, 100.0)
    held = with_mirror(reconstruction, start, end, middle, -0.5)
    (found,) = mf.score(held, floor_plans.make_scene(PILLAR)).mirrors
    assert found.curvature_error > 1.0


def test_a_flat_mirror_has_no_error_of_curvature(reconstruction):
    held = with_mirror(reconstruction, [-0.4, 1.0], [0.4, 1.0])
    (found,) = mf.score(held, floor_plans.make_scene(DOOR, PILLAR)).mirrors
    assert "curvature_error" not in found


@pytest.mark.parametrize(("y", "offset"), [(0.997, 0.0), (0.9971, 0.1), (1.0, 3.0), (1.003, 6.0)])
def test_the_face_that_the_radar_sees_is_the_truth_of_a_pane(reconstruction, y, offset):
    held = with_mirror(reconstruction, [-0.3, y], [0.3, y])
    (found,) = mf.score(held, floor_plans.make_scene(DOOR)).mirrors
    assert found.surface == "surface 0"
    assert found.offset_error_mm == pytest.approx(offset, abs=1e-6)


@pytest.mark.parametrize("measured", [(6.0, 5.7e-3), (np.nan, np.nan)])
def test_what_was_measured_of_a_pane_is_judged_by_the_true_one(reconstruction, measured):
    held = with_mirror(reconstruction, [-0.3, 0.997], [0.3, 0.997])
    own = {name: ("mirror", [value]) for name, value in zip(("permittivity", "thickness"), measured, strict=True)}
    held["mirrors"] = held["mirrors"].to_dataset().assign(own)
    (found,) = mf.score(held, floor_plans.make_scene(DOOR)).mirrors
    if np.isnan(measured[0]):
        assert "permittivity_error" not in found
        assert "thickness_error" not in found
    else:
        assert found.permittivity_error == pytest.approx(6.0 / 5.79 - 1.0)  # glass, Recommendation ITU-R P.2040-4
        assert found.thickness_error == pytest.approx(0.05)
