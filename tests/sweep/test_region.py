"""A worker writes only into the store that it was sent to; otherwise it returns its result."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from midair.sweep.pattern_sweep import PatternSweep
from midair.sweep.region import write_region
from midair.sweep.store import load_sweep, open_sweep
from midair.sweep.task import Found, Result

SWEEP = PatternSweep(count=10, curve_count=4, chunk=4, strengths=(0.1,), curve_heights=(0.3,), method="naive")
TASK = SWEEP.tasks()[0]
RESULT = Result(
    task=TASK, found=Found(error=np.ones(TASK.count), rounded_error=np.ones(TASK.count), strength=0.1), seconds=1.0
)


def address_of(path):
    with open_sweep(path, SWEEP) as store:
        return store.address


def test_a_worker_stores_and_returns_only_its_time(tmp_path):
    address = address_of(tmp_path / "s.zarr")
    left = address.take(RESULT)
    assert (left.task, left.found, left.seconds) == (TASK, None, 1.0)
    results = load_sweep(tmp_path / "s.zarr")
    assert results.known == TASK.count
    assert results.seconds == 1.0


def test_a_new_store_with_the_same_name_is_not_written(tmp_path):
    """An old task may still be running after its sweep was deleted."""
    old = address_of(tmp_path / "s.zarr")
    shutil.rmtree(tmp_path / "s.zarr")
    new = address_of(tmp_path / "s.zarr")
    assert old.take(RESULT) is RESULT
    assert load_sweep(tmp_path / "s.zarr").known == 0
    assert new.take(RESULT).found is None


def test_no_store_is_made_where_there_is_none(tmp_path):
    address = replace(address_of(tmp_path / "s.zarr"), place=str(tmp_path / "none.zarr"))
    assert address.take(RESULT) is RESULT
    assert not (tmp_path / "none.zarr").exists()


def test_the_flag_is_written_last():
    """With a group that fails at any array, no incomplete task is flagged."""

    class Group(dict):
        def __missing__(self, name):
            self[name] = Chunks(name)
            return self[name]

    class Chunks:
        chunks = (1, 4)

        def __init__(self, name):
            self.name = name

        def __setitem__(self, place, value):
            written.append(self.name)

    written = []
    write_region(Group(), TASK, RESULT.found, 1.0)
    assert sorted(written) == ["done", "error", "rounded_error", "seconds", "target_strength"]
    assert written[-1] == "done"


@pytest.mark.parametrize("kind", ["folder", "memory://bucket/region.zarr"])
def test_other_tasks_stay_unknown(kind, tmp_path):
    where = tmp_path / "s.zarr" if kind == "folder" else kind
    address_of(where).take(RESULT)
    known = np.isfinite(load_sweep(where).error)
    assert known[TASK.condition, TASK.first : TASK.last].all()
    assert known.sum() == TASK.count
