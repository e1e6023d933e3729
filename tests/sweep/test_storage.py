"""Folders and object stores: the same sweep, complete or absent, and one-line errors."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from midair.errors import FileError, InputError, MismatchError, MissingExtraError, MissingFileError
from midair.sweep.pattern_sweep import PatternSweep
from midair.sweep.run import do, run_sweep
from midair.sweep.storage import SweepFolder, storage_of
from midair.sweep.store import load_sweep, open_sweep

SWEEP = PatternSweep(count=10, curve_count=4, chunk=4, strengths=(0.1,), curve_heights=(0.3,), method="naive")


@pytest.fixture
def bucket():
    """An address in an object store in the memory of this process."""
    import fsspec

    yield "memory://bucket/all.zarr"
    fsspec.filesystem("memory").rm("/bucket", recursive=True)


@pytest.mark.long
def test_an_object_store_equals_a_folder(bucket, tmp_path, finished, threads):
    """Bit by bit, written by a worker, and continued."""

    def stop(done, _):
        if done:
            raise KeyboardInterrupt

    here = finished(tmp_path / "s.zarr", SWEEP)
    with threads() as scheduler:
        with pytest.raises(KeyboardInterrupt):
            run_sweep(SWEEP, bucket, scheduler=scheduler, progress=stop)
        before = load_sweep(bucket).known
        assert before > 0
        # A worker finishes and stores its current task.
        assert 0 < run_sweep(SWEEP, bucket, scheduler=scheduler) <= here.known - before
    there = load_sweep(bucket)
    for name in ("error", "rounded_error", "strength"):
        np.testing.assert_array_equal(getattr(there, name), getattr(here, name))
    assert there.settings == here.settings
    with pytest.raises(MismatchError, match="seed"), open_sweep(bucket, replace(SWEEP, seed=1)):
        pass


@pytest.fixture
def s3(monkeypatch):
    """An address in a bucket of a loopback server; requires extra packages."""
    import fsspec

    pytest.importorskip("s3fs")
    server = pytest.importorskip("moto.server").ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    for name, value in {
        "AWS_ENDPOINT_URL": f"http://{host}:{port}",
        "AWS_ACCESS_KEY_ID": "nobody",
        "AWS_SECRET_ACCESS_KEY": "nothing",
        "AWS_DEFAULT_REGION": "us-east-1",
    }.items():
        monkeypatch.setenv(name, value)
    fsspec.filesystem("s3").mkdir("bucket")
    yield "s3://bucket/all.zarr"
    server.stop()


@pytest.mark.slow
def test_s3_equals_a_folder_when_workers_write_and_continue(s3, tmp_path, finished):
    here = finished(tmp_path / "s.zarr", SWEEP)
    with open_sweep(s3, SWEEP) as store:
        first = store.missing()[0]
        store.write(do(SWEEP.job(first), first))
    assert load_sweep(s3).known == first.count
    assert run_sweep(SWEEP, s3, workers=2) == here.known - first.count
    there = load_sweep(s3)
    for name in ("error", "rounded_error", "strength"):
        np.testing.assert_array_equal(getattr(there, name), getattr(here, name))
    assert run_sweep(SWEEP, s3, workers=2) == 0


@pytest.mark.long
def test_an_interrupted_creation_is_completed(bucket, monkeypatch, finished):
    import zarr

    create = zarr.Group.create_array

    def dies(group, name, **layout):
        if name == "seconds":
            raise KeyboardInterrupt
        return create(group, name, **layout)

    monkeypatch.setattr(zarr.Group, "create_array", dies)
    with pytest.raises(KeyboardInterrupt), open_sweep(bucket, SWEEP):
        pass
    monkeypatch.undo()
    assert finished(bucket, SWEEP).known == sum(task.count for task in SWEEP.tasks())


def test_a_full_disk_is_reported_with_the_given_name(tmp_path):
    """The message must not contain the temporary name that begins with .midair."""
    resource = pytest.importorskip("resource")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (16, hard))
    try:
        with pytest.raises(FileError) as told, open_sweep(tmp_path / "s.zarr", SWEEP):
            pass
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert str(told.value) == f"{tmp_path / 's.zarr'}: cannot be written: File too large"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.long
def test_a_file_address_is_a_folder(tmp_path, finished):
    finished(f"file://{tmp_path}/s.zarr", SWEEP)
    assert storage_of(f"file://{tmp_path}/s.zarr") == SweepFolder(path=tmp_path / "s.zarr")
    assert load_sweep(tmp_path / "s.zarr").known


@pytest.mark.parametrize(
    "place", [SweepFolder(path=storage_of("x").path), storage_of("memory://bucket/n.zarr")], ids=str
)
def test_names_of_chunks_are_read_and_others_do_not_count(place, tmp_path, monkeypatch):
    import fsspec

    monkeypatch.chdir(tmp_path)
    files, root = fsspec.url_to_fs(str(place))
    assert place.chunks("done") == set()
    for name in ("c/0/3", "c/12/0", "c/1/2.4711.partial", "c/x/y", "zarr.json"):
        files.makedirs(f"{root}/done/{name}".rpartition("/")[0], exist_ok=True)
        files.pipe_file(f"{root}/done/{name}", b"1")
    try:
        assert place.chunks("done") == {(0, 3), (12, 0)}
    finally:
        files.rm(root, recursive=True)


@pytest.mark.parametrize(
    ("where", "error", "words"),
    [
        ("memory://bucket/none.zarr", MissingFileError, "memory://bucket/none.zarr: expected a sweep"),
        ("frob://bucket/s.zarr", InputError, "frob"),
    ],
)
def test_a_missing_store_is_one_line(where, error, words):
    with pytest.raises(error, match=words) as told:
        load_sweep(where)
    assert "\n" not in str(told.value)


def test_a_kind_of_store_whose_package_is_missing_is_one_line(monkeypatch):
    monkeypatch.setitem(sys.modules, "s3fs", None)
    with pytest.raises(MissingExtraError, match="s3fs"):
        load_sweep("s3://bucket/s.zarr")
