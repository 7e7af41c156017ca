"""Cylinders and spheres against the law of reflection, Fermat's principle and rays that are traced one by one."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from mirrorfold.common.beams import beam_radius, spread_beam
from mirrorfold.common.geometry import unit
from mirrorfold.common.round_surfaces import RoundSurface

UPRIGHT = RoundSurface(np.array([0.1, 2.0, 0.05]), np.array([0.0, 0.0, 1.0]), 0.3)
SLANTING = RoundSurface(np.array([0.1, 2.0, 0.05]), unit([0.3, 0.2, 0.9]), 0.12)
BALL = RoundSurface(np.array([-0.2, 1.7, 0.1]), np.zeros(3), 0.25)
SURFACES = pytest.mark.parametrize("surface", [UPRIGHT, SLANTING, BALL], ids=["upright", "slanting", "ball"])
RADAR = np.array([0.05, 0.0, -0.02])
BEAM = {"spot_radius": 0.0095, "focus_distance": 2.1, "wavelength": 1.05e-3}


def shown(surface, count=300):
    """Random points before a surface, and where it reflects rays to them."""
    random = np.random.default_rng(0)
    points = random.uniform([-1.5, 0.3, -0.7], [1.5, 1.8, 0.7], (count, 3))
    points = points[surface.beside(points) > 0.05]
    places, found = surface.reflection(RADAR, points)
    return points[found], places[found]


@SURFACES
@pytest.mark.nojit
def test_reflection_obeys_its_law(surface):
    points, places = shown(surface, 60)
    assert len(points) > 30
    assert_allclose(surface.beside(places), 0.0, atol=1e-12)
    normal, arrives, leaves = surface.outward(places), unit(places - RADAR), unit(points - places)
    assert np.all(np.sum(arrives * normal, axis=1) < 0.0)
    assert_allclose(leaves, arrives - 2.0 * np.sum(arrives * normal, axis=1)[:, None] * normal, atol=1e-9)
    # The same place is the first that the ray from the radar meets.
    assert_allclose(surface.met(RADAR, arrives), np.linalg.norm(places - RADAR, axis=1), atol=1e-9)


@SURFACES
def test_the_way_is_the_shortest_by_the_surface(surface):
    """On a convex mirror Fermat's stationary way is the shortest: any other place on it makes a longer one."""
    points, places = shown(surface)
    length = np.linalg.norm(places - RADAR, axis=1) + np.linalg.norm(points - places, axis=1)
    for step in np.random.default_rng(1).normal(scale=0.01, size=(5, 3)):
        other = surface.nearest(places + step)
        longer = np.linalg.norm(other - RADAR, axis=1) + np.linalg.norm(points - other, axis=1)
        assert np.all(longer > length)


@SURFACES
def test_what_stands_behind_is_not_shown(surface):
    behind = surface.middle + np.array([[0.0, 1.0, 0.0], [0.02, 0.5, 0.0]])
    assert not surface.reflection(RADAR, behind)[1].any()
    assert not surface.reflection(RADAR, surface.middle[None])[1].any()


@SURFACES
def test_bending_is_that_of_traced_rays(surface):
    """Turned by a small angle, a ray moves at its end by the lever of `spread_beam`, along both directions."""
    points, places = shown(surface)
    sight, before = unit(places - RADAR), np.linalg.norm(places - RADAR, axis=1)
    length = before + np.linalg.norm(points - places, axis=1)
    power, direction = surface.bending(sight, surface.outward(places))
    assert_allclose(np.sum(direction * sight, axis=1), 0.0, atol=1e-9)

    def end(turned):
        turned = unit(turned)
        range_ = surface.met(RADAR, turned)
        place = RADAR + range_[:, None] * turned
        normal = surface.outward(place)
        leaves = turned - 2.0 * np.sum(turned * normal, axis=1)[:, None] * normal
        return place + (length - range_)[:, None] * leaves

    for i, aside in enumerate((direction, np.cross(sight, direction))):
        moved = np.linalg.norm(end(sight + 1e-5 * aside) - end(sight - 1e-5 * aside), axis=1) / 2e-5
        assert_allclose(spread_beam(before, length - before, power[:, i], **BEAM)[1], moved, rtol=1e-6)


