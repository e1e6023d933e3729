"""Limit BLAS to one thread.

The matrices have a few hundred rows. With two BLAS threads the method of the paper takes three to ten times as long,
because the threads wait for each other. Several processes use more cores better.
"""

from collections.abc import Generator
from contextlib import contextmanager
from importlib import import_module


@contextmanager
def one_blas_thread() -> Generator[None]:
    """Limit matrix products of this process to one thread within the context."""
    from threadpoolctl import threadpool_limits

    # Only a loaded BLAS can be limited. SciPy's BLAS, which Numba also calls, differs from NumPy's.
    import_module("scipy.linalg.cython_blas")
    with threadpool_limits(limits=1, user_api="blas"):
        yield
