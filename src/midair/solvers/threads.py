"""One BLAS thread at a time.

The matrices here have a few hundred rows. Two BLAS threads spend more time waiting for each other, spinning, than
they save: the paper's method takes three to ten times as long with two. Frames or patterns in several processes use
more cores better.
"""

from collections.abc import Generator
from contextlib import contextmanager
from importlib import import_module


@contextmanager
def one_blas_thread() -> Generator[None]:
    """Keep the matrix products of this process to one thread while inside."""
    from threadpoolctl import threadpool_limits

    # Only a BLAS that is loaded can be limited; SciPy's, which Numba calls too, is another one than NumPy's.
    import_module("scipy.linalg.cython_blas")
    with threadpool_limits(limits=1, user_api="blas"):
        yield
