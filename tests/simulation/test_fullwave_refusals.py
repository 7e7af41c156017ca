"""What the full-wave solver refuses before any work, in which words, and what it warns of."""

from __future__ import annotations

import warnings
from dataclasses import replace

import pytest
from fullwave_scenes import STRIP, WALL, scene_of
from scans import ball, content

import mirrorfold as mf
from mirrorfold.errors import InputError
from mirrorfold.simulation import estimate
from mirrorfold.simulation.fullwave import sweep as fullwave
from mirrorfold.simulation.fullwave.estimate import Estimate
from mirrorfold.simulation.fullwave.preparation import prepare
from mirrorfold.simulation.fullwave.sweep import check_resources, longest_strong_echo

pytestmark = pytest.mark.filterwarnings("ignore:.*strong echoes")


def refused(*surfaces: dict, **options: object) -> str:
    with pytest.raises(InputError) as error:
        mf.simulate(scene_of(*surfaces), solver="fullwave", **options)
    message = str(error.value)
    assert "\n" not in message
    assert len(message) < 400
    return message


def test_crossing_surfaces():
    message = refused(STRIP, {"kind": "segment", "start": [0.0, 0.04], "end": [0.002, 0.06]})
    assert "surface[0] 'surface 0' crosses or touches surface[1] 'surface 1' near (0.00" in message


def test_a_surface_that_touches_itself():
    flag = {"kind": "polyline", "points": [[-0.01, 0.05], [0.01, 0.05], [0.01, 0.06], [0.0, 0.05]]}
    assert "crosses or touches itself near" in refused(flag)


def test_surfaces_that_touch_at_a_corner_of_their_own():
    message = refused(STRIP, {"kind": "segment", "start": [0.01, 0.055], "end": [0.02, 0.05]})
    assert "join both to one polyline" in message


@pytest.mark.parametrize(
    "surface",
    [
        {"kind": "polyline", "points": [[-0.01, 0.05], [0.01, 0.05], [0.0, 0.07], [-0.01, 0.05]]},
        {"kind": "circle", "center": [0.0, 0.06], "radius": 0.005},
        {"kind": "polyline", "points": [[-0.01, 0.05], [0.01, 0.05], [-0.01, 0.056]]},
    ],
    ids=["triangle", "circle", "sharp"],
)
def test_closed_and_sharp_surfaces_do_not_cross_themselves(surface):
    prepare(scene_of(surface))


def test_profile_steeper_than_nodes_can_follow():
    steep = {"rms_height": 1e-5, "correlation_length": 2e-6}
    assert "rms slope of 7.07; expected at most 2" in refused({**STRIP, "roughness": steep})


def test_a_scene_of_a_hundred_thousand_wavelengths_is_refused_before_the_work():
    message = refused({"kind": "segment", "start": [-50.0, 10.0], "end": [50.0, 10.0]})
    assert "GB of memory, but" in message


def test_antenna_on_a_surface():
    message = refused({"kind": "segment", "start": [-0.01, 0.0001], "end": [0.01, 0.0001]})
    assert "array: the antenna at" in message
    assert "stands on surface[0]" in message


def test_surface_without_length():
    with pytest.raises(InputError, match="start and end are the same point"):
        scene_of({"kind": "segment", "start": [0.0, 0.05], "end": [0.0, 0.05]})


def test_other_materials_name_the_solver_that_takes_them():
    message = refused({**STRIP, "material": "concrete"})
    assert "'concrete'" in message
    assert "use solver 'rays'" in message
    assert "volume_depth" in refused({**STRIP, "volume_depth": 0.01})


def test_mesh_too_coarse_for_the_roughness():
    fine = {"rms_height": 0.01e-3, "correlation_length": 0.1e-3}
    scene = scene_of({**STRIP, "roughness": fine})
    with pytest.raises(InputError, match=r"too coarse for spacings of half a correlation length; expected at least 20"):
        prepare(scene, nodes_per_wavelength=12)
    prepare(scene)


