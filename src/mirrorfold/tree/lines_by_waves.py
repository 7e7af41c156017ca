"""The lines of all straight mirrors of a tree, fitted to the complex image once the tree is known.

The search for mirrors and their order need lines to a fraction of a cell; folding gains by a hundredth. So only the
mirrors of the tree are fitted so closely, and each once.
"""

from __future__ import annotations

from dataclasses import replace

from mirrorfold.common.threads import for_each
from mirrorfold.detection import ImageView, LineMirror, Mirror
from mirrorfold.detection.search.coherent import fitted
from mirrorfold.tree.assignment import Found
from mirrorfold.tree.mirror_tree import MirrorTree


def with_lines_by_waves(found: Found, view: ImageView) -> Found:
    """What was found, with the straight, opaque mirrors on the lines that explain the image best."""
    passable = {wall.mirror for wall in found.transparent_walls}
    lines = {node.mirror for node in found.tree.walk() if isinstance(node.mirror, LineMirror)} - passable
    closer: dict[Mirror, Mirror] = {}

    for_each(lambda line: closer.__setitem__(line, fitted(line, view)), lines)

    def moved(node: MirrorTree) -> MirrorTree:
        way = tuple(closer.get(mirror, mirror) for mirror in node.way)
        face = way[-1].snapped(view, node.face) if way else node.face
        return replace(node, way=way, face=face, mirrors=tuple(map(moved, node.mirrors)))

    mirrors, crossing = [closer.get(mirror, mirror) for mirror in found.sight.mirrors], found.sight.crossing.copy()
    for index in found.sight.ways:
        crossing[index] = mirrors[index].crossing(view)
    return found._replace(tree=moved(found.tree), sight=replace(found.sight, mirrors=mirrors, crossing=crossing))