def test_a_flat_mirror_leaves_the_beam_as_it_is():
    before, rest = np.array([1.0, 2.0, 2.5]), np.array([0.5, 1.0, 0.1])
    width, lever = spread_beam(before, rest, 0.0, **BEAM)
    assert_allclose(width, beam_radius(before + rest, **BEAM), rtol=1e-12)
    assert_allclose(lever, before + rest)


@pytest.mark.parametrize("surface", [UPRIGHT, BALL], ids=["cylinder", "ball"])
@pytest.mark.parametrize("aside", [-0.9, 0.5])
def test_reflected_beam_is_that_of_the_waves(surface, aside):
    """Huygens' integral of the arriving beam over the mirror: intensity on the axis, and width along both directions.

    ``u(p) = (1 / lambda) integral u(x) cos(i) exp(-j k |p - x|) / |p - x| dS``, magnitudes alone.
    """
    point = np.array([aside, 1.4, 0.1])
    place, _ = surface.reflection(np.zeros(3), point[None])
    wavenumber = 2.0 * np.pi / BEAM["wavelength"]
    sight, normal = unit(place), surface.outward(place)
    before, rest = float(np.linalg.norm(place)), float(np.linalg.norm(point - place))
    power, direction = surface.bending(sight, normal)
    width, _ = spread_beam(before, rest, power[0], **BEAM)
    # The beam on a patch of the mirror, from its complex curvature there.
    cosine = -float(np.sum(sight * normal))
    step = np.arange(-0.03, 0.03, 2e-4)
    across = unit(np.cross(normal[0], [0.0, 0.0, 1.0]))
    flat = (step[:, None, None] * across / cosine + step[None, :, None] * np.cross(normal[0], across)).reshape(-1, 3)
    patch = surface.nearest(place + flat)
    # Area of the patch: that of the flat one over the cosine between both normals.
    area = (step[1] - step[0]) ** 2 / cosine / (surface.outward(patch) @ normal[0])
    rayleigh = np.pi * BEAM["spot_radius"] ** 2 / BEAM["wavelength"]
    ahead = patch @ sight[0]
    aside_of_axis = np.sum(patch**2, axis=1) - ahead**2
    beam = ahead - BEAM["focus_distance"] + 1j * rayleigh
    arriving = np.sqrt(2.0 / np.pi) / BEAM["spot_radius"] * 1j * rayleigh / beam
    arriving = arriving * np.exp(-1j * wavenumber * (ahead + aside_of_axis / (2.0 * beam)))
    incidence = np.abs(np.sum(surface.outward(patch) * sight, axis=1))
    leaves = unit(point - place)[0]
    # What is square to the incident ray turns into what is square to the reflected one.
    turned = direction[0] - 2.0 * (direction[0] @ normal[0]) * normal[0]
    directions = turned, np.cross(leaves, turned)

    def intensity(where):
        distance = np.linalg.norm(where - patch, axis=1)
        field = np.sum(arriving * incidence * np.exp(-1j * wavenumber * distance) / distance * area)
        return np.abs(field / BEAM["wavelength"]) ** 2

    on_axis = intensity(point)
    assert on_axis == pytest.approx(2.0 / (np.pi * width[0] * width[1]), rel=0.05)
    for radius, along in zip(width, directions, strict=True):
        beside = np.mean([intensity(point + side * 0.5 * radius * along) for side in (-1.0, 1.0)])
        # What is beyond second order about the axis bends its flanks.
        assert beside / on_axis == pytest.approx(np.exp(-0.5), rel=0.08)
