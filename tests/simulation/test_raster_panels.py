"""Panels that waves pass through, in space: what they reflect and let through, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scans import ball, panel, scene
from scipy.constants import speed_of_light
from through_slabs import delay, shift

import mirrorfold as mf
from mirrorfold.common.slabs import slab
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.scenes.floor_plan import parse_scene
from mirrorfold.scenes.materials import permittivity
from mirrorfold.simulation import estimate
from mirrorfold.simulation.raster.chains import find_chains, trace_back, traced_scene
from mirrorfold.simulation.raster.echoes import find_echoes
from mirrorfold.simulation.raster.meshes import solids

THICK = 6e-3
CLEAR = {"permittivity": 2.6, "conductivity": 0.0}
"""Plasterboard without its losses, 30 dB a way through 12.5 mm at 285 GHz."""

LOSSY = {"permittivity": 2.6, "conductivity": 0.4}

NORMAL = {0.0: (0.0, -1.0, 0.0), 40.0: (-np.sin(np.radians(40.0)), -np.cos(np.radians(40.0)), 0.0)}

K = 2.0 * np.pi * np.linspace(270e9, 300e9, 61) / speed_of_light


def board(turn=0.0, material=CLEAR, thickness=THICK, **finish):
    return panel("board", (0.0, 1.5, 0.0), NORMAL[turn], 1.4, 1.4, material=material, thickness=thickness, **finish)


def sums(world, chain, point) -> tuple[Array, Array]:
    """What a chain leaves of a wave to a point (3,), one way, over the band; and how far aside that seems to stand."""
    frequency = 0.5 * (world.band.start + world.band.stop)
    traced = traced_scene(world, solids(world))
    seen, waves = trace_back(world, traced, np.zeros(3), chain, point[None], frequency=frequency)
    assert seen.all()
    total = sum(wave.amplitude[0] * np.exp(-1j * K * wave.extra[0]) for wave in waves)
    return total, waves[0].aside[0]


@pytest.mark.parametrize("polarization", ["TE", "TM"])
@pytest.mark.parametrize("turn", NORMAL)
def test_what_passes_is_what_a_slab_lets_through_over_the_band(turn, polarization):
    world = parse_scene(vars_of(scene(board(turn))) | {"polarization": polarization})
    found, _ = sums(world, (), np.array([0.0, 3.0, 0.0]))
    expected = slab(CLEAR["permittivity"], THICK, K, np.radians(turn), polarization)[1]
    assert np.abs(found - expected).max() < 2e-3


@pytest.mark.parametrize("turn", NORMAL)
def test_what_is_reflected_is_what_a_slab_reflects_at_its_front(turn):
    world = scene(board(turn))
    front = 0 if traced_scene(world, solids(world)).quads[0].normal @ NORMAL[turn] > 0.0 else 1
    place = np.array([0.0, 1.5, 0.0]) + 0.5 * THICK * np.array(NORMAL[turn])
    sight = place / np.linalg.norm(place)
    back = sight - 2.0 * (sight @ NORMAL[turn]) * np.array(NORMAL[turn])
    found, _ = sums(world, (front,), place + 0.8 * back)
    angle = np.arccos(-sight @ NORMAL[turn])
    expected = slab(CLEAR["permittivity"], THICK, K, angle, "TE")[0]
    assert np.abs(found - expected).max() < 2e-3


@pytest.mark.parametrize("turn", NORMAL)
@pytest.mark.parametrize("material", [CLEAR, LOSSY, "plasterboard"])
def test_no_more_is_reflected_and_let_through_than_arrives(turn, material):
    world = scene(board(turn, material, diffuse_fraction=0.3))
    place = np.array([0.0, 1.5, 0.0]) + 0.5 * THICK * np.array(NORMAL[turn])
    sight = place / np.linalg.norm(place)
    back = sight - 2.0 * (sight @ NORMAL[turn]) * np.array(NORMAL[turn])
    traced = traced_scene(world, solids(world))
    front = 0 if traced.quads[0].normal @ NORMAL[turn] > 0.0 else 1
    frequency = 0.5 * (world.band.start + world.band.stop)
    reflected = trace_back(world, traced, np.zeros(3), (front,), (place + 0.8 * back)[None], frequency=frequency)[1]
    passed = trace_back(world, traced, np.zeros(3), (), 2.0 * place[None], frequency=frequency)[1]
    power = [np.abs(sum(w.amplitude[0] * np.exp(-1j * K * w.extra[0]) for w in waves)) ** 2
             for waves in (reflected, passed)]  # fmt: skip
    assert (power[0] + power[1]).max() < 1.0
    assert power[0].max() > 0.0


def test_a_lossless_board_keeps_all_energy():
    reflected, passed = slab(CLEAR["permittivity"], THICK, K, 0.0)
    world = scene(board())
    found, _ = sums(world, (), np.array([0.0, 3.0, 0.0]))
    assert np.abs(np.abs(found) ** 2 + np.abs(reflected) ** 2 - 1.0).max() < 5e-3
    np.testing.assert_allclose(found, passed, atol=2e-3)


def test_delay_and_shift_are_those_of_snells_law():
    """The way from a scanner to a point through a plate, by Snell's law: the shortest of all."""
    turn = np.radians(40.0)
    normal = -np.array(NORMAL[40.0])
    point, eps = np.array([0.1, 2.9, 0.15]), CLEAR["permittivity"]

    def length(origin):
        """Optical path: in the plane of incidence, by the angle whose ray arrives."""
        way = point - origin
        deep = way @ normal
        aside = np.linalg.norm(way - deep * normal)
        low, high = 0.0, 0.5 * np.pi - 1e-6
        for _ in range(100):
            angle = 0.5 * (low + high)
            inside = np.arcsin(np.sin(angle) / np.sqrt(eps))
            lands = (deep - THICK) * np.tan(angle) + THICK * np.tan(inside)
            low, high = (angle, high) if lands < aside else (low, angle)
        return (deep - THICK) / np.cos(angle) + np.sqrt(eps) * THICK / np.cos(inside)

    world = scene(board(40.0))
    seen, waves = trace_back(world, traced_scene(world, solids(world)), np.zeros(3), (), point[None], frequency=285e9)
    range_ = np.linalg.norm(point)
    assert seen.all()
    assert range_ + waves[0].extra[0] == pytest.approx(length(np.zeros(3)), abs=5e-6)
    assert waves[0].extra[0] == pytest.approx(delay(eps, THICK, np.arccos(point @ normal / range_)), abs=1e-9)
    assert np.linalg.norm(waves[0].aside[0]) == pytest.approx(
        shift(eps, THICK, np.arccos(point @ normal / range_)), abs=1e-9
    )
    # The direction of arrival is minus the slope of the length over the place of the scanner.
    step = 1e-4 * np.eye(3)
    slope = np.array([(length(one) - length(-one)) / 2e-4 for one in step])
    apparent = point * (1.0 + waves[0].extra[0] / range_) + waves[0].aside[0]
    np.testing.assert_allclose(apparent / np.linalg.norm(apparent), -slope / np.linalg.norm(slope), atol=2e-6)
    assert turn > 0.0


