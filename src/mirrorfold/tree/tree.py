"""Steps 3 and 4: who is seen through whom.

In the unfolded image every line of sight is a straight ray from the radar. Walking outward along it, each mirror
crossed opens that mirror's world; the first thing that is not a mirror ends the view, because objects are opaque too:
what the image shows behind an object is multiple scattering, not a thing. Mirrors that only multiple scattering holds
up vanish when their echoes do, so mirrors and views are found in turn until neither changes.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.geometry import Isometry
from mirrorfold.common.svg import tree_card
from mirrorfold.detection.image_echoes import Echoes, reference_echo
from mirrorfold.detection.image_view import PolarImage
from mirrorfold.detection.known_mirrors import given_mirrors
from mirrorfold.detection.lines import MINIMUM_LENGTH, find_mirrors
from mirrorfold.detection.mirror import Mirror, line_cell
from mirrorfold.tree.lines_of_sight import NOBODY, OPAQUE_CELLS, ROOT, Views, barrier_of, open_range

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

WALL_MARGIN = 0.04
"""Echoes up to this far [m] behind a mirror leak from inside the wall: volume scattering reaches 1-3 cm deep."""

MAXIMUM_ROUNDS = 8
"""Mirrors and views usually agree after two or three rounds."""


@dataclass(frozen=True, eq=False)
class MirrorTree:
    """A mirror with all that was seen through it; the root is the radar's own view and has no line.

    Attributes
    ----------
    line : Mirror or None
        In the coordinates of the unfolded image.
    face : Echoes
        Echoes of the mirror itself, moved onto its line.
    objects : Echoes
        What was seen through this mirror, or directly for the root, and is not a mirror.
    mirrors : tuple of MirrorTree
        The mirrors seen through this one, from the strongest.
    chain : tuple of int
        Indices from the root.
    """

    line: Mirror | None
    face: Echoes
    objects: Echoes
    mirrors: tuple[MirrorTree, ...] = ()
    chain: tuple[int, ...] = ()

    def walk(self) -> Iterator[MirrorTree]:
        """Yield this node and all below it, depth first."""
        yield self
        for mirror in self.mirrors:
            yield from mirror.walk()

    @property
    def generation(self) -> int:
        """Number of mirrors on the way here: 0 for the root."""
        return len(self.chain)

    def folds(self, dimensions: int = 2) -> dict[tuple[int, ...], Isometry]:
        """For the chain of every node of this root, the map from the image to the true place of what it holds.

        Each reflects across its own line, which is a ghost itself, first, then across its parents' up to the root.
        """
        result: dict[tuple[int, ...], Isometry] = {(): Isometry.identity(dimensions)}
        for node in self.walk():
            if node.line is not None:
                mirror = Isometry.reflection(node.line.start, node.line.normal)
                result[node.chain] = result[node.chain[:-1]] @ mirror
        return result

    def to_json(self) -> str:
        """The tree as JSON: chain, line and number of objects of every node."""
        return json.dumps(self._plain(), indent=2)

    def _plain(self) -> dict[str, object]:
        line = None
        if self.line is not None:
            line = {
                "start": self.line.start.tolist(),
                "end": self.line.end.tolist(),
                "strength": self.line.strength,
                "angle_error_deg": self.line.angle_error,
                "offset_error_m": self.line.offset_error,
            }
        return {
            "chain": list(self.chain),
            "line": line,
            "objects": int(self.objects.range.size),
            "mirrors": [mirror._plain() for mirror in self.mirrors],
        }

    def _repr_html_(self) -> str:
        """The unfolded image's mirrors and objects, and who is seen through whom, for notebooks."""
        return tree_card(self)

    def __repr__(self) -> str:
        rows = []
        for node in self.walk():
            what = "radar" if node.line is None else f"mirror {'/'.join(map(str, node.chain))}"
            size = "" if node.line is None else f", {node.line.length:.2f} m"
            rows.append(f"{'  ' * node.generation}{what}{size}: {node.objects.range.size} object echoes")
        return "\n".join(rows)


