"""Checks of arrays as users give them: that they hold numbers, that none is masked, and how dimensions are called."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from mirrorfold.common.arguments import expect_unit, wrong_kind
from mirrorfold.common.plausible import as_real_numbers
from mirrorfold.common.types import Array
from mirrorfold.errors import InputError
from mirrorfold.sweep.facts import AXES


def array_of(name: str, value: ArrayLike | xr.DataArray) -> NDArray[Any]:
    """The value as an array of numbers.

    Raises
    ------
    InputError
        If the value does not consist of numbers, or some of them are masked.
    """
    held = value.data if isinstance(value, xr.DataArray) else value
    masked = int(np.count_nonzero(held.mask)) if isinstance(held, np.ma.MaskedArray) else 0
    if masked:
        raise InputError(
            f"{name} hides {masked} of {np.size(held)} values behind a mask; fill them, for example with "
            ".filled(0), or leave out their channels"
        )
    try:
        found = np.asarray(held)
    except (TypeError, ValueError):  # rows of different lengths
        found = np.empty(0, dtype=object)
    if found.dtype.kind not in "fciu":
        raise wrong_kind(name, value, "an array of numbers")
    return found


def real_numbers(name: str, value: ArrayLike | xr.DataArray, unit: str) -> Array:
    """The value as an array of real numbers in a unit; columns with the names x, y and z are brought into this order.

    Raises
    ------
    InputError
        If the value does not consist of real numbers, or carries another unit.
    """
    expect_unit(name, value, unit)
    if isinstance(value, xr.DataArray) and "axis" in value.dims:
        value = value.transpose(..., "axis")
        if "axis" in value.coords and set(value["axis"].values.tolist()) == set(AXES):
            value = value.sel(axis=list(AXES))
    found = array_of(name, value)
    if found.dtype.kind == "c":
        raise wrong_kind(name, value, "real numbers")
    return found.astype(float)


def complex_samples(name: str, value: ArrayLike | xr.DataArray, dims: tuple[str, ...]) -> NDArray[np.complexfloating]:
    """The value as an array of complex samples, whose last dimensions are `dims`.

    Dimensions with these names are brought into this order; dimensions without names are taken to be in this order.

    Raises
    ------
    InputError
        If the samples are not complex numbers, or the dimensions have other names.
    """
    if isinstance(value, xr.DataArray):
        if set(dims) <= set(value.dims):
            value = value.transpose(..., *dims)
        elif not all(str(dim).startswith("dim_") for dim in value.dims):  # xarray's names for unnamed ones
            raise InputError(
                f"{name} has the dimensions ({', '.join(map(str, value.dims))}), expected ({', '.join(dims)}); rename "
                "them, or give its values in this order"
            )
    found = array_of(name, value)
    if found.dtype.kind != "c":
        raise InputError(
            f"{name} has type {found.dtype}, expected complex numbers; magnitudes or real parts alone have no phase "
            "and give no image, and traces over time are turned into frequencies by mf.import_data"
        )
    return found


def check_level(name: str, s: NDArray[np.complexfloating]) -> None:
    """Refuse samples that are so large that their sum, as in an image, may exceed single precision.

    Raises
    ------
    InputError
        The message tells the largest part of a sample, and what is allowed.
    """
    numbers = as_real_numbers(s)
    largest = max(float(numbers.max(initial=0.0)), -float(numbers.min(initial=0.0)))
    allowed = float(np.finfo(np.float32).max) / max(s.size, 1)
    if allowed < largest < np.inf:
        raise InputError(
            f"{name} holds samples as large as {largest:.2g}, expected less than {allowed:.2g}, or their sum exceeds "
            "single precision; divide all of them by one number"
        )
