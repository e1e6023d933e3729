"""Untrusted HDF5 files are inspected in a separate process; its crash does not affect this one."""

import os
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import h5py
import pytest

from midair.errors import BrokenFileError, FileError
from midair.files import load
from midair.files.native import inspection

ONE_THREAD = {"OPENBLAS_NUM_THREADS": "1"}


@pytest.mark.long
def test_a_file_that_crashes_the_inspector_does_not_end_this_process(path, recording, alike, monkeypatch):
    """HDF5 crashes on some files; here the inspector is killed during its check."""
    alike(load(path), recording)
    process = inspection._INSPECTOR._process
    monkeypatch.setattr(inspection, "_PLAIN", {})
    os.kill(process.pid, signal.SIGSTOP)
    killer = subprocess.Popen(["sh", "-c", f"sleep 0.2; kill -9 {process.pid}"])
    with pytest.raises(BrokenFileError, match="on which HDF5 crashes or hangs"):
        load(path)
    killer.wait()
    with pytest.raises(BrokenFileError, match="on which HDF5 crashes or hangs"):
        load(path)
    assert inspection._INSPECTOR._process is None, "nobody was shown the same file again"
    os.utime(path)
    alike(load(path), recording)


@pytest.mark.long
def test_an_inspector_that_waits_without_end_is_ended(path, recording, alike, monkeypatch):
    alike(load(path), recording)
    monkeypatch.setattr(inspection, "PATIENCE", 0.2)
    monkeypatch.setattr(inspection, "_PLAIN", {})
    os.kill(inspection._INSPECTOR._process.pid, signal.SIGSTOP)
    with pytest.raises(BrokenFileError, match="crashes or hangs"):
        load(path)


@pytest.mark.long
def test_the_message_names_a_limit_of_address_space(path, recording, alike, monkeypatch):
    alike(load(path), recording)
    monkeypatch.setattr(inspection, "PATIENCE", 0.2)
    monkeypatch.setattr(inspection, "address_limit", lambda: 1_100_000_000)
    monkeypatch.setattr(inspection, "_PLAIN", {})
    os.kill(inspection._INSPECTOR._process.pid, signal.SIGSTOP)
    with pytest.raises(FileError, match=r"within the limit of 1.1 GB of address space \(ulimit -v\); raise") as refused:
        load(path)
    assert not isinstance(refused.value, BrokenFileError)


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="address space is limited on Linux")
def test_a_good_file_opens_within_a_limit_of_address_space(path):
    program = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_AS, (15 * 10**8, 15 * 10**8)); "
        "from midair.files import load; load(sys.argv[1])"
    )
    words = [sys.executable, "-c", program, str(path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=os.environ | ONE_THREAD)
    assert done.stderr == ""


def test_without_a_process_the_check_is_the_same(path, recording, alike, monkeypatch):
    monkeypatch.setattr(inspection, "_INSPECTOR", inspection._Inspector())
    monkeypatch.setattr(sys, "executable", "/nonexistent/python")
    monkeypatch.setattr(inspection, "_PLAIN", {})
    alike(load(path), recording)
    with h5py.File(path, "r+", libver=("v110", "v110")) as file:
        file["other"] = h5py.SoftLink("/time")
    with pytest.raises(BrokenFileError, match="a soft link"):
        load(path)


def test_an_unchanged_file_is_inspected_once(path, monkeypatch):
    os.utime(path, (1e9, 1e9))
    monkeypatch.setattr(inspection, "SETTLED", -(10**18))
    load(path)
    monkeypatch.setattr(inspection, "_INSPECTOR", None)
    load(path)


@pytest.mark.long
def test_a_copy_of_the_process_has_an_inspector_of_its_own(path):
    program = """
        import os, sys
        from midair.files import load
        from midair.files.native import inspection
        load(sys.argv[1])
        first = inspection._INSPECTOR._process.pid
        os.utime(sys.argv[1])
        child = os.fork()
        load(sys.argv[1])
        if child == 0:
            assert inspection._INSPECTOR._process.pid != first
            os._exit(0)
        assert inspection._INSPECTOR._process.pid == first
        assert os.waitpid(child, 0)[1] == 0
        print(first)
    """
    words = [sys.executable, "-c", textwrap.dedent(program), str(path)]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert not Path(f"/proc/{done.stdout.strip()}").exists(), "it ended with the process that began it"
