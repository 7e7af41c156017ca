"""The figure of a file for the verb `show`: chooses the function of `mirrorfold.plotting` by the content."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

import mirrorfold as mf
from mirrorfold.common.facts import VOLUME, VOXELS
from mirrorfold.common.plans import FloorPlan
from mirrorfold.errors import InputError
from mirrorfold.folding.frames import frame_count
from mirrorfold.plotting.axes import draw_radar, mirror_lines, radar_of
from mirrorfold.plotting.comparison import NO_MIRROR, legend_entries
from mirrorfold.sweep.polarization import first_polarization


def draw(
    found: Any, what: str | None, truth: Any, floor_db: float, source: str, plan: FloorPlan | None = None
) -> tuple[str, Any]:
    """Draw the content of a file.

    Parameters
    ----------
    found : sweep, image, reconstruction, scene or floor plan
    what : str, optional
        Which picture of a reconstruction, as the option ``--what`` names it.
    truth : Scene or Scene3D, optional
        The true scene, drawn thin.
    floor_db : float [dB]
        Level below which images are blank.
    source : str
        Name of the file, for messages.
    plan : FloorPlan, optional
        Known walls, drawn thin.

    Returns
    -------
    name : str
        Name of the picture that was drawn.
    figure : matplotlib.figure.Figure

    Raises
    ------
    InputError
        If the file does not hold what is to be drawn.
    """
    if isinstance(found, xr.DataTree):
        return _reconstruction(found, what, truth, floor_db, source, plan)
    if what is not None:
        raise InputError(f"--what is {what!r}, but {source} is no reconstruction; leave it out")
    if isinstance(found, xr.Dataset):
        return "sweep", mf.plot.sweep(found)
    if isinstance(found, xr.DataArray):
        axes = _image(mf.pick_frame(found), truth, floor_db, source)
        (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
        if plan is not None and not plan.lies_beyond(np.array([x0, y0]), np.array([x1, y1])):
            mf.plot.plan(plan, axes)
        return "image", axes.figure
    if isinstance(found, FloorPlan):
        return "plan", mf.plot.plan(found).figure
    if found.dimensions == 3:
        return "scene", mf.plot_volume.scene(found).figure
    return "scene", mf.plot.scene(found).figure


def _image(image: xr.DataArray, truth: Any, floor_db: float, source: str) -> Any:
    """The axes with an image, or with the plan view of a volume, and with the true scene if it is given."""
    image = first_polarization(image)
    normalization, radar = "r", (0.0, 0.0)
    if image.dims == VOLUME:
        image, normalization = mf.plan_view(image), "none"
    elif image.dims == VOXELS:
        image, normalization = abs(image).max("z"), "none"
    else:
        place = image.attrs.get("radar_position", radar)
        radar = (float(place[0]), float(place[1]))
        if str(image.attrs.get("normalization", "none")) != "none":
            normalization = "none"
    axes = mf.plot.image(image, floor_db=floor_db, normalization=normalization, radar=radar)
    if "polarization" in image.coords:
        axes.set_title(f"polarization {image['polarization'].values}")
    if truth is not None:
        _check_floor_plan(truth, source)
        mf.plot.scene(truth, axes)
    return axes


def _reconstruction(
    found: xr.DataTree, what: str | None, truth: Any, floor_db: float, source: str, plan: FloorPlan | None
) -> tuple[str, Any]:
    """Draw a picture of a reconstruction; parameters and results as of `draw`."""
    volume = "z" in found.children["objects"].variables
    recording = frame_count(found) is not None
    what = what or ("frames" if recording else "space" if volume else "before-after")
    if what == "frames":
        axes = mf.plot.frames(found, floor_db=floor_db)
        if plan is not None:
            mf.plot.plan(plan, axes)
        return what, axes.figure
    found = mf.pick_frame(found)
    if what in ("space", "body"):
        if what == "space":
            return what, mf.plot_volume.space(found, truth)
        return what, mf.plot_volume.body(found)
    if what == "score":
        if truth is None:
            raise InputError("--what score needs --scene, the truth to compare with")
        return what, mf.plot.score(mf.score(found, truth)).figure
    if what == "tree":
        return what, mf.plot.tree(found).figure
    if truth is not None and not volume:
        _check_floor_plan(truth, source)
    flat_truth = None if volume else truth
    if what == "before-after":
        return what, mf.plot.before_after(found, truth, plan=plan, floor_db=floor_db)
    extent = mf.plot.content_extent(found, flat_truth, plan, folded=what == "corrected")
    if what == "corrected":
        axes = mf.plot.corrected(found, floor_db=floor_db, extent=extent)
        entries = legend_entries(found, flat_truth, plan)
        axes.figure.legend(handles=entries, loc="outside lower center", ncols=3, frameon=False)
    else:
        initial = found.children["initial"].dataset["initial"]
        axes = mf.plot.image(initial, floor_db=floor_db, normalization="none", extent=extent)
        if what == "mirrors":
            mf.plot.shadows(found, axes)
            mf.plot.mirrors(found, axes)
            if not mirror_lines(found, folded=False):
                axes.set_title(NO_MIRROR)
        draw_radar(axes, radar_of(found))
    if flat_truth is not None:
        mf.plot.scene(flat_truth, axes)
    if plan is not None:
        mf.plot.plan(plan, axes)
    axes.set(xlim=extent[:2], ylim=extent[2:])
    return what, axes.figure


def _check_floor_plan(truth: Any, source: str) -> None:
    """Refuse a scene in three dimensions for a file of a floor plan."""
    if truth.dimensions != 2:
        raise InputError(f"{source}: has 2 dimensions and the scene {truth.dimensions}; give its own scene")
