"""Kernels as they run, and as plain Python; the exact kernel made dear, so that small images take the fast ones."""

from __future__ import annotations

import numpy as np
import pytest

from mirrorfold.focusing.choosing import choice
from mirrorfold.focusing.fast import line_array
from mirrorfold.focusing.predicting.cost import Cost


@pytest.fixture(params=["compiled", "plain Python"])
def run(request):
    """Calls a kernel, one way or the other."""

    def call(kernel, *arguments):
        function = kernel if request.param == "compiled" else getattr(kernel, "py_func", kernel)
        with np.errstate(over="ignore"):  # indices are added modulo 2^32, as in the compiled kernels
            return function(*arguments)

    return call


@pytest.fixture
def rng():
    return np.random.default_rng(0)


@pytest.fixture
def every_sector_counts(monkeypatch):
    """Small test images would be left to the exact kernel, which is as fast for them."""
    for module in (choice, line_array):
        monkeypatch.setattr(module, "exact_cost", lambda *_: Cost(0.0, 1e6))
