"""What is given as a text with a unit, as a path or by another kind of list means what it says, or is refused."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf
from mirrorfold.common.arguments import boolean, listed, number, one_of, path_of, whole_number
from mirrorfold.plotting import volumes

BASE = {"band": (76e9, 81e9), "points": 101, "aperture": 0.08, "pitch": 1e-3, "range": 3.0}


@pytest.mark.parametrize(
    "given",
    [
        {"aperture": "80 mm"},
        {"pitch": "1mm"},
        {"range": "3m"},
        {"band": ("76GHz", "81 GHz")},
        {"roughness": ("50 um", None)},
        {"materials": "plasterboard"},
        {"leg": np.float32(1.5)},
        {"target": np.array(1e-3)},
    ],
)
def test_a_plan_reads_texts_with_units(given):
    assert mf.plan(**BASE | given) == mf.plan(**BASE)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"aperture": None}, "aperture is None, expected a number of metres from 1e-09 to 1e"),
        ({"aperture": "80 GHz"}, "aperture: '80 GHz' is no length"),
        ({"band": 76e9}, "band is 76000000000.0, expected two rising frequencies"),
        ({"roughness": 50e-6}, r"roughness is 5e-05, expected \(rms height, correlation length or None\)"),
        ({"target": "1"}, "target is '1', expected a number of square metres from 1e-20 to 1e.20"),
        ({"leg": "x"}, "leg: 'x' is no length"),
        ({"materials": [1]}, "materials is .1., expected one or more of: "),
    ],
)
def test_a_plan_refuses_what_is_no_quantity(given, words):
    with pytest.raises(mf.InputError, match=words):
        mf.plan(**BASE | given)


def test_an_aperture_exchanged_with_the_pitch_is_told():
    with pytest.raises(mf.InputError, match=r"shorter than one pitch of 0.08 m; .* perhaps the two are exchanged"):
        mf.plan(**BASE | {"band": (290e9, 300e9), "aperture": 0.5e-3, "pitch": 0.08})


def test_what_is_written_with_a_unit_is_the_same_number(sweep):
    gate, near = mf.calibrate.time_gate, {"at": (0.05, 0.4)}
    xr.testing.assert_identical(gate(sweep, "20 cm", "0.5 m"), gate(sweep, 0.2, 0.5))
    found = [mf.calibrate.estimate_elements(sweep, **near, radius=radius) for radius in ("1cm", 0.01)]
    np.testing.assert_array_equal(found[0].tx_delay, found[1].tx_delay)
    cables = [mf.calibrate.remove_cable(sweep, length) for length in ("10 cm", 0.1)]
    xr.testing.assert_identical(*cables)


def test_places_may_be_lists_or_arrays(sweep):
    place = (0.05, 0.4)
    one = mf.calibrate.estimate_elements(sweep, at=place)
    for at in ([place, place], np.array([place, place])):
        np.testing.assert_allclose(mf.calibrate.estimate_elements([sweep, sweep], at=at).tx_delay, one.tx_delay)


CALLS = {
    "swap_axes": (lambda sweep: mf.calibrate.swap_axes(sweep, "tx,rx"), "the text 'tx,rx', expected two names"),
    "apply_elements": (
        lambda sweep: mf.calibrate.apply_elements(sweep, "array.json"),
        "read the file with mf.calibrate.load_elements",
    ),
    "list of sweeps": (lambda sweep: mf.join_polarizations([sweep, sweep]), "got a list, expected a dict of sweeps"),
    "samples": (lambda sweep: mf.join_polarizations({"TE": sweep, "TM": sweep["s"].values}), "TM: got an array"),
    "view": (mf.view, "view: got a Dataset, expected the path"),
    "pick_frame": (lambda sweep: mf.pick_frame({}), "pick_frame: got a dict, expected a sweep"),
    "experiments": (lambda sweep: mf.reproduce([], output="absent"), "names is empty"),
    "positions": (
        lambda sweep: mf.import_data(".", positions={"tx": {"x": np.ones((30, 30))}}),
        r"tx.x is an array of shape \(30, 30\)",
    ),
    "mapping": (
        lambda sweep: mf.import_data("absent.csv", mapping={"s": np.ones((30, 30))}),
        r"s is an array of shape \(30, 30\)",
    ),
    "space": (lambda sweep: volumes.scene(5), "scene: got the number 5, expected a scene"),
}


@pytest.mark.slow
@pytest.mark.parametrize("call", CALLS)
def test_the_sentence_says_what_was_given(call, sweep):
    function, words = CALLS[call]
    with pytest.raises(mf.InputError, match=words):
        function(sweep)


@pytest.mark.slow
def test_truth_and_plans_are_drawn_from_their_files(reconstruction, scene_file, tmp_path):
    walls = tmp_path / "walls.geojson"
    walls.write_text('{"type": "LineString", "coordinates": [[0, 1], [1, 1]]}')
    for scene in (scene_file, str(scene_file), mf.load_scene(scene_file)):
        labels = [text.get_text() for text in mf.plot.before_after(reconstruction, scene).legends[0].get_texts()]
        assert "truth" in labels
    for plan in (walls, str(walls), mf.load(walls)):
        labels = [text.get_text() for text in mf.plot.before_after(reconstruction, plan=plan).legends[0].get_texts()]
        assert "floor plan" in labels
    assert len(mf.plot.plan(walls).lines) == 1
    assert len(mf.plot.scene(scene_file).lines) == len(mf.plot.scene(mf.load_scene(scene_file)).lines)


def test_the_part_of_a_picture_that_is_shown(image):
    with pytest.raises(mf.InputError, match=r"expected \(x0, x1, y0, y1\) in metres"):
        mf.plot.image(image, extent=(1.0, 0.0, 0.0, 1.0))
    with pytest.raises(mf.InputError, match="the image has no pixel there"):
        mf.plot.image(image, extent=(10.0, 11.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("check", "words"),
    [
        (lambda: number("a", 2, highest=1.0), "a is 2, expected a finite number of at most 1"),
        (lambda: number("a", True), "a is True, expected a finite number"),
        (lambda: number("a", 10**400), "a is .*, expected a finite number"),
        (lambda: whole_number("a", 1.5), "a is 1.5, expected a whole number of at least 0"),
        (lambda: boolean("a", 2), "a is 2, expected True or False"),
        (lambda: one_of("a", np.ones(3), ("b", "c")), "a is an array .*, expected one of b, c"),
        (lambda: path_of("a", 5), "a: got the number 5, expected the path of a file"),
        (lambda: listed("a", {}), "a: got a dict, expected one, or a list of them"),
    ],
)
def test_shared_checks(check, words):
    with pytest.raises(mf.InputError, match=words):
        check()


def test_whole_numbers_and_truth_of_every_type():
    assert whole_number("a", np.int64(3)) == whole_number("a", 3.0) == 3
    assert boolean("a", np.True_) is boolean("a", 1) is True


class Quantity(np.ndarray):
    """An array with a unit, as those of pint and astropy, which NumPy drops."""

    units = "millimeter"


def in_millimetres(values):
    return np.asarray(values, dtype=float).view(Quantity)


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda s: mf.focus(s, x=in_millimetres([-500, 0, 500]), y=[0.5, 1.0]), "x"),
        (lambda s: mf.focus(s, x=xr.DataArray([0.0, 0.5], dims="x", attrs={"units": "mm"}), y=[0.5, 1.0]), "x"),
        (lambda s: mf.calibrate.displace_receivers(s, in_millimetres([1, 0, 0])), "displacement"),
        (lambda s: mf.calibrate.estimate_elements(s, at=in_millimetres([0, 900])), "at"),
        (lambda s: mf.fold(mf.focus(s), mirrors=[in_millimetres([[0, 500], [200, 600]])]), "mirrors"),
        (lambda s: remade(s, tx_position=in_millimetres(s["tx_position"])), "sweep: tx_position"),
        (lambda s: remade(s, frequency=s["frequency"].assign_attrs(units="GHz")), "sweep: frequency"),
    ],
)
def test_numbers_that_carry_another_unit_are_refused(call, name, sweep):
    with pytest.raises(mf.InputError, match=rf"^{name} is in (millimeter|mm|GHz), expected (m|Hz); convert it first$"):
        call(sweep)


def remade(sweep, **changes):
    """The sweep made anew with other coordinates."""
    given = {name: sweep[name] for name in ("frequency", "tx_position", "rx_position")}
    return mf.make_sweep(sweep["s"], **{**given, **changes})


def test_numbers_that_carry_the_unit_of_the_argument_are_taken(sweep):
    metres = np.array([1e-3, 0.0, 0.0]).view(type("Metres", (np.ndarray,), {"unit": "meter"}))
    moved = mf.calibrate.displace_receivers(sweep, metres)
    np.testing.assert_allclose(moved["rx_position"] - sweep["rx_position"], np.tile(metres, (sweep.sizes["rx"], 1)))
    assert remade(sweep)["s"].equals(sweep["s"])


HUGE = 10**400
TIME = np.timedelta64(5, "s")
STRIP = {
    "name": "strip",
    "array": {"elements": 1, "pitch": 1e-3},
    "band": {"start": 290e9, "stop": 300e9, "points": 2},
    "surface": [{"name": "strip", "kind": "segment", "start": [-0.005, 0.02], "end": [0.005, 0.02]}],
}
PIXELS = {"x": [0.0, 0.1], "y": [0.5, 0.6]}


def volume():
    angles = {"azimuth": np.linspace(-5.0, 5.0, 4), "elevation": np.linspace(-3.0, 3.0, 4)}
    coords = {"range": np.linspace(0.5, 1.5, 20), **angles}
    return xr.DataArray(np.ones((20, 4, 4), np.complex64), dims=tuple(coords), coords=coords, name="image")


EXTREMES = {
    "a huge place": lambda sweep: mf.calibrate.displace_receivers(sweep, (HUGE, 0)),
    "a huge pixel": lambda sweep: mf.focus(sweep, x=[HUGE], y=[0.5, 0.6]),
    "a huge height": lambda sweep: mf.focus(sweep, **PIXELS, z=HUGE),
    "huge weights": lambda sweep: mf.focus(sweep, **PIXELS, taper=[HUGE] * sweep.sizes["frequency"]),
    "a time for a number": lambda sweep: mf.add_noise(sweep, snr_db=TIME, seed=0),
    "times for pixels": lambda sweep: mf.focus(sweep, x=[0.0], y=np.array([TIME, 2 * TIME])),
    "a frequency too high": lambda sweep: mf.near_field(mf.parse_scene(STRIP), 1e308, ([0.0], [0.01])),
    "a frequency too low": lambda sweep: mf.near_field(mf.parse_scene(STRIP), 5e-324, ([0.0], [0.01])),
    "a number for a grid": lambda sweep: mf.near_field(mf.parse_scene(STRIP), 3e11, np.array(5)),
    "texts for a grid": lambda sweep: mf.near_field(mf.parse_scene(STRIP), 3e11, np.array(["a", "b"])),
    "a table for a band": lambda sweep: mf.plan(**BASE | {"band": xr.Dataset({"a": ("b", [1.0])}).to_dataframe()}),
    "a table of two for a band": lambda sweep: mf.plan(
        **BASE | {"band": xr.Dataset({"a": ("b", [1.0, 2.0])}).to_dataframe()}
    ),
    "rows of unequal lengths": lambda sweep: mf.plot.image(xr.DataArray(
        np.ones((2, 2)), dims=("y", "x"), coords={"y": [1.0, 2.0], "x": [1.0, 2.0]}), extent=[[1, 2], [3]]),
    "an error too large": lambda sweep: mf.calibrate.estimate_elements(sweep, at=(0.0, 1.0), largest_error=1e308),
    "a displacement too large": lambda sweep: mf.calibrate.estimate_displacement(sweep, at=(0.0, 1.0), largest=1e308),
    "pixels too fine": lambda sweep: mf.plan_view(volume(), pixel=5e-324),
    "a name too long": lambda sweep: mf.import_data("a" * 5000),
}  # fmt: skip


@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.parametrize("kind", EXTREMES)
def test_extremes_are_refused_in_one_sentence(kind, sweep):
    with pytest.raises(mf.InputError) as refused:
        EXTREMES[kind](sweep)
    assert len(str(refused.value)) < 250


@pytest.mark.parametrize("floor_db", [1e308, -1e308, -1e300])
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_floors_of_pictures_are_decibels_that_can_be_drawn(floor_db, reconstruction):
    for draw in (mf.plot.before_after, lambda one, **given: mf.plot.compare(one, one, **given)):
        with pytest.raises(
            mf.InputError, match=r"floor_db is .*, expected a negative number of decibels down to -1000"
        ):
            draw(reconstruction, floor_db=floor_db)
