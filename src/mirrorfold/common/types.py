"""Types that many modules use in annotations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Complex = NDArray[np.complex128]

Index = NDArray[np.intp]

Mask = NDArray[np.bool_]

Names = NDArray[np.str_]

Progress = Callable[[int, int], None]
"""Function that is called as ``progress(done, total)`` from the thread that asked for the work."""

ROOT, UNSEEN = -1, -2
"""What stands in the place of the number of a mirror for what is seen directly, without any mirror; and for what is
neither seen directly nor by way of any mirror."""

Chain = tuple[int, ...]
"""Chain of mirrors: from the root of the tree on, the index of the next mirror among the children of each node."""
