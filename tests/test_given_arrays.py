"""Arrays with masks, with named dimensions or with columns in another order are taken as what they say, or refused."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import mirrorfold as mf

GRID = {"x": np.linspace(-0.1, 0.2, 16), "y": np.linspace(0.3, 0.5, 9)}


def parts(sweep, **other):
    names = ("frequency", "tx_position", "rx_position")
    return {"s": sweep["s"].values, **{name: sweep[name].values for name in names}} | other


def masked(values):
    hidden = np.zeros(np.shape(values), dtype=bool)
    hidden.flat[1] = True
    return np.ma.masked_array(values, mask=hidden)


@pytest.mark.parametrize("name", ["s", "frequency", "tx_position"])
def test_masked_values_are_refused(sweep, name):
    given = parts(sweep)
    given[name] = masked(given[name])
    with pytest.raises(mf.InputError, match=rf"sweep: {name} hides 1 of \d+ values behind a mask; fill them"):
        mf.make_sweep(**given)


def test_a_mask_that_hides_nothing_does_not_matter(sweep):
    given = parts(sweep, s=np.ma.masked_invalid(sweep["s"].values))
    np.testing.assert_array_equal(mf.make_sweep(**given)["s"], sweep["s"])


def test_samples_with_named_dimensions_are_turned_into_order(sweep):
    turned = sweep["s"].transpose("rx", "tx", "frequency")
    np.testing.assert_array_equal(mf.make_sweep(**parts(sweep, s=turned))["s"], sweep["s"])
    nameless = xr.DataArray(sweep["s"].values)
    np.testing.assert_array_equal(mf.make_sweep(**parts(sweep, s=nameless))["s"], sweep["s"])
    recording = xr.concat([sweep["s"], 2 * sweep["s"]], "frame").transpose("rx", "frequency", "frame", "tx")
    made = mf.make_sweep(**parts(sweep, s=recording), time=[0.0, 1.0])
    assert made["s"].dims == ("frame", "frequency", "tx", "rx")
    np.testing.assert_array_equal(made["s"][1], 2 * sweep["s"])


def test_samples_with_other_dimensions_are_refused(sweep):
    named = sweep["s"].rename(tx="source")
    with pytest.raises(
        mf.InputError, match=r"s has the dimensions \(frequency, source, rx\), expected \(frequency, tx"
    ):
        mf.make_sweep(**parts(sweep, s=named))


def test_positions_with_named_axes_are_read_by_their_names(sweep):
    position = sweep["tx_position"].isel(axis=[2, 0, 1])
    for given in (position, position.transpose("axis", "tx")):
        made = mf.make_sweep(**parts(sweep, tx_position=given))
        np.testing.assert_array_equal(made["tx_position"], sweep["tx_position"])


def test_columns_of_positions_in_another_order_are_refused(sweep):
    turned = sweep.isel(axis=[2, 1, 0])
    with pytest.raises(mf.InputError, match=r"axis is \(z, y, x\), expected \(x, y, z\); sweep.sel"):
        mf.focus(turned, **GRID)
    assert mf.check_sweep(turned.sel(axis=["x", "y", "z"])).identical(sweep)


FRAMES = {
    "a mask": (lambda sweep: masked(sweep["s"].values), "behind a mask"),
    "not a number": (lambda sweep: sweep["s"].values * np.nan, "not finite"),
    "infinite": (lambda sweep: sweep["s"].values * np.inf, "not finite"),
    "real parts": (lambda sweep: sweep["s"].values.real, "expected complex numbers"),
    "a geometry": (lambda sweep: sweep.drop_vars("s"), "got a Dataset, expected the samples of one frame"),
    "a dict": (lambda sweep: {"s": sweep["s"].values}, "got a dict, expected an array of numbers"),
    "nothing": (lambda sweep: None, "got None, expected an array of numbers"),
    "other names": (lambda sweep: sweep["s"].rename(rx="ear"), r"expected \(frequency, tx, rx\)"),
}


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.parametrize("kind", FRAMES)
def test_a_plan_refuses_frames_that_focus_refuses(sweep, kind):
    plan = mf.FocusPlan(sweep, **GRID)
    frame, words = FRAMES[kind]
    with pytest.raises(mf.InputError, match=words):
        plan(frame(sweep))


def test_a_plan_turns_named_dimensions_into_order(sweep):
    plan = mf.FocusPlan(sweep, **GRID)
    np.testing.assert_array_equal(plan(sweep["s"].transpose("tx", "frequency", "rx")), plan(sweep["s"].values))


@pytest.mark.parametrize(
    "given", [{"snr_db": np.nan, "seed": 0}, {"snr_db": "a", "seed": 0}, {"snr_db": 3, "seed": "a"}]
)
def test_noise_of_no_level_is_refused(sweep, given):
    with pytest.raises(mf.InputError, match=r"expected a (number of decibels|whole number)"):
        mf.add_noise(sweep, **given)


@pytest.fixture
def focused(sweep):
    return mf.focus(sweep, x=np.linspace(-0.1, 0.2, 61), y=np.linspace(0.2, 0.5, 61))


@pytest.mark.parametrize("kind", ["f2", "f8", "longdouble", ">f8"])
def test_amplitudes_of_every_precision_fold_alike(focused, kind):
    """Half and extended precision ended in a traceback."""
    amplitude = abs(focused) / float(abs(focused).max())
    found, expected = (mf.fold(amplitude.astype(one))["objects"] for one in (kind, "f4"))
    assert expected.sizes["point"] > 0
    assert found.sizes["point"] == expected.sizes["point"]
    np.testing.assert_allclose(found["x"], expected["x"], atol=1e-3)


def test_images_that_no_precision_suits_are_refused(focused, tmp_path):
    for factor in (1e200, 1e-200):
        with pytest.raises(mf.InputError, match="beyond single precision"):
            mf.fold(focused.astype(complex) * factor)
    if np.dtype(np.clongdouble) != np.dtype(complex):  # where it is another type
        assert mf.fold(focused.astype(np.clongdouble))["objects"].sizes["point"] > 0
        with pytest.raises(mf.InputError, match="netCDF does not hold"):
            mf.save(focused.astype(np.clongdouble), tmp_path / "image.nc")


def test_an_image_in_another_order_is_told_how_to_sort_it(focused):
    with pytest.raises(mf.InputError, match=r"image\.transpose\('y', 'x'\) sorts them"):
        mf.fold(focused.transpose("x", "y"))


@pytest.mark.parametrize("limit", ["x", -1, 0, float("nan"), 10**400, [], 1 + 2j])
def test_limits_of_memory_are_positive_numbers(limit):
    image = xr.DataArray(np.eye(300), {"y": np.linspace(1.0, 2.0, 300), "x": np.linspace(-0.5, 0.5, 300)})
    with pytest.raises(mf.InputError, match=r"^memory_limit(:| is )"):
        mf.fold(image, memory_limit=limit)


def test_plans_are_kept_in_a_store_of_plans():
    place, frequency = np.eye(3)[:2], [1e9, 2e9, 3e9]
    sweep = mf.make_sweep(np.full((3, 2, 2), 1j), frequency=frequency, tx_position=place, rx_position=place)
    with pytest.raises(mf.InputError, match=r"^plans: got the text 'many', expected a PlanCache$"):
        mf.focus(sweep, x=[0.0], y=[2.0], plans="many")
