"""A worker writes only into the store that it was sent to; otherwise it returns its result."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from midair.errors import BrokenFileError, DeviceStateError, InputError, MidairError, MismatchError, MissingFileError
from midair.files.native.provenance_json import from_json
from midair.sweep.pattern_report import PatternResults
from midair.sweep.pattern_sweep import PatternSweep
from midair.sweep.storage import Found, Result
from midair.sweep.store import load_sweep, open_sweep, write_region

SWEEP = PatternSweep(count=10, curve_count=4, chunk=4, strengths=(0.1,), curve_heights=(0.3,), method="naive")


def found(task):
    error = 0.001 * np.arange(task.first, task.last) + task.condition
    return Result(task=task, found=Found(error=error, rounded_error=error + 0.5, strength=0.1), seconds=2.0)


def fill(path):
    with open_sweep(path, SWEEP) as store:
        for task in store.missing():
            store.write(found(task))


def test_what_is_written_is_read_and_no_longer_missing(tmp_path):
    path = tmp_path / "s.zarr"
    with open_sweep(path, SWEEP) as store:
        assert store.missing() == SWEEP.tasks()
        last = store.missing()[-1]
        store.write(found(last))
        assert store.missing() == SWEEP.tasks()[:-1]
    with open_sweep(path, SWEEP) as store:
        assert store.missing() == SWEEP.tasks()[:-1]
    results = PatternResults.of(load_sweep(path))
    assert results.sweep == SWEEP
    assert results.known == last.count
    assert results.asked == sum(one.count for one in SWEEP.conditions())
    assert results.seconds == 2.0
    np.testing.assert_array_equal(results.error[last.condition, last.first : last.last], found(last).found.error)
    np.testing.assert_array_equal(
        results.rounded_error[last.condition, last.first : last.last], found(last).found.error + 0.5
    )


def test_results_without_a_flag_do_not_count(tmp_path):
    """As if the program had been killed between a task's results and its flag."""
    import zarr

    path = tmp_path / "s.zarr"
    task = SWEEP.tasks()[0]
    with open_sweep(path, SWEEP) as store:
        store.write(found(task))
    zarr.open_group(path, mode="r+")["done"][task.condition, 0] = False
    with open_sweep(path, SWEEP) as store:
        assert task in store.missing()
    assert load_sweep(path).known == 0


def test_a_store_of_other_settings_is_refused_and_left_alone(tmp_path):
    path = tmp_path / "s.zarr"
    with open_sweep(path, SWEEP) as store:
        store.write(found(SWEEP.tasks()[0]))
    with pytest.raises(MismatchError, match="chunk"), open_sweep(path, replace(SWEEP, chunk=5)):
        pass
    assert load_sweep(path).known == SWEEP.tasks()[0].count


@pytest.mark.long
def test_two_concurrent_writers_do_not_conflict(tmp_path):
    """No chunk of any array belongs to two tasks, so writers never overwrite each other."""
    path = tmp_path / "s.zarr"
    with open_sweep(path, SWEEP) as store:
        written = set()
        for task in store.missing():
            before = {file: file.stat().st_mtime_ns for file in path.rglob("c/*/*") if file.is_file()}
            store.write(found(task))
            after = {file: file.stat().st_mtime_ns for file in path.rglob("c/*/*") if file.is_file()}
            assert {file: after[file] for file in before} == before
            written |= {file.relative_to(path).parts[0] for file in after.keys() - before.keys()}
    assert written == {"error", "rounded_error", "target_strength", "seconds", "done"}


def test_a_second_writer_is_rejected(tmp_path):
    pytest.importorskip("fcntl")
    path = tmp_path / "s.zarr"
    with open_sweep(path, SWEEP), pytest.raises(DeviceStateError, match="another program"), open_sweep(path, SWEEP):
        pass
    with open_sweep(path, SWEEP):
        pass


@pytest.mark.long
def test_other_programs_can_read_it(tmp_path):
    xarray = pytest.importorskip("xarray")
    path = tmp_path / "s.zarr"
    fill(path)
    with xarray.open_zarr(path, consolidated=False) as data:
        assert data.error.dims == ("condition", "pattern")
        assert data.height.attrs["units"] == "m"
        np.testing.assert_array_equal(data.pattern, SWEEP.patterns())
        assert from_json(data.attrs["provenance"]).simulated