def vars_of(world):
    from pydantic import TypeAdapter

    return TypeAdapter(type(world)).dump_python(world)


def measured(*surfaces, **settings):
    world = scene(*surfaces, half=3.0, beams=11, points=801, **settings)
    return mf.simulate(world, bounces=1, seed=0)["s"].values


BALL = ball("ball", (0.0, 2.4, 0.0))


def test_a_board_of_permittivity_one_is_as_if_it_were_not_there():
    air = board(40.0, {"permittivity": 1.0, "conductivity": 0.0}, roughness=None)
    np.testing.assert_array_equal(measured(BALL, air), measured(BALL))


@pytest.mark.parametrize("conductivity", [None, 1e5])
def test_a_metal_board_hides_everything(conductivity):
    """Without a thickness; or as a slab of a conductivity that lets nothing through."""
    metal = {"material": "pec", "diffuse_fraction": 0.5} if conductivity is None else {
        "material": {"permittivity": 2.6, "conductivity": conductivity}, "diffuse_fraction": 0.5, "thickness": THICK,
    }  # fmt: skip
    front = panel("board", (0.0, 1.5, 0.0), NORMAL[40.0], 1.4, 1.4, **metal)
    np.testing.assert_array_equal(measured(front, BALL), measured(front))


def test_a_thing_behind_a_board_is_dimmed_twice_delayed_and_shifted():
    world = scene(board(40.0, LOSSY), BALL, half=3.0, beams=7, points=801)
    bare = scene(BALL, half=3.0, beams=7, points=801)
    through, _ = find_echoes(world, bounces=0, seed=0)
    direct, _ = find_echoes(bare, bounces=0, seed=0)
    count = len(direct.range)
    # The first of the waves is the strongest; the others have run to and fro in the board.
    first = np.argsort(-np.abs(through.amplitude))[: 2 * count]
    eps = permittivity(parse_scene(vars_of(world)).surface[0].material, 285e9)
    late = through.range[first].mean() - direct.range.mean()
    assert late == pytest.approx(float(delay(eps, THICK, np.radians(40.0))), rel=0.2)
    power = np.sum(np.abs(through.amplitude) ** 2) / np.sum(np.abs(direct.amplitude) ** 2)
    one_way = np.abs(slab(eps, THICK, K, np.radians(40.0), "TE")[1]) ** 2
    # The power of the sum of all waves, in the mean over the band.
    assert power == pytest.approx(np.mean(one_way**2), rel=0.15)


