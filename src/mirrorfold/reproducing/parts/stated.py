"""The true errors of reconstructions, divided by the standard errors that the reconstructions state."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mirrorfold.folding.confident import confident_points
from mirrorfold.scoring import floor_plans
from mirrorfold.scoring.cells import point_cells
from mirrorfold.scoring.figures import WITHIN_CELLS
from mirrorfold.scoring.mirrors import mirror_errors

if TYPE_CHECKING:
    import xarray as xr

    from mirrorfold.scenes.floor_plan import Scene


def stated_errors(reconstruction: xr.DataTree, scene: Scene) -> dict[str, list[float]]:
    """True errors divided by the standard errors that a reconstruction states, by name.

    `angle` and `offset` are of each folded mirror that matches a true face. `points` are of each folded point of an
    object within 1.5 resolution cells of a true surface; its error is measured perpendicular to this surface.
    """
    found = reconstruction.children["mirrors"].to_dataset(inherit=False)
    angle, offset = [], []
    for row, mirror in enumerate(mirror_errors(reconstruction, floor_plans.faces(scene))):
        if mirror.angle_error_deg is not None and mirror.offset_error_mm is not None:
            angle.append(mirror.angle_error_deg / float(found["folded_angle_error"][row]))
            offset.append(1e-3 * mirror.offset_error_mm / float(found["folded_offset_error"][row]))
    points = confident_points(reconstruction)
    points = points.isel(point=(points["bounces"].values > 0) & (points["surface"].values == "object"))
    place = np.column_stack([points["x"], points["y"]])
    truth = floor_plans.truth(scene)
    distance, nearest = truth.distances(place)
    cells = point_cells(points, reconstruction.attrs)
    at = distance <= WITHIN_CELLS * cells if cells is not None else np.zeros(len(place), dtype=bool)
    normal = truth.normals[nearest[at]]
    error = np.column_stack([points["x_error"], points["y_error"]])[at]
    across = np.sqrt(np.sum((normal * error) ** 2, axis=1))
    return {"angle": angle, "offset": offset, "points": (distance[at] / across).tolist()}