def build_tree(
    echoes: Echoes,
    polar: PolarImage,
    *,
    minimum_length: float = MINIMUM_LENGTH,
    opaque: bool = True,
    wall_margin: float = WALL_MARGIN,
    tested: bool = True,
    lines: Array | None = None,
    generations: int | None = None,
) -> tuple[MirrorTree, Views]:
    """Mirrors, their generations, and the objects seen through each.

    Parameters
    ----------
    echoes : Echoes
    polar : PolarImage
    minimum_length : float [m]
        Of a mirror.
    opaque : bool
        Whether objects end the view; without, as in the published algorithm, everything in a shadow is folded.
    wall_margin : float [m]
        How far behind a mirror echoes still belong to the wall.
    tested : bool
        Whether mirrors must pass the tests of `find_mirrors`.
    lines : (mirrors, 2, 2) array [m], optional
        The ends of mirrors that are given, in the place of those found.
    generations : int, optional
        Largest number of mirrors in a chain. Deeper ones count as objects, and hide what they show.

    Returns
    -------
    tree : MirrorTree
        Its root; without mirrors if there are none.
    views : Views
    """
    visible = np.ones(echoes.range.size, dtype=bool)
    for _ in range(MAXIMUM_ROUNDS):
        if lines is None:
            mirrors = find_mirrors(echoes, polar, minimum_length=minimum_length, usable=visible, tested=tested)
        else:
            mirrors = given_mirrors(lines, echoes, polar)
        mirrors, views, face = _arrange(mirrors, echoes, visible, polar, minimum_length, opaque, wall_margin)
        if generations is not None and not all(shallow := _within(views.parent, generations)):
            mirrors = [mirror for mirror, keep in zip(mirrors, shallow, strict=True) if keep]
            mirrors, views, face = _arrange(mirrors, echoes, visible, polar, minimum_length, opaque, wall_margin)
        if not opaque:
            break
        column = views.column(echoes.u)
        still = visible & views.clear(echoes.range, column, echoes.amplitude)
        strong = _strong(echoes, still & (face == ROOT), views.seen_through(echoes.range, column), len(mirrors), polar)
        if np.array_equal(still, visible) and np.array_equal(strong, echoes.strong):
            break
        visible, echoes = still, replace(echoes, strong=strong)
    if opaque:
        views = replace(views, open=open_range(views, echoes.take(visible), polar))
    return _assemble(mirrors, views, face, echoes, visible, polar)


def _within(parent: Index, generations: int) -> list[bool]:
    """Whether each mirror is seen through fewer others than `generations`."""
    depths = []
    for mirror in parent:
        depth = 1
        while mirror >= 0 and depth <= generations:
            mirror, depth = parent[mirror], depth + 1
        depths.append(depth <= generations)
    return depths


def _strong(echoes: Echoes, objects: Mask, through: Index, mirrors: int, polar: PolarImage) -> Mask:
    """Which echoes are strong for the world they are seen in.

    A lossy mirror dims all that is seen through it. Where the objects of a mirror's world are dimmer than the
    reference, the threshold follows them down.
    """
    strong = echoes.strong.copy()
    for mirror in range(mirrors):
        world = objects & (through == mirror)
        seen = world & echoes.strong
        if seen.any():
            beam = np.rint(echoes.u[seen] / (0.5 * polar.u_cell)).astype(np.intp)
            brightest = np.zeros(int(np.ptp(beam)) + 1)
            np.maximum.at(brightest, beam - beam.min(), echoes.amplitude[seen])
            dimming = reference_echo(brightest) / echoes.reference
            strong |= world & (echoes.amplitude >= min(dimming, 1.0) * echoes.threshold)
    return strong