def test_no_incomplete_store_remains(tmp_path):
    with open_sweep(tmp_path / "s.zarr", SWEEP):
        assert [path.name for path in tmp_path.iterdir()] == ["s.zarr"]


@pytest.mark.parametrize("name", ["error", "done", "pattern"])
def test_a_shape_that_does_not_fit_into_memory_is_refused_before_reading(tmp_path, name):
    path = tmp_path / "s.zarr"
    with open_sweep(path, SWEEP):
        pass
    stated = path / name / "zarr.json"
    layout = json.loads(stated.read_text())
    layout["shape"][-1] = 10**12
    stated.write_text(json.dumps(layout))
    with pytest.raises(InputError, match=r"s\.zarr: expected .* GB of free memory"):
        load_sweep(path)
    with pytest.raises(InputError, match=r"s\.zarr: expected .* GB of free memory"), open_sweep(path, SWEEP):
        pass


def test_other_files_are_rejected(tmp_path):
    import zarr

    with pytest.raises(MissingFileError):
        load_sweep(tmp_path / "none.zarr")
    (tmp_path / "file.zarr").write_text("text")
    with pytest.raises(BrokenFileError):
        load_sweep(tmp_path / "file.zarr")
    (tmp_path / "folder.zarr").mkdir()
    with pytest.raises(BrokenFileError):
        load_sweep(tmp_path / "folder.zarr")
    zarr.create_group(tmp_path / "other.zarr")
    with pytest.raises(BrokenFileError):
        load_sweep(tmp_path / "other.zarr")
    with pytest.raises(MissingFileError), open_sweep(tmp_path / "no" / "s.zarr", SWEEP):
        pass


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::zarr.errors.ZarrUserWarning")
def test_flipped_bits_in_any_file_are_reported_or_harmless(tmp_path):
    path = tmp_path / "s.zarr"
    fill(path)
    right, rng, reported = PatternResults.of(load_sweep(path)), np.random.default_rng(6), 0
    files = sorted(file for file in path.rglob("*") if file.is_file())
    layouts, chunks = ([file for file in files if (file.name == "zarr.json") == each] for each in (True, False))
    for file in [*rng.choice(layouts, 20), *rng.choice(chunks, 20), *[path / "zarr.json"] * 20]:
        whole, place = file.read_bytes(), int(rng.integers(8 * file.stat().st_size))
        spoilt = bytearray(whole)
        spoilt[place // 8] ^= 1 << place % 8
        file.write_bytes(spoilt)
        try:
            results = PatternResults.of(load_sweep(path))
        except MidairError:
            reported += 1
        else:
            assert results.sweep == right.sweep
            assert results.seconds == right.seconds
            for name in ("patterns", "error", "rounded_error"):
                np.testing.assert_array_equal(getattr(results, name), getattr(right, name), err_msg=f"{file} {place}")
        file.write_bytes(whole)
    assert reported >= 50


@pytest.mark.long
def test_a_flipped_bit_in_a_chunk_is_reported_and_a_lost_chunk_is_missing(tmp_path):
    path = tmp_path / "s.zarr"
    fill(path)
    right, chunk = load_sweep(path), path / "error" / "c" / "0" / "1"
    whole, rng = chunk.read_bytes(), np.random.default_rng(5)
    reported = 0
    for place in rng.integers(8 * len(whole), size=16):
        spoilt = bytearray(whole)
        spoilt[place // 8] ^= 1 << place % 8
        chunk.write_bytes(spoilt)
        try:
            np.testing.assert_array_equal(load_sweep(path).error, right.error)
        except BrokenFileError as wrong:
            assert "chunk error/c/0/1 is damaged" in str(wrong)
            reported += 1
    assert reported >= 14
    chunk.unlink()
    assert load_sweep(path).known == right.known - 4
    with open_sweep(path, SWEEP) as store:
        (lost,) = store.missing()
        assert (lost.condition, lost.first) == (0, 4)
        store.write(found(lost))
    np.testing.assert_array_equal(load_sweep(path).error, right.error)


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


@pytest.mark.long
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
