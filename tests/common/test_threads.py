"""Threads: every item is worked on once, whatever the number of cores, and linear algebra is the same."""

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from mirrorfold.common import threads
from mirrorfold.common.threads import for_each, in_shares, one_thread, products


@pytest.mark.parametrize("cores", [1, 2, 7])
@pytest.mark.parametrize("count", [0, 1, 3, 100])
def test_shares_cover_the_range_once(monkeypatch, count, cores):
    monkeypatch.setattr(threads, "cpu_count", lambda: cores)
    seen = np.zeros(count, dtype=int)

    def work(step, start, stop):
        assert stop > start
        seen[start:stop] += step

    in_shares(work, count, 3)
    np.testing.assert_array_equal(seen, 3)


def test_products_are_those_of_numpy():
    random = np.random.default_rng(0)
    left = random.standard_normal((5, 3, 7)) + 1j * random.standard_normal((5, 3, 7))
    right = random.standard_normal((5, 7, 2)) + 1j * random.standard_normal((5, 7, 2))
    out = np.full((5, 3, 2), np.nan, dtype=complex)
    assert products(left, right, out) is out
    np.testing.assert_allclose(out, np.einsum("fij,fjk->fik", left, right), rtol=1e-12)


def test_the_first_failure_is_raised():
    def work(item):
        if item == 3:
            raise ValueError("item 3")

    with pytest.raises(ValueError, match="item 3"):
        for_each(work, range(10))


def test_linear_algebra_is_set_back_by_the_last_to_leave():
    def counts() -> set[int]:
        return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}

    products(np.ones((1, 2, 2)), np.ones((1, 2, 2)), np.empty((1, 2, 2)))
    with threadpool_limits(2, user_api="blas"):
        first, second = one_thread(), one_thread()
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert counts() == {1}
        second.__exit__(None, None, None)
        assert counts() == {2}
