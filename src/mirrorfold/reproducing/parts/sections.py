"""Horizontal and upright sections through a scan of a hidden body, before and after folding."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from mirrorfold.common.decibels import TRUTH_COLOUR, decibels
from mirrorfold.common.geometry import unit
from mirrorfold.common.types import Array
from mirrorfold.folding.confident import confident_points
from mirrorfold.plotting.axes import outer_edges
from mirrorfold.plotting.outlines import cut
from mirrorfold.reproducing.parts.bodies import Facing
from mirrorfold.reproducing.parts.raster import Wall, around, folded_voxels, upright
from mirrorfold.scenes.solids import Scene3D

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

FLOOR_DB = -50.0
"""Floor of the pictures [dB]: bodies stand 20 to 40 dB below the walls that show them."""

DOTTED = (0, (1, 1.5))
IMAGE_COLOUR = "#0072B2"
"""Line style and colour of true mirror images."""

FEW = 4
"""Dotted outlines of more segments than this are drawn without every other segment: their segments are too short for
dots."""

REACH = 0.33
"""Half the side of the picture of a body alone [m]."""

STEP = 0.01
"""Pixels of the sections [m]."""

BORDER = 0.2
"""Space around the points in the horizontal sections [m]."""

BODY = (0.55, 0.55, 1.0)
"""Half the sides of the box of voxels around a body [m]."""


@dataclass(frozen=True, eq=False)
class Sections:
    """The amplitude in four sections.

    Attributes
    ----------
    plan_before, plan_after : (y, x) DataArray
        Horizontal sections at the height `level`, before and after folding.
    side_before, side_after : (height, distance) DataArray
        Upright sections through the body's middle, along the path of its echoes: before folding along the line of sight
        from the radar to the ghost, after folding from the body's middle towards the mirror.
    level : float [m]
    view : Facing
        The view of the body from the mirror image of the radar.
    wall : Wall
        The mirror that shows the body.
    """

    plan_before: xr.DataArray
    plan_after: xr.DataArray
    side_before: xr.DataArray
    side_after: xr.DataArray
    level: float
    view: Facing
    wall: Wall

    @property
    def ghost(self) -> Array:
        """Ghost of the body's middle, (3,) [m]."""
        return self.wall.image(self.view.middle[None])[0]

    @property
    def sight(self) -> Array:
        """Horizontal unit vector from the radar towards the ghost, (3,)."""
        return unit([*self.ghost[:2], 0.0])

    def dataset(self) -> dict[str, xr.DataTree]:
        """All four sections by name."""
        names = ("plan_before", "plan_after", "side_before", "side_after")
        return {name: xr.DataTree(getattr(self, name).rename("amplitude").to_dataset()) for name in names}


def sections(volume: xr.DataArray, reconstruction: xr.DataTree, view: Facing, wall: Wall, *, level: float) -> Sections:
    """Sections through a body: horizontal at the height `level` [m], upright through its middle.

    The radar stands at the origin.
    """
    points = confident_points(reconstruction)
    before = np.stack([points[f"{axis}_initial"].values for axis in "xy"], axis=-1)
    after = np.stack([points[axis].values for axis in "xy"], axis=-1)
    low = np.minimum(before.min(axis=0), after.min(axis=0)) - BORDER
    high = np.maximum(before.max(axis=0), after.max(axis=0)) + BORDER
    plane = (*(np.arange(low[i], high[i], STEP) for i in (0, 1)), np.array([level]))
    ghost = wall.image(view.middle[None])[0]
    sight, far = unit([*ghost[:2], 0.0]), float(np.hypot(*ghost[:2]))
    distance = np.arange(0.45 * far, far + 0.45, STEP)
    ends = distance[[0, -1], None] * sight[:2]
    corridor = tuple(np.arange(ends[:, i].min() - 0.05, ends[:, i].max() + 0.05, STEP) for i in (0, 1))
    height = np.arange(-1.0, 1.0 + 0.5 * STEP, STEP)
    plan_before, plan_after, side_before, side_after = folded_voxels(
        volume, [(plane, False), (plane, True), ((*corridor, height), False), (around(view.middle, BODY, STEP), True)]
    )
    ahead = np.arange(-0.5, 0.5 + 0.5 * STEP, STEP)
    return Sections(
        plan_before.isel(z=0, drop=True),
        plan_after.isel(z=0, drop=True),
        upright(side_before, np.zeros(3), sight, distance, height),
        upright(side_after, view.middle, view.ahead, ahead, height),
        level,
        view,
        wall,
    )