def _arrange(
    mirrors: list[Mirror],
    echoes: Echoes,
    visible: Mask,
    polar: PolarImage,
    minimum_length: float,
    opaque: bool,
    wall_margin: float,
) -> tuple[list[Mirror], Views, Index]:
    """Parents of the mirrors, the end of every view, and the mirror each echo lies on (NOBODY: in its wall)."""
    rows, pieces = mirrors, [[mirror] for mirror in mirrors]
    # What hides a part of a row may itself be but a part of its row.
    for _ in range(2):
        divided = [_split(row, pieces[:i] + pieces[i + 1 :], polar, minimum_length) for i, row in enumerate(rows)]
        pieces = [kept for kept, _ in divided]
        scraps = [scrap for _, short in divided for scrap in short]
    mirrors = [piece for kept in pieces for piece in kept]
    face = _faces(mirrors, echoes, polar, wall_margin)
    # Where a row is too short for a mirror of its own it is a wall's edge still, and nothing that hides.
    face[(face == ROOT) & (_faces(scraps, echoes, polar, wall_margin) != ROOT)] = NOBODY
    barrier = np.zeros_like(polar.amplitude)
    if opaque:
        barrier = barrier_of(echoes.take(visible & echoes.strong & (face == ROOT)), polar)
    views = Views(polar.u, _crossings(mirrors, polar), np.empty(0, dtype=np.intp), polar.range, barrier)
    crossing = views.crossing
    for index, mirror in enumerate(mirrors):
        columns = np.flatnonzero(np.isfinite(crossing[index]))
        behind = crossing[index, columns] + OPAQUE_CELLS * polar.range_cell
        crossing[index, columns[~views.clear(behind, columns, mirror.strength)]] = np.inf
    parent = np.array([_parent(index, crossing) for index in range(len(mirrors))], dtype=np.intp)
    seen = [index for index in range(len(mirrors)) if np.isfinite(crossing[index]).any()]
    renumber = {old: new for new, old in enumerate(seen)} | {ROOT: ROOT, NOBODY: NOBODY}
    # A mirror whose parent is never seen cannot be seen either.
    return (
        [mirrors[index] for index in seen],
        replace(
            views,
            crossing=crossing[seen],
            parent=np.array([renumber.get(int(parent[i]), NOBODY) for i in seen], dtype=np.intp),
        ),
        np.array([renumber.get(int(f), ROOT) for f in face], dtype=np.intp),
    )


def _crossings(mirrors: list[Mirror], polar: PolarImage) -> Array:
    """Range [m] at which each direction meets each mirror, (mirrors, nu); infinite where it does not."""
    sight = polar.to_points(np.ones(polar.u.size), polar.u) - polar.radar
    crossing = np.full((len(mirrors), polar.u.size), np.inf)
    for index, mirror in enumerate(mirrors):
        towards = sight @ mirror.normal
        with np.errstate(divide="ignore", invalid="ignore"):
            range_ = ((mirror.start - polar.radar) @ mirror.normal) / towards
            along = mirror.along(polar.radar + range_[:, None] * sight)
        met = (range_ > 0.0) & (along >= 0.0) & (along <= mirror.length)
        crossing[index, met] = range_[met]
    return crossing


def _before(index: int, crossing: Array) -> tuple[Index, Index]:
    """Directions that meet a mirror, and the mirror that each met last before it (ROOT: none)."""
    columns = np.flatnonzero(np.isfinite(crossing[index]))
    ranges = np.where(crossing[:, columns] < crossing[index, columns], crossing[:, columns], -np.inf)
    last = np.argmax(ranges, axis=0)
    return columns, np.where(np.isfinite(ranges[last, np.arange(columns.size)]), last, ROOT)


def _parent(index: int, crossing: Array) -> int:
    """The mirror through which most of a mirror is seen."""
    _, before = _before(index, crossing)
    if not before.size:
        return NOBODY
    values, counts = np.unique(before, return_counts=True)
    return int(values[np.argmax(counts)])


