"""The tree of mirrors: who is seen through whom."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mirrorfold.common.svg import tree_card
from mirrorfold.common.types import Array, Chain
from mirrorfold.detection.echoes import Echoes
from mirrorfold.detection.mirrors.mirror import Fold, Mirror, fold_of


@dataclass(frozen=True, eq=False)
class MirrorTree:
    """A mirror with all that was seen through it; the root is the radar's own view and has no mirror of its own.

    Attributes
    ----------
    line : Mirror or None
        In the coordinates of the unfolded image; in space a plane.
    face : Echoes
        Echoes of the mirror itself, moved onto it.
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
    chain: Chain = ()

    def walk(self) -> Iterator[MirrorTree]:
        """Yield this node and all below it, depth first."""
        yield self
        for mirror in self.mirrors:
            yield from mirror.walk()

    @property
    def generation(self) -> int:
        """Number of mirrors on the way here: 0 for the root."""
        return len(self.chain)

    def folds(self) -> dict[Chain, Fold]:
        """For the chain of every node of this root, the map from the image to the true place of what it holds.

        Each reflects across its own mirror, which is a ghost itself, first, then across its parents' up to the root.
        """
        dimensions = self.objects.position.shape[1]
        return {chain: fold_of(way, dimensions) for chain, way in self.ways().items()}

    def ways(self) -> dict[Chain, tuple[Mirror, ...]]:
        """For the chain of every node of this root, the mirrors on the way to it, its own last."""
        result: dict[Chain, tuple[Mirror, ...]] = {(): ()}
        for node in self.walk():
            if node.line is not None:
                result[node.chain] = (*result[node.chain[:-1]], node.line)
        return result

    def errors(self) -> dict[Chain, tuple[float, float]]:
        """Standard errors of every mirror at its true place: of its direction [degree], and of its position [m].

        What is seen by way of a mirror moves by twice the mirror's error, and turns by twice its angle about it: the
        errors of all mirrors on the way add to a mirror's own, as independent ones do.
        """
        result: dict[Chain, tuple[float, float]] = {}
        for chain, (*way, line) in ((chain, way) for chain, way in self.ways().items() if way):
            angle = line.angle_error**2 + sum((2.0 * mirror.angle_error) ** 2 for mirror in way)
            covariance, normal = led_astray(line.center[None], way)[0], line.normal
            for mirror in reversed(way):
                normal = _turn(mirror, line.center[None])[0] @ normal
            offset = line.offset_error**2 + float(normal @ covariance @ normal)
            result[chain] = float(np.sqrt(angle)), float(np.sqrt(offset))
        return result

    def to_json(self) -> str:
        """The tree as JSON: chain, mirror and number of objects of every node."""
        return json.dumps(self._plain(), indent=2)

    def _plain(self) -> dict[str, object]:
        line = None
        if self.line is not None:
            line = dict(zip(("start", "end"), self.line.ends.tolist(), strict=True), strength=self.line.strength)
            if self.line.curved:
                line |= {"middle": self.line.center.tolist(), "curvature": self.line.curvature}
            line |= {"angle_error_deg": self.line.angle_error, "offset_error_m": self.line.offset_error}
        return {
            "chain": list(self.chain),
            "line": line,
            "objects": len(self.objects),
            "mirrors": [mirror._plain() for mirror in self.mirrors],
        }

    def _repr_html_(self) -> str:
        """The unfolded image's mirrors and objects, and who is seen through whom, for notebooks."""
        return tree_card(self)

    def __repr__(self) -> str:
        rows = []
        for node in self.walk():
            what = "radar" if node.line is None else f"mirror {'/'.join(map(str, node.chain))}"
            size = "" if node.line is None else f", {node.line.size:.2f} m"
            rows.append(f"{'  ' * node.generation}{what}{size}: {len(node.objects)} object echoes")
        return "\n".join(rows)


def led_astray(places: Array, way: Sequence[Mirror]) -> Array:
    """Covariance (n, d, d) [m^2] of where places (n, d) of the image truly are, by the errors of mirrors on the way.

    The first mirror on the way comes first. The last one, a ghost by way of those before it, is folded away first.
    """
    covariance, seen = np.zeros((*places.shape, places.shape[1])), places
    for mirror in reversed(way):
        turn = _turn(mirror, seen)
        covariance = turn @ covariance @ np.swapaxes(turn, -1, -2) + 4.0 * mirror.strays(places)
        hit, normal = mirror.facing(seen)
        places = places - 2.0 * np.sum((places - hit) * normal, axis=1)[:, None] * normal
    return covariance


def _turn(mirror: Mirror, seen: Array) -> Array:
    """The reflections (n, d, d) by which lines of sight through places (n, d) are turned at a mirror."""
    normal = mirror.facing(seen)[1]
    return np.asarray(np.eye(seen.shape[1]) - 2.0 * np.einsum("ni,nj->nij", normal, normal))
