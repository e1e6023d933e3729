from threadpoolctl import threadpool_info, threadpool_limits

from midair.solve import one_blas_thread


def blas_threads():
    return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]


def test_one_thread_within_and_as_before_after():
    with threadpool_limits(limits=2, user_api="blas"):
        _check()


def _check():
    before = blas_threads()
    with one_blas_thread():
        assert set(blas_threads()) == {1}
    assert blas_threads() == before
