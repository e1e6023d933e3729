import subprocess
import sys

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from midair.solvers import one_blas_thread


def blas_threads():
    return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]


def test_one_thread_within_and_as_before_after():
    import scipy.linalg.cython_blas  # noqa: F401

    with threadpool_limits(limits=2, user_api="blas"):
        before = blas_threads()
        with one_blas_thread():
            assert set(blas_threads()) == {1}
        assert blas_threads() == before


@pytest.mark.long
@pytest.mark.parametrize("elsewhere", ["", "scipy.__path__.insert(0, '/nowhere')"], ids=["a file", "not found"])
def test_a_blas_that_would_be_loaded_within_is_limited_too(elsewhere):
    """NumPy and SciPy have one BLAS each, and Numba loads SciPy's when the first kernel compiles."""
    program = f"""
import scipy
from threadpoolctl import threadpool_info
from midair.solvers import one_blas_thread
{elsewhere}
with one_blas_thread():
    import scipy.linalg
    print([pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"])
"""
    environment = {"OPENBLAS_NUM_THREADS": "2", "PATH": ""}
    said = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert said.stdout.strip() in ("[1, 1]", "[1]")
