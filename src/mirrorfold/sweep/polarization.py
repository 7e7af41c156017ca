"""Polarizations of sweeps and images: their names, sweeps joined into one, and one picked from several."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from mirrorfold.common.arguments import in_message, wrong_kind
from mirrorfold.common.facts import tells_band
from mirrorfold.common.slabs import POLARIZATIONS
from mirrorfold.errors import InputError
from mirrorfold.sweep.facts import CONJUGATED, TIME_CONVENTION, antenna_positions, wave_speed

SAME = 1e-6
"""Two grids agree where their values differ by less than this share of the largest value; for angles, by less than
this number of degrees."""

Labelled = TypeVar("Labelled", xr.Dataset, xr.DataArray)

EXPECTED = "expected TE, E along the vertical axis, and TM, E in the floor plan"


def polarizations(obj: Any, source: str = "sweep") -> tuple[str, ...]:
    """Names along the dimension `polarization` of a sweep or an image; empty where it has no such dimension.

    Raises
    ------
    InputError
        If the polarizations have no names, other names than TE and TM, or two have the same name.
    """
    held = obj["s"] if isinstance(obj, xr.Dataset) and "s" in obj else obj
    if not isinstance(held, xr.DataArray) or "polarization" not in held.dims:
        return ()
    if "polarization" not in held.coords:
        raise InputError(f"{source}: has a dimension polarization without names; {EXPECTED}: add the coordinate")
    names = tuple(str(name) for name in held["polarization"].values)
    if not set(names) <= set(POLARIZATIONS) or len(set(names)) != len(names):
        raise InputError(f"{source}: has the polarizations {', '.join(map(repr, names))}; {EXPECTED}, each once")
    return names


def with_own_polarization(sweep: xr.Dataset) -> xr.Dataset:
    """The sweep with its polarization as an attribute where it has a coordinate of one value, as after ``sel``."""
    if "polarization" not in sweep.coords or sweep["polarization"].ndim:
        return sweep
    name = str(sweep["polarization"].values)
    return sweep.drop_vars("polarization").assign_attrs(polarization=sweep.attrs.get("polarization", name))


def join_polarizations(sweeps: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Join sweeps that were measured with one polarization each into one sweep.

    Parameters
    ----------
    sweeps : mapping of str to xarray.Dataset
        The sweeps by the names of their polarizations: "TE", E along the vertical axis, and "TM", E in the floor plan.
        All have the same frequencies and antennas.

    Returns
    -------
    xarray.Dataset
        ``s(polarization, frequency, tx, rx)``, with the attributes of the first sweep, time convention ``exp(+jwt)``.

    Raises
    ------
    InputError
        If a name is neither TE nor TM, or the grids differ.
    """
    if not isinstance(sweeps, Mapping):
        raise wrong_kind("sweeps", sweeps, "a dict of sweeps by polarization, such as {'TE': sweep, 'TM': other}")
    if not sweeps or not set(sweeps) <= set(POLARIZATIONS):
        raise InputError(f"sweeps: have the polarizations {', '.join(map(repr, sweeps)) or 'none'}; {EXPECTED}")
    names = [name for name in POLARIZATIONS if name in sweeps]
    sweeps = {name: with_own_polarization(one) if isinstance(one, xr.Dataset) else one for name, one in sweeps.items()}
    first = sweeps[names[0]]
    for name in names:
        sweep = sweeps[name]
        if not isinstance(sweep, xr.Dataset) or "s" not in sweep:
            raise wrong_kind(f"sweeps: {name}", sweep, "a sweep (xarray.Dataset) with s(frequency, tx, rx)")
        said = sweep.attrs.get("polarization", name)
        if said != name:
            raise InputError(
                f"sweeps: that of {name} says of itself that its polarization is {in_message(said)}; swap them"
            )
        if polarizations(sweep, name):
            raise InputError(f"sweeps: that of {name} holds several polarizations already; choose one")
        if (what := _difference(first, sweep)) is not None:
            raise InputError(
                f"sweeps: {names[0]} and {name} differ in {what}; measure both with the same frequencies and antennas, "
                "or resample one"
            )
    conjugated = [sweeps[name].attrs.get("time_convention") == CONJUGATED for name in names]
    parts = [sweeps[name]["s"].values for name in names]
    if len(parts) == 2 and parts[0].any() and np.array_equal(parts[0], parts[1]):
        raise InputError(
            "sweeps: TE and TM are equal in every sample, which no two measurements are; give the sweep of each"
        )
    values = np.stack([np.conj(part) if turned else part for part, turned in zip(parts, conjugated, strict=True)])
    joined = (
        first.drop_vars("s")
        .assign(s=(("polarization", *first["s"].dims), values))
        .assign_coords(polarization=("polarization", np.array(names)))
    )
    joined.attrs = {name: value for name, value in first.attrs.items() if name != "polarization"}
    joined.attrs["time_convention"] = TIME_CONVENTION
    return joined


