"""The tree of mirrors: which mirror and which object is seen through which mirrors."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mirrorfold.common.chains import chain_name
from mirrorfold.common.geometry import reflect_each
from mirrorfold.common.svg import tree_card
from mirrorfold.common.types import Array, Chain
from mirrorfold.detection import Echoes, Fold, Mirror, fold_of


@dataclass(frozen=True, eq=False)
class MirrorTree:
    """A mirror and all that is seen through it. The root is the radar's direct view and has no mirror.

    Attributes
    ----------
    way : tuple of Mirror
        The mirrors by way of which the radar looks here, where the unfolded image shows them; the node's own mirror is
        the last one. Empty for the root.
    face : Echoes
        Echoes of the mirror's own surface, moved onto it.
    objects : Echoes
        Echoes of objects that are seen through this mirror, or directly for the root.
    mirrors : tuple of MirrorTree
        The mirrors that are seen through this one, in the order in which they were found.
    chain : tuple of int
        Index of each mirror among its parent's `mirrors`, from the root to this node; empty for the root.
    """

    way: tuple[Mirror, ...]
    face: Echoes
    objects: Echoes
    mirrors: tuple[MirrorTree, ...] = ()
    chain: Chain = ()

    @property
    def mirror(self) -> Mirror | None:
        """The mirror, straight or curved, where the unfolded image shows it; None for the root."""
        return self.way[-1] if self.way else None

    @cached_property
    def fold(self) -> Fold:
        """The map from the image to the true places of the node's objects.

        It reflects across the node's own mirror first, which is a ghost itself, then across the mirrors of its parents,
        up to the root.
        """
        return fold_of(self.way, self.objects.position.shape[1])

    @cached_property
    def face_fold(self) -> Fold:
        """The map from the image to the true place of the node's mirror and of the echoes of its face."""
        return fold_of(self.way[:-1], self.objects.position.shape[1])

    @property
    def line(self) -> Mirror | None:
        """Earlier name of `mirror`, as in the publication, where all mirrors are lines; deprecated."""
        warnings.warn("MirrorTree.line is called mirror now, as it may be curved", DeprecationWarning, stacklevel=2)
        return self.mirror

    def walk(self) -> Iterator[MirrorTree]:
        """Yield this node and all below it, depth first."""
        yield self
        for node in self.mirrors:
            yield from node.walk()

    @property
    def name(self) -> str:
        """Name of the mirror by its chain, such as "mirror 1/0"; that of the root is "radar"."""
        return f"mirror {chain_name(self.chain)}" if self.chain else "radar"

    @property
    def generation(self) -> int:
        """Number of mirrors in the chain: 0 for the root."""
        return len(self.chain)

    def mirrors_by_chain(self) -> dict[Chain, tuple[Mirror, ...]]:
        """For the chain of every node of this tree: its `way`."""
        return {node.chain: node.way for node in self.walk()}

    @property
    def errors(self) -> tuple[float, float]:
        """Standard errors of the node's mirror at its true place: of its direction [degree] and position [m].

        An image in a mirror moves by twice the mirror's offset error and turns by twice its angle error. So the errors
        of all mirrors on the way add to a mirror's own; they are independent, and their squares add.
        """
        *way, last = self.way
        angle = last.angle_error**2 + sum((2.0 * mirror.angle_error) ** 2 for mirror in way)
        covariance, normal = place_covariance(last.center[None], way)[0], last.normal
        for mirror in reversed(way):
            normal = _reflection_matrices(mirror, last.center[None])[0] @ normal
        offset = last.offset_error**2 + float(normal @ covariance @ normal)
        return float(np.sqrt(angle)), float(np.sqrt(offset))

    def to_json(self) -> str:
        """The tree as JSON: chain, mirror and number of object echoes of every node."""
        return json.dumps(self._plain(), indent=2)

    def _plain(self) -> dict[str, object]:
        """The node and all below it as dicts and lists, for JSON."""
        line = None
        if self.mirror is not None:
            line = dict(zip(("start", "end"), self.mirror.ends.tolist(), strict=True), strength=self.mirror.strength)
            if self.mirror.curved:
                line |= {"middle": self.mirror.center.tolist(), "curvature": self.mirror.curvature}
            line |= {"angle_error_deg": self.mirror.angle_error, "offset_error_m": self.mirror.offset_error}
        return {
            "chain": list(self.chain),
            "line": line,
            "objects": len(self.objects),
            "mirrors": [node._plain() for node in self.mirrors],
        }

    def _repr_html_(self) -> str:
        """Mirrors and objects of the unfolded image, and which is seen through which mirror, for notebooks."""
        return tree_card(self)

    def __repr__(self) -> str:
        rows = []
        for node in self.walk():
            size = "" if node.mirror is None else f", {node.mirror.size:.2f} m"
            rows.append(f"{'  ' * node.generation}{node.name}{size}: {len(node.objects)} object echoes")
        return "\n".join(rows)


def place_covariance(places: Array, way: Sequence[Mirror]) -> Array:
    """Covariance (n, d, d) [m^2] of the true places of echoes at places (n, d) [m] of the image, from mirrors' errors.

    `way` holds the mirrors by way of which the echoes are seen, the nearest to the radar first. Echoes are reflected at
    the last mirror first, which is itself a ghost by way of the mirrors before it.
    """
    covariance, seen = np.zeros((*places.shape, places.shape[1])), places
    for mirror in reversed(way):
        matrix = _reflection_matrices(mirror, seen)
        covariance = matrix @ covariance @ np.swapaxes(matrix, -1, -2) + 4.0 * mirror.displacement_covariance(places)
        places = reflect_each(places, *mirror.facing(seen))
    return covariance


def _reflection_matrices(mirror: Mirror, seen: Array) -> Array:
    """Reflection matrices (n, d, d) of a mirror where lines of sight through places (n, d) [m] of the image meet it."""
    normal = mirror.facing(seen)[1]
    return np.eye(seen.shape[1]) - 2.0 * np.einsum("ni,nj->nij", normal, normal)
