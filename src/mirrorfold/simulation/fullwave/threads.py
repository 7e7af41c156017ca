"""One thread for linear algebra: frequencies are solved in processes of their own."""

from __future__ import annotations

from threadpoolctl import threadpool_limits


def one_thread() -> threadpool_limits:
    """A context in which linear algebra uses one thread, so that results do not depend on the number of cores."""
    return threadpool_limits(limits=1, user_api="blas")
