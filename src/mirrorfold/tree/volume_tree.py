"""Steps 3 and 4 in three dimensions: who is seen through whom.

As in the floor plan: along the straight line of sight of every beam each mirror crossed opens that
mirror's world, and the first object ends the view. A beam that straddles the edge of a mirror sees two worlds at once;
what it shows behind the mirror belongs to nobody.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, binary_erosion, label

from mirrorfold.detection.image_echoes import reference_echo
from mirrorfold.detection.planes import MINIMUM_SIZE, PlaneMirror, _face, _hull, find_planes, spread_across
from mirrorfold.detection.volume_echoes import Cloud, RadarVolume
from mirrorfold.tree.lines_of_sight import CLEAR_DB, NOBODY, ROOT, Views
from mirrorfold.tree.tree import WALL_MARGIN, MirrorTree, _before, _parent

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

OBJECT_DEPTH = 0.10
"""What lies further than this [m] behind the first echo of an object, in its beam, is multiple scattering."""

OBJECT_DB = -26.0
"""Echoes of objects reach this far below the robust reference of their world: Lambert's law takes 15 dB at 80 degrees
from the normal, and speckle fades by as much as 10 dB."""

EDGE = 1.0
"""Within this many beam radii of its edge a beam straddles a mirror."""

STRAY_DEVIATIONS = 4.0
"""Echoes of a face lie within this many standard deviations of it: wings of a beam 40 dB above the noise."""

MAXIMUM_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Worlds:
    """Every line of sight of the radar, by beam.

    Attributes
    ----------
    views : Views
        Crossings and parents of the mirrors; `u` counts the beams.
    straddles : (mirrors, beams) bool array
        Beams at the edge of each mirror.
    end : (beams,) array [m]
        Range where an object ends the view; infinite without one.
    """

    views: Views
    straddles: Mask
    end: Array

    def seen_through(self, range_: Array, beam: Index) -> Index:
        """The mirror through which points at that range [m] in that beam are seen: ROOT, NOBODY or its number."""
        crossing, opened = self.tables
        passed = np.zeros(range_.shape, dtype=np.intp)
        for ranges in crossing:
            passed += ranges[beam] < range_
        return np.asarray(opened[passed, beam])

    @cached_property
    def tables(self) -> tuple[Array, Index]:
        """Crossings of every beam from the nearest outward, (depth, beams), and what is seen after each."""
        crossing, opened = self.views._worlds
        order = np.argsort(self.views.crossing, axis=0)[: len(crossing)]
        edge = np.take_along_axis(self.straddles, order, axis=0) & np.isfinite(crossing)
        opened = opened.copy()
        opened[1:][np.logical_or.accumulate(edge, axis=0)] = NOBODY
        return crossing, opened


def build_worlds(
    cloud: Cloud,
    volume: RadarVolume,
    *,
    minimum_size: float = MINIMUM_SIZE,
    wall_margin: float = WALL_MARGIN,
    opaque: bool = True,
    threshold_db: float = OBJECT_DB,
) -> tuple[MirrorTree, Worlds]:
    """Mirrors, their generations, and the objects seen through each.

    Parameters
    ----------
    cloud : Cloud
    volume : RadarVolume
    minimum_size : float [m]
        Smallest width and height of a mirror.
    wall_margin : float [m]
        Least distance behind a mirror up to which echoes belong to the wall.
    opaque : bool
        Whether objects end the view.
    threshold_db : float [dB]
        Of objects, relative to the reference of their world.
    """
    visible = np.ones(cloud.range.size, dtype=bool)
    for _ in range(MAXIMUM_ROUNDS):
        mirrors = find_planes(cloud, volume, usable=visible, minimum_size=minimum_size)
        mirrors = [piece for mirror in mirrors for piece in _split(mirror, mirrors, volume, minimum_size)]
        worlds = _arrange(mirrors, volume)
        face = _faces(mirrors, worlds, cloud, volume, wall_margin)
        through = worlds.seen_through(cloud.range, cloud.beam)
        objects = (face == ROOT) & (through != NOBODY)
        objects &= _strong(cloud, through, objects & visible, volume, threshold_db)
        if not opaque:
            break
        still, end = _unobstructed(cloud, objects & visible, volume)
        worlds = replace(worlds, end=end)
        if np.array_equal(still, visible):
            break
        visible = still
    return _assemble(mirrors, worlds, face, np.where(objects & visible, through, NOBODY), cloud, volume)


def _arrange(mirrors: list[PlaneMirror], volume: RadarVolume) -> Worlds:
    """Crossings of every beam with every mirror and the parents of the mirrors."""
    beams = volume.shape[0] * volume.shape[1]
    crossing = np.full((len(mirrors), beams), np.inf)
    straddles = np.zeros((len(mirrors), beams), dtype=bool)
    for index, mirror in enumerate(mirrors):
        distance = float(np.linalg.norm(mirror.center - volume.origin))
        steps = int(np.ceil(EDGE * float(volume.width(distance)) / (volume.beam_step * distance)))
        seen = mirror.beams.reshape(volume.shape)
        # The scan ends there, not the wall.
        core = binary_erosion(seen, iterations=steps, border_value=1)
        wide = binary_dilation(seen, iterations=steps)
        straddles[index] = (wide & ~core).ravel()
        crossing[index] = replace(mirror, beams=wide.ravel()).crossing(volume)
    core_crossing = np.where(straddles, np.inf, crossing)
    parent = np.array([_parent(index, core_crossing) for index in range(len(mirrors))], dtype=np.intp)
    views = Views(np.arange(beams, dtype=float), crossing, parent, volume.range, np.zeros((0, 0)))
    return Worlds(views, straddles, np.full(beams, np.inf))


def _split(
    mirror: PlaneMirror, mirrors: list[PlaneMirror], volume: RadarVolume, minimum_size: float
) -> list[PlaneMirror]:
    """The pieces of a sheet that passes from one mirror's world into another's.

    The mirror image of a wall in another one at right angles to it continues the wall itself.
    """
    index = next(i for i, other in enumerate(mirrors) if other is mirror)
    columns, before = _before(index, np.stack([other.crossing(volume) for other in mirrors]))
    if not columns.size or np.all(before == before[0]):
        return [mirror]
    pieces = []
    for value in np.unique(before):
        part = np.zeros(mirror.beams.size, dtype=bool)
        part[columns[before == value]] = True
        regions, _ = label(part.reshape(volume.shape))
        for number in range(1, regions.max() + 1):
            beams = (regions == number).ravel()
            if beams.sum() < 4:
                continue
            points = _face(volume, mirror.normal, mirror.center, beams)
            piece = replace(mirror, center=points.mean(axis=0), outline=points, beams=beams)
            if min(piece.extent) >= 0.5 * minimum_size:
                pieces.append(replace(piece, outline=_hull(points, mirror.normal)))
    return pieces or [mirror]


def _faces(mirrors: list[PlaneMirror], worlds: Worlds, cloud: Cloud, volume: RadarVolume, wall_margin: float) -> Index:
    """The mirror that each echo lies on, NOBODY for echoes from inside a wall, ROOT for all others."""
    face = np.full(cloud.range.size, ROOT, dtype=np.intp)
    nearest = np.full(cloud.range.size, np.inf)
    sight = volume.sight.reshape(-1, 3)[cloud.beam]
    for index, mirror in enumerate(mirrors):
        cosine = np.abs(sight @ mirror.normal)
        stray = volume.range_cell + STRAY_DEVIATIONS * spread_across(volume, cloud.range, cosine)
        beside = mirror.beside(cloud.position)
        met = np.isfinite(worlds.views.crossing[index])[cloud.beam]
        wall = met & (beside <= stray) & (beside >= -np.maximum(wall_margin, stray + 2.0 * mirror.depth))
        face[wall & (face == ROOT)] = NOBODY
        closer = wall & mirror.beams[cloud.beam] & (np.abs(beside) < np.minimum(nearest, stray + mirror.depth))
        face[closer] = index
        nearest[closer] = np.abs(beside)[closer]
    return face


def _strong(cloud: Cloud, through: Index, objects: Mask, volume: RadarVolume, threshold_db: float) -> Mask:
    """Which echoes are strong for the world they are seen in; a lossy mirror dims everything behind it alike."""
    strong = np.zeros(cloud.range.size, dtype=bool)
    for world in np.unique(through[objects]):
        here = through == world
        brightest = np.zeros(volume.shape[0] * volume.shape[1])
        np.maximum.at(brightest, cloud.beam[here & objects], cloud.amplitude[here & objects])
        strong |= here & (cloud.amplitude >= 10.0 ** (threshold_db / 20.0) * reference_echo(brightest))
    return strong


def _unobstructed(cloud: Cloud, objects: Mask, volume: RadarVolume) -> tuple[Mask, Array]:
    """Which echoes no object stands in front of, and where objects end the view of each beam."""
    beams = volume.shape[0] * volume.shape[1]
    first = np.full(beams, np.inf)
    np.minimum.at(first, cloud.beam[objects], cloud.range[objects])
    brightest = np.zeros(beams)
    near = objects & (cloud.range <= first[cloud.beam] + OBJECT_DEPTH)
    np.maximum.at(brightest, cloud.beam[near], cloud.amplitude[near])
    end = first + OBJECT_DEPTH
    clear = cloud.amplitude > 10.0 ** (CLEAR_DB / 20.0) * brightest[cloud.beam]
    still = (cloud.range <= end[cloud.beam]) | clear
    np.maximum.at(end, cloud.beam[clear & objects], cloud.range[clear & objects] + OBJECT_DEPTH)
    return still, end


def _assemble(
    mirrors: list[PlaneMirror], worlds: Worlds, face: Index, objects: Index, cloud: Cloud, volume: RadarVolume
) -> tuple[MirrorTree, Worlds]:
    """The tree of mirrors with their echoes."""
    chains: list[tuple[int, ...]] = [() for _ in mirrors]

    def node(index: int, chain: tuple[int, ...]) -> MirrorTree:
        children = [child for child in range(len(mirrors)) if worlds.views.parent[child] == index]
        line = mirrors[index] if index != ROOT else None
        if line is not None:
            chains[index] = chain
        on_it = cloud.take((face == index) & (index != ROOT))
        return MirrorTree(
            line=line,  # type: ignore[arg-type]
            face=_snapped(on_it, line, volume),  # type: ignore[arg-type]
            objects=cloud.take(objects == index),  # type: ignore[arg-type]
            mirrors=tuple(node(child, (*chain, i)) for i, child in enumerate(children)),
            chain=chain,
        )

    root = node(ROOT, ())
    return root, replace(worlds, views=replace(worlds.views, chain=tuple(chains)))


def _snapped(cloud: Cloud, mirror: PlaneMirror | None, volume: RadarVolume) -> Cloud:
    """One echo a beam, where the beam's axis meets the mirror."""
    if mirror is None or not cloud.range.size:
        return cloud
    order = np.lexsort([-cloud.amplitude, cloud.beam])
    cloud = cloud.take(order[np.unique(cloud.beam[order], return_index=True)[1]])
    range_ = mirror.crossing(volume)[cloud.beam]
    position = volume.origin + range_[:, None] * volume.sight.reshape(-1, 3)[cloud.beam]
    return replace(cloud, position=position, range=range_)
