"""The error of an image, measured on random pixels against the float64 direct sum."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mirrorfold.common.noise import complex_noise
from mirrorfold.focusing.exact.direct_sum import direct_sum
from mirrorfold.focusing.exact.exact_sum import focus_exact
from mirrorfold.focusing.problem import Problem

TEST_PIXELS = 60
"""Number of random pixels on which an image is compared with the direct sum."""


def measured_error(
    problem: Problem, image: NDArray[np.complex64], s: NDArray[np.complex64], seed: int = 0, pixels: int = TEST_PIXELS
) -> float:
    """Relative L2 error of an image, estimated on random pixels against the float64 direct sum.

    Errors are largest where the image is bright, and near the array. So a third of the pixels is drawn evenly, a third
    with probabilities proportional to their power, and a third proportional to ``1 / (r^2 + L^2)`` of the range r and
    the length L of the array. Each squared error is divided by the probability of its pixel, so that the estimate is
    unbiased for the whole image (importance sampling).
    """
    values = image.ravel()
    power = np.abs(values).astype(np.float64) ** 2
    power_sum = float(power.sum())
    if power_sum == 0.0:
        return float("inf")
    dx, dy, dz = (axis - problem.radar_position[n] for n, axis in enumerate((problem.x, problem.y, problem.z)))
    length = max(float(np.ptp(np.concatenate([problem.tx, problem.rx]), axis=0).max()), 1.0 / float(problem.k.max()))
    nearness = dz[:, None, None] ** 2 + dy[None, :, None] ** 2 + dx[None, None, :] ** 2 + length**2
    nearness = 1.0 / nearness.ravel()
    nearness_sum = float(nearness.sum())
    rng = np.random.default_rng(seed)
    third = (pixels + 2) // 3

    def draw(weight: NDArray[np.float64], weight_sum: float) -> NDArray[np.int64]:
        return np.searchsorted(np.cumsum(weight), rng.random(third) * weight_sum, side="right")

    flat = np.concatenate([rng.integers(0, power.size, third), draw(power, power_sum), draw(nearness, nearness_sum)])
    flat = np.minimum(flat, power.size - 1)
    probability = (1.0 / power.size + power[flat] / power_sum + nearness[flat] / nearness_sum) / 3.0
    error = np.abs(values[flat] - direct_sum(problem, s, problem.points(flat))) ** 2
    return float(np.sqrt(np.mean(error / probability) / power_sum))


def exact_kernel_error(problem: Problem, s: NDArray[np.complex64], tolerance: float) -> float:
    """Relative L2 error of the exact kernel, measured on a few random pixels without making the whole image.

    All pixels are drawn evenly, because the kernel's error is equally large everywhere.
    """
    wanted = np.zeros(problem.shape, dtype=bool)
    wanted.flat[np.random.default_rng(0).integers(0, problem.pixels, TEST_PIXELS)] = True
    found = focus_exact(problem, s, tolerance, where=wanted)[wanted]
    reference = direct_sum(problem, s, problem.points(np.flatnonzero(wanted)))
    return float(np.linalg.norm(found - reference) / np.linalg.norm(reference))


def white_noise(problem: Problem, seed: int = 0) -> NDArray[np.complex64]:
    """Complex white noise in the shape of the data, of variance 2: the hardest data to image within a tolerance."""
    return complex_noise(np.random.default_rng(seed), *problem.data_shape)
