"""The types that the whole package speaks of."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

Progress = Callable[[int, int], None]
"""Called now and then with what is done and what there is in all."""

Chain = tuple[int, ...]
"""Indices of mirrors in the tree, from the root; the root's own is empty."""
