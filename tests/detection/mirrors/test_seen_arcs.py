"""Parts of given arcs that the radar sees: each line of sight ends where it first meets what was drawn."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from synthetic import RANGE_CELL, diffuse, echoes_at, empty_view, radar_image

import mirrorfold as mf
from mirrorfold.common.arcs import arc_through
from mirrorfold.detection.mirrors.arc_mirror import ArcMirror
from mirrorfold.detection.mirrors.known_mirrors import check_mirrors, known_mirrors
from mirrorfold.detection.mirrors.seen_arcs import seen_parts

TURN = 2.0 * np.pi


def first_hit(arcs, sight):
    """Range at which each ray first meets any of the arcs, by the quadratic equation, one root after the other."""
    first = np.full(len(sight), np.inf)
    for arc in arcs:
        offset = arc.radar - arc.middle
        nearest = -(sight @ offset)
        with np.errstate(invalid="ignore"):
            half = np.sqrt(nearest**2 - (offset @ offset - arc.radius**2))
        for range_ in (nearest - half, nearest + half):
            met = offset + range_[:, None] * sight
            angle = (np.arctan2(met[:, 1], met[:, 0]) - arc.first) % TURN
            first = np.where((range_ > 0.0) & (angle <= arc.span), np.fmin(first, range_), first)
    return first


def drawn(middle, radius, cuts, kept, radar=(0.0, 0.0)):
    """Those pieces of a circle that are kept, cut at the angles [rad], counter-clockwise."""
    spans = np.diff([*cuts, cuts[0] + TURN])
    arcs = [ArcMirror(np.array(middle), radius, a, s, np.array(radar)) for a, s in zip(cuts, spans, strict=True)]
    return [arc for arc, keep in zip(arcs, kept, strict=True) if keep]


@pytest.mark.parametrize("seed", range(40))
def test_every_line_of_sight_ends_where_it_first_meets_an_arc(seed):
    random = np.random.default_rng(seed)
    radius, radar = random.uniform(0.1, 2.0), random.uniform(-1.0, 1.0, 2)
    middle = radar + random.uniform(0.2, 3.0) * radius * np.array([np.cos(seed), np.sin(seed)])
    count = int(random.integers(2, 5))
    arcs = drawn(middle, radius, np.sort(random.uniform(0.0, TURN, count)), random.random(count) < 0.8, radar)
    angle = random.uniform(0.0, TURN, 500)
    sight = np.stack([np.cos(angle), np.sin(angle)], axis=1)  # to all sides
    found = np.full(len(sight), np.inf)
    for part in (part for several in seen_parts(arcs) for part in several):
        range_ = part.met(sight)
        with np.errstate(invalid="ignore"):
            along = part.along(radar + range_[:, None] * sight)
            on_it = (range_ > 0.0) & (along >= 0.0) & (along <= part.length)
        assert not (np.isfinite(found) & on_it).any()  # no part stands before another
        found[on_it] = range_[on_it]
    np.testing.assert_allclose(found, first_hit(arcs, sight), rtol=1e-9)


def test_arcs_that_are_seen_from_one_side_stay_as_they_are():
    """To the last bit, so that mirrors of a result are given again as they were."""
    near = ArcMirror(np.array([0.3, 1.6]), 0.4, np.radians(200.0), np.radians(100.0), np.zeros(2))
    bay = ArcMirror(np.array([0.0, 0.5]), 1.0, np.radians(30.0), np.radians(120.0), np.zeros(2))
    (first,), (second,) = seen_parts([near, bay])
    assert first is near
    assert second is bay


PILLAR = np.array([0.3, 1.6]), 0.3


def pieces(*angles):
    """Arcs of the pillar between each two angles [degree], as given mirrors."""
    middle, radius = PILLAR
    angles = np.radians(angles)

    def at(a):
        return (middle + radius * np.array([np.cos(a), np.sin(a)])).tolist()

    return [{"start": at(a), "through": at(0.5 * (a + b)), "end": at(b)} for a, b in pairwise(angles)]


def test_a_pillar_folds_alike_however_its_circle_is_cut():
    """Its far side was a concave mirror, and what the near side shows was folded half a metre off."""
    near = check_mirrors(pieces(150.0, 350.0))
    face = arc_through(*near[0], count=400)
    positions = np.concatenate([face, diffuse([0.45, 1.95], [0.55, 1.9], seed=3)[0]])
    image = radar_image(positions, np.ones(len(positions)), np.linspace(-0.4, 1.2, 161), np.linspace(0.8, 2.4, 161))
    expected = hidden_in(mf.fold(image, mirrors=near))
    assert len(expected) > 3
    for cut in ((0.0, 180.0, 360.0), (90.0, 270.0, 450.0), (61.0, 420.0)):
        # Where two pieces meet, between two lines of sight, echoes are reflected by the end of either.
        np.testing.assert_allclose(hidden_in(mf.fold(image, mirrors=pieces(*cut))), expected, atol=0.2 * RANGE_CELL)


def hidden_in(reconstruction):
    """Places (n, 2) [m] of the echoes that a mirror shows, from left to right."""
    points = reconstruction.children["objects"].to_dataset(inherit=False).to_dataframe()
    points = points[(points["bounces"] > 0) & ~points["interpolated"]]
    return points[["x", "y"]].sort_values("x").to_numpy()


def test_both_faces_of_a_pillar_that_is_open_to_the_radar_are_mirrors():
    """Through the gap in its near side the radar looks at the inner face."""
    view = empty_view()
    given = check_mirrors(pieces(280.0, 530.0))
    far, near = sorted(known_mirrors(given, echoes_at(view, [0.3, 1.3]), view), key=lambda mirror: mirror.curvature)
    assert near.curvature == pytest.approx(1.0 / 0.3)
    assert far.curvature == pytest.approx(-1.0 / 0.3)