def test_no_surfaces_and_antennas_out_of_the_plane():
    assert "has no surfaces" in refused()
    scene = scene_of(STRIP)
    with pytest.raises(InputError, match=r"stands at z = 0\.1 m"):
        mf.simulate(replace(scene, array=replace(scene.array, center=(0.0, 0.0, 0.1))), solver="fullwave")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"tolerance": 0.0}, "tolerance is 0.0, expected a number from 3e-05 to 0.1"),
        ({"workers": 0}, "workers is 0, expected a whole number of at least 1"),
        ({"resume": True}, "resume needs the folder"),
        ({"bounces": 5}, "bounces is an option of the solver 'rays', not of 'fullwave'"),
    ],
)
def test_wrong_options(options, message):
    assert message in refused(STRIP, **options)


def test_options_that_rays_do_not_know():
    with pytest.raises(InputError, match="tolerance is an option of the solver 'fullwave', not of 'rays'"):
        mf.simulate(scene_of(STRIP), tolerance=1e-4)


@pytest.mark.slow
def test_no_scheduler_at_the_address(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr("mirrorfold.simulation.fullwave.tasks.CONNECT_SECONDS", 1)
    assert "no Dask scheduler answers at 'tcp://127.0.0.1:9'" in refused(STRIP, scheduler="tcp://127.0.0.1:9")


def test_not_enough_memory_or_disk(tmp_path):
    huge = Estimate(unknowns=10**6, skeletons=10**5, seconds_per_frequency=1e4, memory=1e15, disk=1.0)
    with pytest.raises(InputError, match=r"workers: 2 processes need 2000000.0 GB of memory.*smaller scene"):
        check_resources(huge, workers=2, folder=None)
    with pytest.raises(InputError, match=r"sweep needs 1e\+09 GB of disk"):
        check_resources(replace(huge, memory=1.0, disk=1e18), workers=1, folder=tmp_path / "not" / "there")


def test_too_few_frequencies_for_the_echoes_are_told_with_the_number_needed():
    # The return over two parallel mirrors, there and back, comes from 0.4 m and beyond.
    far = {"kind": "segment", "start": [-0.1, 0.4], "end": [0.1, 0.4], "roughness": WALL}
    few, many = (scene_of(far, elements=3, points=points) for points in (11, 61))
    assert longest_strong_echo(many) == pytest.approx(0.41, abs=0.05)
    with pytest.warns(UserWarning, match="strong echoes come from up to 0.4.* m, but 11 frequencies") as caught:
        fullwave.warn_of_wrapped_echoes(few)
    needed = int(str(caught[0].message).split("use at least ")[1].split()[0])
    assert 26 <= needed <= 32
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fullwave.warn_of_wrapped_echoes(many)


@pytest.mark.parametrize("points", [2, 3, 5])
def test_with_few_frequencies_near_echoes_do_not_count_as_late_ones(points):
    """A strip 5 cm away returns nothing from beyond 0.3 m or more, however wide its lobe in so few range bins."""
    few = scene_of(STRIP, elements=3, points=points)
    few = replace(few, band=replace(few.band, stop=few.band.start + 0.5e9 * (points - 1)))
    assert few.band.ambiguous_range > 0.29
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fullwave.warn_of_wrapped_echoes(few)


def test_the_warning_of_late_echoes_belongs_to_the_line_that_asked():
    far = scene_of({"kind": "segment", "start": [-0.01, 0.4], "end": [0.01, 0.4]}, elements=3, points=11)
    with pytest.warns(UserWarning, match="strong echoes") as caught:
        estimate(far, solver="fullwave")
    assert [one.filename for one in caught] == [__file__]
    with pytest.warns(UserWarning, match="strong echoes") as caught:
        mf.simulate(far, solver="fullwave")
    assert [one.filename for one in caught] == [__file__]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"solver": "fullwav"}, "solver is 'fullwav'"),
        ({"workers": 0}, "workers is 0"),
        ({"seed": 1.5}, "seed is 1.5"),
    ],
)
def test_estimates_refuse_what_simulations_refuse(scene_file, given, said):
    for function in (estimate, mf.simulate):
        with pytest.raises(InputError, match=said):
            function(mf.load_scene(scene_file), **given)


@pytest.mark.parametrize("function", [estimate, mf.simulate])
def test_full_waves_have_two_dimensions(function):
    with pytest.raises(InputError, match="the solver 'fullwave' has two dimensions"):
        function(content(ball(center=(0.0, 2.0, 0.0))), solver="fullwave")