def draw_sections(found: Sections, scene: Scene3D, *, mirrored: tuple[str, ...]) -> Figure:
    """Draw the sections; after folding also the body alone in both sections, each at a scale of its own.

    Thin lines are true surfaces. Dotted lines are the mirror images of the surfaces that `mirrored` names.
    """
    figure = Figure(figsize=(11.0, 10.2), layout="constrained")
    rows: Any = [["before"] * 6 + ["after"] * 6, ["line"] * 6 + ["top"] * 3 + ["side"] * 3]
    panels = figure.subplot_mosaic(rows)
    flat = cut(scene, np.array([0.0, 0.0, found.level]), np.array([0.0, 0.0, 1.0]))
    side = cut(scene, found.view.middle, found.view.right)
    ghosts = cut(scene, np.zeros(3), np.cross(found.sight, [0.0, 0.0, 1.0]))
    x, y = found.view.middle[:2]
    near = found.plan_after.sel(x=slice(x - REACH, x + REACH), y=slice(y - REACH, y + REACH))
    body = found.side_after.sel(distance=slice(-REACH, REACH))
    place = f"at the height {found.level:g} m"
    picture = _image(panels["before"], found.plan_before)
    for name, section in (("after", found.plan_after), ("top", near), ("line", found.side_before), ("side", body)):
        _image(panels[name], section)
    for name in ("before", "after", "top"):
        _lines(panels[name], [lines[..., :2] for lines in flat.values()])
        panels[name].set(xlabel="cross-range x [m]", ylabel="range y [m]")
    _lines(panels["before"], [found.wall.image(flat[one])[..., :2] for one in mirrored if one in flat], dotted=True)
    _lines(panels["line"], [_along(lines, np.zeros(3), found.sight) for lines in ghosts.values()])
    images = [found.wall.image(side[one]) for one in mirrored if one in side]
    _lines(panels["line"], [_along(lines, np.zeros(3), found.sight) for lines in images], dotted=True)
    _lines(panels["side"], [_along(lines, found.view.middle, found.view.ahead) for lines in side.values()])
    panels["before"].set_title(f"as the radar sees it, {place}")
    panels["after"].set_title(f"folded, {place}")
    panels["line"].set(title="as the radar sees it, upright", xlabel="along the line of sight [m]",
                       ylabel="height z [m]")  # fmt: skip
    panels["top"].set_title("folded: the body")
    panels["side"].set(title="folded, upright", xlabel="to the mirror [m]", ylabel="height z [m]")
    figure.colorbar(picture, ax=panels["after"], label=f"amplitude [dB], floor {FLOOR_DB:g} dB", shrink=0.8)
    handles = [
        Line2D([], [], color=TRUTH_COLOUR, linewidth=0.9, label="truth"),
        Line2D([], [], color=IMAGE_COLOUR, linewidth=0.9, linestyle=DOTTED, label="its true mirror image"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, frameon=False)
    return figure


def _image(ax: Axes, section: xr.DataArray) -> AxesImage:
    """Draw a section in dB, at one scale along both axes."""
    v, u = (section[name].values for name in section.dims)
    level = decibels(section.values, FLOOR_DB)
    picture = ax.imshow(level, origin="lower", extent=(*outer_edges(u), *outer_edges(v)), vmin=FLOOR_DB, vmax=0.0,
                        cmap="gray_r")  # fmt: skip
    ax.set(xlim=outer_edges(u), ylim=outer_edges(v), aspect="equal")
    return picture


def _lines(ax: Axes, groups: list[Array], *, dotted: bool = False) -> None:
    """Draw segments (n, 2, 2) [m] of true surfaces, or dotted ones of their mirror images."""
    for lines in groups:
        colour, style = (IMAGE_COLOUR, DOTTED) if dotted else (TRUTH_COLOUR, "solid")
        thin = lines[::2] if dotted and len(lines) > FEW else lines
        ax.add_collection(LineCollection(list(thin), colors=colour, linewidths=0.7, linestyles=style))


def _along(lines: Array, middle: Array, along: Array) -> Array:
    """Segments (n, 2, 3) [m] in an upright plane, (n, 2, 2) [m]: distance from `middle` in a direction, and height."""
    return np.stack([(lines - middle) @ along, lines[..., 2]], axis=-1)