def _split(
    row: Mirror, others: list[list[Mirror]], polar: PolarImage, minimum_length: float
) -> tuple[list[Mirror], list[Mirror]]:
    """The pieces of a row of echoes that passes from one mirror's world into another's, and those too short to be one.

    The mirror image of a wall in another one at right angles to it continues the wall itself.
    """
    crossing = _crossings([row, *(piece for kept in others for piece in kept)], polar)
    columns, before = _before(0, crossing)
    if not columns.size or np.all(before == before[0]):
        return [row], []
    position = row.along(polar.to_points(crossing[0, columns], polar.u[columns]))
    cuts = [0.0, row.length]
    for i in np.flatnonzero(before[1:] != before[:-1]):
        cuts.append(0.5 * (position[i] + position[i + 1]))
    cuts.sort()
    pieces = [
        replace(row, start=row.start + a * row.direction, end=row.start + b * row.direction) for a, b in pairwise(cuts)
    ]
    kept = [piece for piece in pieces if piece.length >= minimum_length]
    if not kept:
        return [row], []
    return kept, [piece for piece in pieces if 0.0 < piece.length < minimum_length]


def _faces(mirrors: list[Mirror], echoes: Echoes, polar: PolarImage, wall_margin: float) -> Index:
    """The mirror that each echo lies on, NOBODY for echoes from inside a wall, ROOT for all others."""
    face = np.full(echoes.range.size, ROOT, dtype=np.intp)
    nearest = np.full(echoes.range.size, np.inf)
    for index, mirror in enumerate(mirrors):
        across, along_cell = line_cell(polar, echoes.position, mirror.direction)
        position, beside = mirror.along(echoes.position), mirror.beside(echoes.position)
        behind = beside * -np.sign((polar.radar - mirror.middle) @ mirror.normal)
        inside = (position >= -along_cell) & (position <= mirror.length + along_cell)
        wall = inside & (behind >= -across) & (behind <= across + wall_margin)
        on_it = wall & (np.abs(beside) <= across)
        face[wall & (face == ROOT)] = NOBODY
        closer = on_it & (np.abs(beside) < nearest)
        face[closer] = index
        nearest[closer] = np.abs(beside)[closer]
    return face


def _assemble(
    mirrors: list[Mirror], views: Views, face: Index, echoes: Echoes, visible: Mask, polar: PolarImage
) -> tuple[MirrorTree, Views]:
    """The tree of mirrors with their echoes, less those that the radar's own view contradicts."""
    column = views.column(echoes.u)
    through = views.seen_through(echoes.range, column) if mirrors else np.full(echoes.range.size, ROOT)
    objects = np.where(visible & echoes.strong & (face == ROOT), through, NOBODY)

    chains: list[tuple[int, ...]] = [() for _ in mirrors]

    def node(index: int, chain: tuple[int, ...], fold: Isometry) -> MirrorTree:
        children = [child for child in range(len(mirrors)) if views.parent[child] == index]
        line = mirrors[index] if index != ROOT else None
        seen = echoes.take(objects == index)
        if line is not None:
            chains[index] = chain
            fold = fold @ Isometry.reflection(line.start, line.normal)
            place = polar.to_polar(fold(seen.position))
            seen = seen.take(~views.contradicted(seen.range, views.column(seen.u), *place))
        return MirrorTree(
            line=line,
            face=_snapped(echoes.take(visible & (face == index) & (index != ROOT)), line),
            objects=seen,
            mirrors=tuple(node(child, (*chain, i), fold) for i, child in enumerate(children)),
            chain=chain,
        )

    root = node(ROOT, (), Isometry.identity())
    return root, replace(views, chain=tuple(chains))


def _snapped(echoes: Echoes, line: Mirror | None) -> Echoes:
    """Echoes of a mirror moved square onto its line."""
    if line is None:
        return echoes
    along = np.clip(line.along(echoes.position), 0.0, line.length)
    return replace(echoes, position=line.start + along[:, None] * line.direction)
