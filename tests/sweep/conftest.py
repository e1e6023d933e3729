"""Sweeps that are finished here and now."""

import pytest

from midair.sweep.run import do
from midair.sweep.store import load_sweep, open_sweep


@pytest.fixture(scope="session")
def finished():
    """Do a sweep, task after task in this process, in a file; its results."""

    def finish(path, sweep):
        with open_sweep(path, sweep) as store:
            for task in store.missing():
                store.write(do(sweep.job(task), task))
        return load_sweep(path)

    return finish
