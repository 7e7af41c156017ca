"""What a Reconstruction has kept of the tests with its sweep: its image can be folded again without the sweep."""

from __future__ import annotations

from functools import partial

import numpy as np
import xarray as xr

from mirrorfold.common.facts import radar_place, recorded_radar
from mirrorfold.common.types import Array, Names
from mirrorfold.detection import ImageView
from mirrorfold.errors import InputError
from mirrorfold.tree.explaining.copies import COPY
from mirrorfold.tree.explaining.half_shadows import OVERHANG_COLUMNS, Overhangs
from mirrorfold.tree.explaining.misplaced import MIXED, known_confocal, known_corners, known_ghosts
from mirrorfold.tree.measured import Measured, Measurer
from mirrorfold.tree.rounds import BY_SWEEP

KEPT = (*BY_SWEEP, COPY)
"""Reasons against echoes that hold whatever mirrors are found later."""


def kept_measurements(reconstruction: xr.DataTree) -> Measurer:
    """The measurements by the sweep that a Reconstruction has kept; any other tree is refused."""
    check_groups(reconstruction, "initial", "objects", "mirrors")
    places, shares = known_places(reconstruction), known_shares(reconstruction)
    overhangs = known_overhangs(reconstruction)
    if shares and not (places or len(shares[1])):  # it was folded without a sweep, which always measures some echo
        shares = None
    vertices = np.column_stack([np.ravel(reconstruction.attrs.get(f"corner_{axis}", ())) for axis in "xy"])

    def measure(view: ImageView) -> Measured:
        return Measured(
            explain=partial(known_ghosts, view=view, places=places[0], explanation=places[1]) if places else None,
            # What was measured at the ends of mirrors holds whatever mirrors and echoes are found now.
            overhangs=lambda order, echoes: overhangs,
            confocal_share=partial(known_confocal, view=view, places=shares[0], share=shares[1]) if shares else None,
            # Without the sweep nothing was asked about corners, which is not to say that there are none.
            corners=partial(known_corners, view=view, places=vertices) if shares else None,
        )

    return measure


def known_places(reconstruction: xr.DataTree) -> tuple[Array, Names] | None:
    """Image places (n, 2) [m] of echoes, and why these do not come from there, (n,), "" if they do; None if all do."""
    objects = _table(reconstruction, "objects")
    if "explanation" in objects:
        why = objects["explanation"].values.astype(str)
        why = np.where(np.isin(why, KEPT), why, "")
        place = np.column_stack([objects["x_initial"], objects["y_initial"]])
    else:  # files of earlier versions list the places of mixed paths alone
        place = np.column_stack([np.ravel(reconstruction.attrs.get(f"mixed_{axis}", ())) for axis in "xy"])
        why = np.full(len(place), MIXED)
    return (place.astype(float), why.astype(str)) if (why != "").any() else None


def known_shares(reconstruction: xr.DataTree) -> tuple[Array, Array] | None:
    """Image places (n, 2) [m] of echoes whose `confocal_share` was measured, and the shares (n,).

    None if the Reconstruction holds no shares.
    """
    objects = _table(reconstruction, "objects")
    if "confocal" not in objects:
        return None
    measured = objects.isel(point=np.isfinite(objects["confocal"].values))
    return np.column_stack([measured["x_initial"], measured["y_initial"]]), measured["confocal"].values.astype(float)


def known_overhangs(reconstruction: xr.DataTree) -> Overhangs:
    """How far [m] beyond their ends lines of sight meet the mirrors of a Reconstruction, as far as it is known."""
    mirrors = _table(reconstruction, "mirrors")
    if any(name not in mirrors for name in OVERHANG_COLUMNS):
        return Overhangs()
    ends = [np.column_stack([mirrors[f"{axis}{end}"] for axis in "xy"]) for end in (0, 1)]
    # In a recording, mirrors of frames without overhangs have NaN.
    lengths = np.concatenate([mirrors[name].values for name in OVERHANG_COLUMNS])
    return Overhangs(np.concatenate(ends), np.nan_to_num(lengths))


def _table(reconstruction: xr.DataTree, group: str) -> xr.Dataset:
    """A table of a Reconstruction, without the axes of the picture, which it would inherit."""
    return reconstruction.children[group].to_dataset(inherit=False)


def initial_image(reconstruction: xr.DataTree) -> xr.DataArray:
    """The unfolded image of a Reconstruction, with the attributes that describe the radar, to be folded again.

    Raises
    ------
    InputError
        If the tree is no Reconstruction, or the Reconstruction is that of a volume.
    """
    check_groups(reconstruction, "initial", "objects", "mirrors")
    if "initial" not in reconstruction.children["initial"].data_vars:
        raise InputError("reconstruction: holds no initial image; expected what `fold` or `reconstruct` returns")
    if "z" in reconstruction.children["objects"].variables:
        raise InputError("reconstruction: does not hold the volume that it came from; fold that one")
    held = reconstruction.children["initial"].dataset.drop_vars(["z"], errors="ignore")
    image = held["initial"].rename("image")
    if "phase" in held:
        image = image.copy(data=image.values * np.exp(1j * held["phase"].values).astype(np.complex64))
    attrs = {str(name): value for name, value in reconstruction.attrs.items()}
    known = {name.removeprefix("image_"): value for name, value in attrs.items() if name.startswith("image_")}
    if attrs.get("title"):
        known["title"] = attrs["title"]
    known = {"radar_position": recorded_radar(attrs).tolist()} | known
    # Files of earlier versions do not tell the height; it was mostly that of the radar.
    if height := known.pop("z", radar_place(known)[2]):
        image = image.assign_coords(z=float(height))
    return image.assign_attrs(known | {"normalization": str(attrs.get("fold_normalization", "r"))})


def check_groups(reconstruction: xr.DataTree, *groups: str) -> None:
    """Refuse a tree that lacks one of these groups of a Reconstruction."""
    for group in groups:
        if group not in reconstruction.children:
            raise InputError(f"reconstruction: holds no group {group!r}; expected what `fold` or `reconstruct` returns")
