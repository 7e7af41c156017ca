"""Families of raster scans: the body out of the field of view, its image in it, walls that scatter as they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mirrorfold.common.beams import beam_angles
from mirrorfold.common.geometry import reflect, unit
from mirrorfold.errors import InputError
from mirrorfold.scenes.families import draw, raster
from mirrorfold.scenes.families.raster import FAMILIES, PROFILES, SCANNER
from mirrorfold.simulation import estimate
from mirrorfold.simulation.raster.meshes import solids

EDGE = 15.0
"""Of the field of view [degree]."""


def body(scene):
    """Vertices (n, 3) [m] of the mannequin."""
    return next(s for s in solids(scene) if scene.surface[s.surface].kind == "mannequin").vertices


@pytest.mark.slow
@pytest.mark.parametrize("first", [100, pytest.param(102, marks=pytest.mark.slow)])
@pytest.mark.parametrize("family", FAMILIES[4:], ids=lambda family: family.name)
def test_body_is_hidden_and_its_image_is_in_view(family, first):
    for seed in range(first, first + (2 if first == 100 else 18)):
        scene = draw(family, seed)
        assert np.abs(beam_angles(body(scene))[0]).min() > EDGE
        wall = next(surface for surface in scene.surface if surface.kind == "panel")
        azimuth, elevation = beam_angles(reflect(body(scene), wall.center, unit(wall.normal)))
        assert np.mean((np.abs(azimuth) < EDGE) & (np.abs(elevation) < EDGE)) > 0.6


@pytest.mark.parametrize("family", FAMILIES[:5], ids=lambda family: family.name)
def test_wall_scatters_inside_as_the_family_says(family):
    profile, least, largest = PROFILES[family.make.__name__.split()[0]]
    walls = [next(s for s in draw(family, seed).surface if s.kind == "panel") for seed in range(100, 120)]
    depths = [wall.volume_depth for wall in walls]
    if profile is None:
        assert not any(depths)
        return
    assert {wall.volume_profile for wall in walls} == {profile}
    assert least <= min(depths) < max(depths) <= largest
    assert max(depths) - min(depths) > 0.5 * (largest - least)


def test_walls_of_a_corridor_scatter_in_different_ways():
    profiles = set()
    for seed in range(100, 110):
        walls = [surface for surface in draw("raster corridor", seed).surface if surface.kind == "panel"]
        profiles |= {(wall.volume_profile, wall.volume_depth > 0.0) for wall in walls}
    assert len(profiles) == 4


@pytest.mark.slow
def test_scans_are_unambiguous():
    for name in ("raster deep", "raster corridor"):
        assert estimate(draw(name, 100)).needed_frequencies <= SCANNER.band["points"]


def test_a_view_that_holds_every_body_gets_one_sentence(monkeypatch):
    monkeypatch.setattr(raster, "MOST_DRAWS", 5)
    wide = {"start": -80.0, "stop": 80.0, "points": 81}
    radar = replace(SCANNER, name="wide", scanner=SCANNER.scanner | {"azimuth": wide})
    with pytest.raises(InputError, match="beside the view of radar 'wide'"):
        draw(FAMILIES[0], 100, radar=radar)