def test_boards_show_what_stands_before_them_and_behind():
    world = scene(board(40.0), ball("before", (-1.1, 1.3, 0.0)), BALL, half=12.0, beams=7, points=801)
    traced = traced_scene(world, solids(world))
    fan = np.array([[0.0, 1.0, 0.0]])
    chains = find_chains(world, traced, np.zeros(3), fan, bounces=2, frequency=285e9)
    assert len(chains) >= 2
    echoes, _ = find_echoes(world, bounces=1, seed=0)
    assert {0, 1} <= set(echoes.bounces)


def test_thickness_is_refused_where_nothing_passes():
    with pytest.raises(InputError, match="lets nothing through"):
        scene(board(material="pec"))
    with pytest.raises(InputError, match="homogeneous"):
        scene(board(volume_depth=0.01))
    band = {"band": {"start": 500e9, "stop": 510e9, "points": 20}}
    with pytest.raises(InputError, match="fit holds"):
        parse_scene(vars_of(scene(board(material="glass"))) | band)
    with pytest.warns(UserWarning, match="extrapolated"):
        parse_scene(vars_of(scene(board(material="glass", thickness=None))) | band)


def test_both_polarizations_are_one_sweep_of_the_same_scatterers():
    content = vars_of(scene(board(40.0), BALL, half=1.0, beams=5, points=801))
    both = mf.simulate(parse_scene(content | {"polarization": "both"}), bounces=1, seed=0)
    assert both["s"].dims == ("polarization", "frequency", "azimuth", "elevation")
    for name in ("TE", "TM"):
        one = mf.simulate(parse_scene(content | {"polarization": name}), bounces=1, seed=0)
        np.testing.assert_array_equal(both["s"].sel(polarization=name).values, one["s"].values)
    image = mf.focus(both)
    assert image.dims == ("polarization", "range", "azimuth", "elevation")
    alone = mf.focus(mf.simulate(parse_scene(content), bounces=1, seed=0))
    np.testing.assert_array_equal(image.sel(polarization="TE").values, alone.values)


@pytest.mark.parametrize(
    ("center", "normal", "thickness"),
    [
        ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), THICK),
        ((0.3, 0.002, 0.2), (0.0, -1.0, 0.0), THICK),
        ((0.0, 0.0, 0.0), (-1.0, -1.0, 0.0), None),
    ],
    ids=["along the view", "around the scanner", "opaque"],
)
def test_a_scanner_that_stands_on_a_panel_is_refused(center, normal, thickness):
    """No beam would meet such a panel: the scene was simulated as if it had none."""
    finish = {"material": CLEAR, "thickness": thickness} if thickness else {"material": "pec"}
    through = panel("through", center, normal, 1.0, 1.0, **finish)
    target = panel("target", (0.0, 1.2, 0.0), NORMAL[0.0], 1.0, 1.0)
    for work in (mf.simulate, estimate):
        with pytest.raises(InputError, match=r"^scanner: its origin stands on surface\[1\] 'through', .* move one of"):
            work(scene(target, through))
    away = panel("away", (0.5, 0.5, 0.0), (-1.0, 0.0, 0.0), 0.98, 1.0, material=CLEAR, thickness=THICK)
    assert mf.simulate(scene(target, away), seed=0)["s"].values.any()
