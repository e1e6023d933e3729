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
def test_a_blas_that_would_be_loaded_within_is_limited_too_also_where_its_file_is_not_found():
    """NumPy and SciPy have one BLAS each, and Numba loads SciPy's when the first kernel compiles."""
    environment = {"OPENBLAS_NUM_THREADS": "2", "PATH": ""}
    for elsewhere in ("", "scipy.__path__.insert(0, '/nowhere')"):
        program = f"""
import scipy
from threadpoolctl import threadpool_info
from midair.solvers import one_blas_thread
{elsewhere}
with one_blas_thread():
    import scipy.linalg
    print([pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"])
"""
        words = [sys.executable, "-c", program]
        said = subprocess.run(words, env=environment, capture_output=True, text=True, check=True)
        assert said.stdout.strip() in ("[1, 1]", "[1]"), elsewhere
