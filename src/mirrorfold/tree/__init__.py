"""Steps 3 and 4 of the algorithm: who is seen through whom."""

from mirrorfold.tree.assignment import assign_echoes
from mirrorfold.tree.lines_of_sight import LinesOfSight
from mirrorfold.tree.mirror_tree import MirrorTree
from mirrorfold.tree.ordering import Order, order_mirrors

__all__ = ["LinesOfSight", "MirrorTree", "Order", "assign_echoes", "order_mirrors"]
