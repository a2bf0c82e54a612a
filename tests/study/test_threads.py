"""Linear algebra has one thread wherever tasks run: several round sums otherwise."""

import importlib

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from vibroplat.study.pool import pool
from vibroplat.system.workers import one_thread


def blas_threads(*modules):
    """Threads of the linear algebra of all libraries, those of these modules too."""
    for name in modules:
        importlib.import_module(name)
    with one_thread():
        inner = {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}
    return [inner, {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}]


@pytest.mark.parametrize("jobs", [1, 2])
def test_linear_algebra_has_one_thread_while_a_pool_is_open_and_as_many_as_before_after_it(jobs):
    with threadpool_limits(2):
        with pool(jobs) as workers:
            assert workers.submit(blas_threads, "scipy.linalg").result()[0] == {1}
            here = threadpool_info()
        after = threadpool_info()
    threads = [
        {library["num_threads"] for library in found if library["user_api"] == "blas"} for found in (here, after)
    ]
    assert threads == [{1}, {2}]


def test_overlapping_blocks_of_one_thread_give_back_the_threads_with_the_last():
    with threadpool_limits(2):
        first, second = one_thread(), one_thread()
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        between = blas_threads()[1]
        second.__exit__(None, None, None)
        assert [between, blas_threads()[1]] == [{1}, {2}]
