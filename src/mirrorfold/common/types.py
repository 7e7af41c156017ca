"""Types that many modules speak of."""

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
"""Called as ``progress(done, total)`` from the thread that asked for the work."""

Chain = tuple[int, ...]
"""Indices of mirrors in the tree, from the root; the root's own is empty."""
