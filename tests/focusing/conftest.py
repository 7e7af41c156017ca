"""Kernels as they run, and as plain Python."""

from __future__ import annotations

import numpy as np
import pytest


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
