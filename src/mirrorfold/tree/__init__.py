"""Steps 3 and 4 of the algorithm: who is seen through whom.

* The steps: `ordering` (3), `assignment` (4), and what they make: `lines_of_sight`, `mirror_tree`.
* Steps 2 to 4 in turn: `rounds` until they agree; `kinds` for mirrors of every kind.
* More mirrors, told by what is known already: `completion`, `showing` with `curved` and `short_rows`.
* `measured`: what the sweep tells beyond its image. `grouping`: which echoes are those of one object.
* `explaining/`: echoes that something else explains. `half_transparent/`: walls that let waves pass.
"""

from mirrorfold.tree.assignment import assign_echoes
from mirrorfold.tree.lines_of_sight import LinesOfSight
from mirrorfold.tree.mirror_tree import MirrorTree
from mirrorfold.tree.ordering import Order, order_mirrors

__all__ = ["LinesOfSight", "MirrorTree", "Order", "assign_echoes", "order_mirrors"]