def _difference(one: xr.Dataset, other: xr.Dataset) -> str | None:
    """The first difference between the grids of two sweeps, in words; None if they agree."""
    if one["s"].dims != other["s"].dims or one["s"].shape != other["s"].shape:
        sizes = [" x ".join(map(str, sweep["s"].shape)) for sweep in (one, other)]
        return f"their shapes, {sizes[0]} and {sizes[1]}"
    frequency, others = (sweep["frequency"].values.astype(float) for sweep in (one, other))
    if not np.allclose(frequency, others, rtol=0.0, atol=SAME * float(frequency.max())):
        return "their frequencies"
    if not np.isclose(wave_speed(one), wave_speed(other), rtol=SAME, atol=0.0):
        return f"the speed of their waves, {wave_speed(one):g} and {wave_speed(other):g} m/s"
    pairs = [sweep["measured"].values if "measured" in sweep.variables else np.array(True) for sweep in (one, other)]
    if not np.array_equal(pairs[0], pairs[1]):
        return "which pairs were measured"
    for name in ("azimuth", "elevation"):
        if name in one.variables and not np.allclose(one[name], other[name], rtol=0.0, atol=SAME):
            return f"their {name}s"
    if "tx_position" in one.variables or "antenna_position" in one.variables:
        places = zip(("transmitters", "receivers"), antenna_positions(one), antenna_positions(other), strict=True)
        for which, place, place_of_other in places:
            if not np.allclose(place, place_of_other, rtol=0.0, atol=SAME * float(np.abs(place).max(initial=1e-3))):
                return f"the places of their {which}"
    return None


def picked(obj: Labelled, name: str) -> Labelled:
    """The polarization called `name` of a sweep or an image that has several."""
    names = [str(one) for one in obj["polarization"].values]
    return obj.isel(polarization=names.index(name)).drop_vars("polarization")


def first_polarization(image: xr.DataArray) -> xr.DataArray:
    """The image of one polarization, TE if there is one, with its name as a scalar coordinate.

    An image without a dimension `polarization` is returned as it is.
    """
    names = polarizations(image, "image")
    if not names:
        return image
    return image.isel(polarization=names.index(next(name for name in POLARIZATIONS if name in names)))


def polarized(image: Any, sweep: xr.Dataset | None) -> tuple[dict[str, xr.DataArray], Any, xr.Dataset | None]:
    """Split an image and its sweep by polarization.

    Returns
    -------
    both : dict of str to xarray.DataArray
        The complex images by polarization, where there are both TE and TM, of known frequencies; otherwise empty.
    image : xarray.DataArray
        The image of the first polarization, TE if there is one.
    sweep : xarray.Dataset, or None
        The sweep of the same polarization.

    Raises
    ------
    InputError
        If polarizations are not named, or the image has other ones than the sweep.
    """
    of_image, of_sweep = polarizations(image, "image"), polarizations(sweep)
    if of_sweep and of_image != of_sweep:
        had = ", ".join(of_image) or "none"
        raise InputError(
            f"sweep: has the polarizations {', '.join(of_sweep)} and the image {had}; give the sweep that the image "
            "was focused from"
        )
    if not of_image:
        return {}, image, sweep
    first = next(name for name in POLARIZATIONS if name in of_image)
    usable = len(of_image) == 2 and np.iscomplexobj(image) and tells_band(image.attrs)
    both = {name: picked(image, name) for name in of_image} if usable else {}
    own = picked(sweep, first) if sweep is not None and of_sweep else sweep
    return both, picked(image, first), own
