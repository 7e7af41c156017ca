"""Complex noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def complex_noise(generator: np.random.Generator, *shape: int) -> NDArray[np.complex64]:
    """White complex Gaussian noise of this shape, in single precision; the variance of either part is one."""
    return generator.standard_normal((*shape, 2), dtype=np.float32).view(np.complex64)[..., 0]
