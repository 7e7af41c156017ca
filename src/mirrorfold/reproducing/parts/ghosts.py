"""Where the true surfaces of a floor plan should appear by way of its walls, and which of them were found there.

Geometrical optics predicts a ghost of each surface for each chain of walls by way of which the radar sees the surface.
Detected mirrors and echoes are compared with these ghosts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mirrorfold.common.chains import mirror_chains
from mirrorfold.common.geometry import Isometry, segment_normal
from mirrorfold.common.types import Array, Mask
from mirrorfold.folding.confident import confident_points
from mirrorfold.scenes.floor_plan import Scene
from mirrorfold.scenes.visibility import CHORD, SHORTEST_MIRROR, STRAIGHT, facets, seen_by_way
from mirrorfold.scoring.cells import point_cells
from mirrorfold.scoring.figures import WITHIN_CELLS

SPACING = 0.005
"""Distance between samples of true surfaces [m]: a third of the published range cell."""

NEAR_DEGREES, NEAR = 10.0, 0.10
"""A detected mirror is taken for the image of a straight piece if both agree within this angle [degree] and distance
[m]."""


@dataclass(frozen=True, eq=False)
class Face:
    """A straight piece of a surface, given by its ends (2, 2) [m]. It bears the name of the surface."""

    name: str
    ends: Array

    @property
    def reflection(self) -> Isometry:
        """The reflection at this face."""
        return Isometry.reflection(self.ends[0], segment_normal(*self.ends))


Way = tuple[Face, ...]
"""The mirrors of a path, from the one that the radar looks into first to the last."""


def way_name(way: Way) -> str:
    """The mirrors of a path in words, such as ``left wall, then right wall``."""
    return ", then ".join(face.name for face in way) or "line of sight"


def image_in(way: Way) -> Isometry:
    """The map from the true place of an object to its ghost, where the initial image shows it by way of these mirrors.

    The last mirror reflects first: its image of the object is what the mirror before it shows.
    """
    image = Isometry.identity()
    for face in way:
        image = image @ face.reflection
    return image


def faces_of(scene: Scene) -> list[Face]:
    """All straight pieces that are long enough to be mirrors, legs of corners included."""
    pieces = [
        Face(surface.name, piece)
        for surface in scene.surface
        if surface.kind in STRAIGHT
        for piece in facets(surface, CHORD)
    ]
    return [face for face in pieces if np.linalg.norm(face.ends[1] - face.ends[0]) >= SHORTEST_MIRROR]


def walls_of(scene: Scene) -> list[Face]:
    """The surfaces that are one straight line, long enough for a mirror."""
    return [face for surface in scene.surface if surface.kind == "segment" for face in faces_of(scene)
            if face.name == surface.name]  # fmt: skip


@dataclass(frozen=True, eq=False)
class Ghost:
    """A true surface as the initial image should show it by way of mirrors.

    Attributes
    ----------
    surface : str
        Name of the surface.
    way : tuple of Face
        The mirrors; empty in line of sight.
    place : (n, 2) array [m]
        Mirror images of samples of the whole surface.
    seen : (n,) bool array
        Which samples the radar sees by way of these mirrors, by geometrical optics.
    is_wall : bool
        Whether the surface is straight.
    """

    surface: str
    way: Way
    place: Array
    seen: Mask
    is_wall: bool

    @property
    def share(self) -> float:
        """Share of the surface that is seen."""
        return float(self.seen.mean())

    @property
    def seen_length(self) -> float:
        """Length [m] of the part of the surface that is seen."""
        return self.share * float(np.linalg.norm(np.diff(self.place, axis=0), axis=1).sum())

    @property
    def way_names(self) -> tuple[str, ...]:
        """Names of the mirrors, in the order of `way`."""
        return tuple(face.name for face in self.way)

    @property
    def name(self) -> str:
        """Name such as ``arc in right wall in left wall``; here the radar looks into the left wall first."""
        return " in ".join([self.surface, *reversed(self.way_names)])


def ghosts_of(scene: Scene, generations: int) -> list[Ghost]:
    """All ghosts that geometrical optics predicts: by way of up to `generations` walls, or none in line of sight."""
    walls = walls_of(scene)
    ways: list[Way] = [()]
    for count in range(1, generations + 1):
        ways += [way for way in product(walls, repeat=count) if all(a is not b for a, b in pairwise(way))]
    found = []
    for way, surface in product(ways, scene.surface):
        if way and way[-1].name == surface.name:
            continue
        place, normals = surface.sample(SPACING)[:2]
        straight = surface.kind == "segment"
        seen = seen_by_way(scene, [face.ends for face in way], place, normals, grazing=straight)
        if seen.any():
            found.append(Ghost(surface.name, way, image_in(way)(place), seen, straight))
    return found


def surface_of(
    echoes: xr.Dataset, ghosts: Sequence[Ghost], reconstruction: xr.DataTree, *, cells: float = WITHIN_CELLS
) -> NDArray[np.intp]:
    """Number of the ghost at which each echo stands in the initial image, (points,): the nearest ghost, or -1 if it is
    farther than `cells` resolution cells.
    """
    place = np.column_stack([echoes["x_initial"], echoes["y_initial"]])
    limit = point_cells(echoes, reconstruction.attrs)
    if not ghosts or not len(place) or limit is None:
        return np.full(len(place), -1, dtype=np.intp)
    distances = np.array([cKDTree(ghost.place).query(place)[0] for ghost in ghosts])
    return np.where(distances.min(axis=0) <= cells * limit, distances.argmin(axis=0), -1)


@dataclass(frozen=True, eq=False)
class Identified:
    """A detected mirror, and the true face of which it is the image.

    Attributes
    ----------
    chain : str
    generation : int
    ends : (2, 2) array [m]
        Ends in the initial image.
    way : tuple of Face
        The true faces by way of which it was seen; None if a detected mirror among them is the image of no face.
    face : Face or None
        The true face; None if the detected mirror is the image of no face.
    angle_error : float [degree]
        Angle between the detected mirror and the predicted image of the face; NaN without a face.
    offset_error : float [m]
        Distance of the middle of the detected mirror from the line of the predicted image; NaN without a face.
    """

    chain: str
    generation: int
    ends: Array
    way: Way | None
    face: Face | None
    angle_error: float
    offset_error: float

    @property
    def name(self) -> str:
        """Name such as ``left wall in right wall``; ``no wall`` without a true face."""
        if self.face is None or self.way is None:
            return "no wall"
        return " in ".join([self.face.name, *(face.name for face in reversed(self.way))])


def identified(reconstruction: xr.DataTree, scene: Scene) -> list[Identified]:
    """Every detected mirror, with the true face of which it is the image, in the order of the reconstruction."""
    table = reconstruction.children["mirrors"].to_dataset(inherit=False)
    chains = mirror_chains(table)
    lines = np.stack([table[name].values for name in ("x0", "y0", "x1", "y1")], axis=-1).reshape(-1, 2, 2)
    faces, found = faces_of(scene), dict[str, Identified]()
    for chain, ends in sorted(zip(chains, lines, strict=True), key=lambda pair: pair[0].count("/")):
        parent = found.get(chain.rpartition("/")[0])
        way: Way | None = ()
        if parent is not None:
            way = None if parent.face is None or parent.way is None else (*parent.way, parent.face)
        face, angle, offset = _nearest(ends, way, faces) if way is not None else (None, np.nan, np.nan)
        found[chain] = Identified(chain, chain.count("/") + 1, ends, way, face, angle, offset)
    return [found[chain] for chain in chains]


def _nearest(ends: Array, way: Way, faces: Sequence[Face]) -> tuple[Face | None, float, float]:
    """The face whose image by way of these mirrors agrees best with a detected mirror, given by its ends (2, 2) [m];
    and the errors of angle [degree] and offset [m]. None and NaN if no face is near enough.
    """
    middle, along = ends.mean(axis=0), ends[1] - ends[0]
    best: tuple[float, Face | None, float, float] = (NEAR, None, float("nan"), float("nan"))
    for face in faces:
        if way and face is way[-1]:
            continue
        start, end = image_in(way)(face.ends)
        normal, length = segment_normal(start, end), float(np.linalg.norm(end - start))
        angle = float(np.degrees(np.arcsin(min(1.0, abs(float(along @ normal)) / float(np.linalg.norm(along))))))
        offset = abs(float((middle - start) @ normal))
        beyond = abs(float((middle - 0.5 * (start + end)) @ (end - start))) / length - 0.5 * length
        distance = float(np.hypot(offset, max(beyond, 0.0)))
        if angle <= NEAR_DEGREES and distance <= best[0]:
            best = distance, face, angle, offset
    return best[1:]


@dataclass(frozen=True, eq=False)
class Shown:
    """The echoes of an object that is seen by way of certain mirrors.

    Attributes
    ----------
    ghost : Ghost
        The ghost that geometrical optics predicts.
    echoes : int
        Number of its echoes.
    ghost_error, folded_error : float [m]
        Mean distances of the echoes from the predicted ghost; and of the folded echoes from the object itself. NaN
        without echoes.
    cell : float [m]
        Diagonal of the resolution cell at the ghost.
    covered : float
        Share of the visible part of the ghost that has an echo within a resolution cell.
    """

    ghost: Ghost
    echoes: int
    ghost_error: float
    folded_error: float
    cell: float
    covered: float


def objects_shown(reconstruction: xr.DataTree, scene: Scene, generations: int, cell_of_range: Array) -> list[Shown]:
    """The echoes of every ghost of an object that mirrors should show.

    An echo counts for the nearest of all ghosts by way of the same mirrors, ghosts of walls included.

    Parameters
    ----------
    reconstruction : xarray.DataTree
    scene : Scene
    generations : int
        Largest number of mirrors.
    cell_of_range : (2,) array
        Size of a resolution cell: in range [m], and in cross-range per metre of range.
    """
    points = confident_points(reconstruction)
    ways = {(*(face.name for face in one.way), one.face.name): one.chain for one in identified(reconstruction, scene)
            if one.face is not None and one.way is not None}  # fmt: skip
    expected = [one for one in ghosts_of(scene, generations) if one.way]
    found = []
    for ghost in (one for one in expected if not one.is_wall):
        rivals = [other for other in expected if other.way_names == ghost.way_names]
        echoes = points.isel(point=points["chain"].values == ways.get(ghost.way_names, "none"))
        nearest = surface_of(echoes, rivals, reconstruction, cells=np.inf)
        echoes = echoes.isel(point=nearest == rivals.index(ghost))
        range_ = float(np.linalg.norm(ghost.place[ghost.seen], axis=1).mean())
        cell = float(np.hypot(cell_of_range[0], cell_of_range[1] * range_))
        place = np.column_stack([echoes["x_initial"], echoes["y_initial"]])
        if not len(place):
            found.append(Shown(ghost, 0, float("nan"), float("nan"), cell, 0.0))
            continue
        folded = np.column_stack([echoes["x"], echoes["y"]])
        ghost_error = float(cKDTree(ghost.place).query(place)[0].mean())
        folded_error = float(cKDTree(image_in(ghost.way).inverse(ghost.place)).query(folded)[0].mean())
        covered = float((cKDTree(place).query(ghost.place[ghost.seen])[0] <= cell).mean())
        found.append(Shown(ghost, len(place), ghost_error, folded_error, cell, covered))
    return found
