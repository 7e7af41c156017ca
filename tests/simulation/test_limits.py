"""A scene in wrong units, or too large for any memory, is refused with numbers before any work."""

from __future__ import annotations

import time
import warnings
from dataclasses import replace
from functools import partial

import pytest

import mirrorfold as mf
from mirrorfold.simulation import estimate
from mirrorfold.simulation.limits import check_extent

SCENE = {
    "name": "two walls",
    "array": {"elements": 161, "pitch": 0.5e-3},
    "band": {"start": 290e9, "stop": 300e9, "points": 401},
    "surface": [{"name": "wall 2", "kind": "segment", "start": [0.55, 1.88], "end": [0.85, 0.92]}],
}

SCAN = {
    "name": "a box",
    "dimensions": 3,
    "scanner": {
        "azimuth": {"start": -30, "stop": 30, "points": 61},
        "elevation": {"start": -10, "stop": 10, "points": 21},
        "spot_radius": 0.015,
        "focus_distance": 2.0,
    },
    "band": {"start": 290e9, "stop": 300e9, "points": 401},
    "surface": [{"name": "box", "kind": "box", "center": [0.0, 2.0, 0.0], "size": [0.2, 0.2, 0.2]}],
}


def changed(scene, **parts):
    return scene | {name: ([scene[name][0] | part] if name == "surface" else scene[name] | part)
                    for name, part in parts.items()}  # fmt: skip


WRONG = {
    "a wall in millimetres": (changed(SCENE, surface={"start": [550, 1880], "end": [850, 920]}), "reaches 19"),
    "one end in millimetres": (changed(SCENE, surface={"start": [0.55, 1880]}), "1880 m from the radar"),
    "a wall in centimetres": (changed(SCENE, surface={"start": [55, 188], "end": [85, 92]}), "perhaps .* cm were|mm"),
    "400 000 elements": (changed(SCENE, array={"elements": 400_000}), r"400000 receivers x 401 .* are 5.13e\+05"),
    "a pitch in millimetres": (changed(SCENE, array={"pitch": 0.5}), '"0.5 mm" was meant as pitch'),
    "a band in GHz": (changed(SCENE, band={"start": 290, "stop": 300}), '"300 GHz" was meant'),
    "a band in MHz": (changed(SCENE, band={"start": 290_000, "stop": 300_000}), '"300000 MHz" was meant'),
    "a scan in GHz": (changed(SCAN, band={"start": 290, "stop": 300}), '"300 GHz" was meant'),
    "a box in millimetres": (changed(SCAN, surface={"center": [0.0, 2000.0, 0.0]}), "2000 m from the radar"),
    "a million beams": (
        changed(SCAN, scanner={"azimuth": {"start": -30, "stop": 30, "points": 1_000_000}}), "1000000 x 21 beams",
    ),
}  # fmt: skip


@pytest.mark.parametrize("slip", WRONG)
def test_a_slip_is_refused_with_numbers_before_any_work(slip):
    content, words = WRONG[slip]
    start = time.process_time()
    with pytest.raises(mf.InputError, match=words):
        mf.simulate(content)
    with pytest.raises(mf.InputError, match=words):
        estimate(content, solver="fullwave")
    assert time.process_time() - start < 1.0


THROUGH = {
    "a wall along the array": {"kind": "segment", "start": [-1.0, 0.0], "end": [1.0, 0.0]},
    "a wall across the middle": {"kind": "segment", "start": [-1.0, -1.0], "end": [1.0, 1.0]},
    "inside a thick wall": {"kind": "polyline", "points": [[-1.0, 0.04], [1.0, 0.04]], "thickness": 0.1,
                            "material": "glass"},
    "a pillar that touches": {"kind": "circle", "center": [0.0, 0.20001], "radius": 0.2},
    "an arc through it": {"kind": "arc", "center": [0.0, -0.3], "radius": 0.3, "start_angle": 60, "stop_angle": 120},
}  # fmt: skip


@pytest.mark.parametrize("slip", THROUGH)
def test_antennas_on_a_surface_are_refused_by_rays_too(slip):
    content = SCENE | {"surface": [{"name": "wall", **THROUGH[slip]}]}
    for work in (mf.simulate, estimate):
        with pytest.raises(
            mf.InputError, match=r"^array: the antenna at .* m stands on surface\[0\] 'wall', .* move one"
        ):
            work(content)


def test_antennas_near_a_surface_are_not_refused():
    for wall in (
        {"kind": "segment", "start": [-1.0, 0.001], "end": [1.0, 0.001]},
        {"kind": "arc", "center": [0.0, -0.3], "radius": 0.3, "start_angle": 150, "stop_angle": 200},
        {"kind": "segment", "start": [0.041, 0.0], "end": [1.0, 0.0]},
    ):
        mf.simulate(changed(SCENE, band={"points": 2}) | {"surface": [{"name": "wall", **wall}]}, snr_db=20.0)


def test_scenes_of_other_waves_and_sizes_are_not_refused():
    for content in (
        SCENE,
        SCAN,
        changed(SCENE, band={"points": 2}),  # ambiguous within centimetres, as a continuous wave is
        changed(SCENE, array={"elements": 1}),
        {**SCENE, "array": {"elements": 40, "pitch": 2.0}, "band": {"start": 50e6, "stop": 80e6, "points": 401},
         "surface": [{"name": "hill", "kind": "segment", "start": [-500, 1500], "end": [500, 1500]}]},
    ):  # fmt: skip
        check_extent(mf.parse_scene(content))


@pytest.mark.parametrize("bounces", [1001, 1e308])
def test_more_bounces_than_echoes_survive_are_refused(bounces, reconstruction):
    scene = mf.parse_scene(SCENE)
    for work in (mf.simulate, estimate, lambda scene, bounces: mf.score(reconstruction, scene, bounces=bounces)):
        with pytest.raises(mf.InputError, match=r"bounces is .*, expected a whole number from 0 to 1000"):
            work(scene, bounces=bounces)


ARC = {"kind": "arc", "name": "arc", "center": [0.0, 1.0], "radius": 0.25}


@pytest.mark.parametrize(("height", "length"), [(50.0, 0.2e-3), (50e-6, 200.0)])
@pytest.mark.parametrize("surface", [SCENE["surface"][0], ARC | {"start_angle": 200.0, "stop_angle": 340.0}])
def test_a_roughness_in_metres_is_refused(surface, height, length):
    rough = surface | {"roughness": {"rms_height": height, "correlation_length": length}}
    scene = mf.parse_scene(SCENE | {"surface": [rough]})
    with pytest.raises(mf.InputError, match=r'of its roughness is .* write it with its unit, as in "50 um"'):
        check_extent(scene)
    assert any("roughness" in remark for remark in mf.info(scene)["remarks"])


@pytest.mark.parametrize(("angles", "told"), [((-1.237, 0.763), True), ((-70.9, 43.7), False), ((-1.0, 1.0), False)])
def test_an_arc_with_angles_in_radians_is_told(angles, told):
    scene = mf.parse_scene(SCENE | {"surface": [ARC | dict(zip(("start_angle", "stop_angle"), angles, strict=True))]})
    assert any('if these are radians, write "' in remark for remark in mf.info(scene)["remarks"]) == told
    few = replace(scene, array=replace(scene.array, elements=2), band=replace(scene.band, points=2))
    for work in (partial(mf.simulate, snr_db=20.0), estimate):
        with warnings.catch_warnings(record=True) as noted:
            warnings.simplefilter("always")
            work(few)
        assert any("if these are radians" in str(note.message) for note in noted) == told
