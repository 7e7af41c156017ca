"""Steps 3 and 4 of the algorithm: which mirror, and which echo, is seen through which mirrors.

* The steps: `ordering` (3) and `assignment` (4). Their results: `lines_of_sight`, in which mirrors have numbers, and
  `mirror_tree`, in which each mirror is a node with its echoes.
* The loop: `rounds` repeats steps 2 to 4 until they agree; `kinds` does so for mirrors of every kind.
* Further mirrors, which are found once others are known: `completion`, `evidence` with `curved` and `short_rows`.
* `lines_by_waves`: the mirrors of the tree on the lines that explain the complex image best.
* `measured`: tests of echoes that need the sweep, not its image alone. `grouping`: which echoes are of one object.
* `explaining/`: echoes of which something other than an object is the cause. `half_transparent/`: walls that let
  waves pass.
"""

from mirrorfold.tree.assignment import assign_echoes
from mirrorfold.tree.lines_of_sight import LinesOfSight
from mirrorfold.tree.mirror_tree import MirrorTree
from mirrorfold.tree.ordering import Order, order_mirrors

__all__ = ["LinesOfSight", "MirrorTree", "Order", "assign_echoes", "order_mirrors"]
