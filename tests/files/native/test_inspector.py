"""Untrusted HDF5 files: unsafe content is refused before data are read, and does not end the program."""

import shutil
import struct
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from midair.errors import BrokenFileError, MidairError
from midair.files import load, load_calibration, load_pressure, load_solution, open_take
from midair.files.native import inspection
from midair.files.native.hdf5_recovery import checksum, openable
from midair.files.native.inspector import refusal

PLAIN = ("v110", "v110")


def edited(path, edit):
    with h5py.File(path, "r+", libver=PLAIN) as file:
        edit(file)


def replaced(file, name, **how):
    """Create the dataset `name` again with its unit, but without references to axes."""
    units = file[name].attrs["units"]
    shape, dtype = how.pop("shape", file[name].shape), file[name].dtype
    del file[name]
    made = how.pop("make", file.create_dataset)(name, shape=shape, dtype=dtype, **how)
    made.attrs["units"] = units


def external(file):
    replaced(file, "samples", external=[("/etc/passwd", 0, h5py.h5f.UNLIMITED)])


def virtual(file):
    layout = h5py.VirtualLayout(shape=file["samples"].shape, dtype="f8")
    layout[:] = h5py.VirtualSource(".", "samples", shape=file["samples"].shape)
    units = file["samples"].attrs["units"]
    del file["samples"]
    file.create_virtual_dataset("samples", layout).attrs["units"] = units


def soft(file):
    del file["samples"]
    file["samples"] = h5py.SoftLink("/time")


def elsewhere(file):
    del file["samples"]
    file["samples"] = h5py.ExternalLink("other.h5", "/samples")


def empty(file):
    file["time"].attrs["x"] = 1
    replaced(file, "samples", shape=(10**9, 3, 5), maxshape=(None, 3, 5), chunks=(256, 3, 5))


def lzf(file):
    replaced(file, "samples", chunks=(40, 3, 5), compression="lzf")


def huge_piece(file):
    replaced(file, "samples", shape=(40, 3, 5), maxshape=(None, 3, 5), chunks=(2**24, 3, 5))


def named_type(file):
    file["kind_of_number"] = np.dtype("f8")


HOSTILE = {
    external: "in another file",
    virtual: "a virtual dataset, '/samples'",
    soft: "a soft link, '/samples'",
    elsewhere: "a link to another file, '/samples'",
    empty: "'/samples' of 120000000000 bytes, of which 0 are stored",
    lzf: "only shuffle, deflate and Fletcher-32",
    huge_piece: "chunks of 2013265920 bytes",
    named_type: "a named type",
}


@pytest.mark.parametrize("edit", HOSTILE, ids=lambda edit: edit.__name__)
def test_unsafe_content_is_refused(edit, path):
    edited(path, edit)
    for reader in (open_take, load_calibration, load_pressure):
        with pytest.raises(BrokenFileError) as told:
            reader(path)
        assert str(told.value).startswith(f"{path}: expected a plain HDF5 file, got ")
        assert HOSTILE[edit] in str(told.value)


@pytest.mark.parametrize("edit", HOSTILE, ids=lambda edit: edit.__name__)
def test_the_same_goes_for_files_of_matlab(edit, path, tmp_path):
    edited(path, edit)
    header = b"MATLAB 7.3 MAT-file".ljust(124, b" ") + b"\x00\x02IM"
    (tmp_path / "a.mat").write_bytes(header.ljust(512, b"\0") + path.read_bytes())
    with pytest.raises(MidairError) as told:
        load(tmp_path / "a.mat", rate=1000, unit="V")
    assert "expected a plain HDF5 file, got" in str(told.value)


def test_changes_by_other_programs_are_accepted(path, recording, alike):
    """Copies with shuffle and gzip, additional groups and datasets, a second name for an object."""

    def packed(file):
        samples = file["samples"][()]
        replaced(file, "samples", chunks=(16, 3, 5), compression="gzip", shuffle=True, fletcher32=True)
        file["samples"][...] = samples
        file["notes/deep"] = np.arange(3)
        file["again"] = file["samples"]
        file["notes/up"] = file["/"]

    edited(path, packed)
    alike(load(path), recording)


@pytest.mark.long
def test_deflate_may_not_expand_without_end(path):
    def bomb(file):
        shape = (2**18 + 1, 8, 8)
        replaced(file, "samples", shape=shape, chunks=(2**14, 8, 8), compression="gzip", fillvalue=0)
        file["samples"][...] = np.zeros(shape)

    edited(path, bomb)
    assert path.stat().st_size < 2e6
    with pytest.raises(BrokenFileError, match="more than 100 times as many"):
        load(path)


def test_a_piece_that_expands_to_less_is_refused(path):
    """HDF5 itself would read memory beyond it."""

    def short(file):
        replaced(file, "samples", chunks=(40, 3, 5), compression="gzip")
        import zlib

        file["samples"].id.write_direct_chunk((0, 0, 0), zlib.compress(b"\0" * 100))

    edited(path, short)
    with pytest.raises(BrokenFileError, match="expands to 100 bytes instead of 4800"):
        load(path)


@pytest.mark.long
def test_the_inspector_needs_nothing_of_midair(path):
    """So that it starts quickly."""
    script = Path(inspection.__file__).with_name("inspector.py")
    code = (
        f"import sys; sys.argv = ['x']; exec(compile(open({str(script)!r}).read(), 'x', 'exec'), {{'__name__': 'x'}});"
    )
    code += "print([name for name in sys.modules if name.startswith('midair')])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
    assert refusal(path, openable) is None


@pytest.mark.skipif(shutil.which("flock") is None, reason="needs flock")
def test_a_lock_of_another_program_does_not_keep_readers_out(path, recording, alike):
    """A disk without locks returns the same error as a locked file; this was reported as 'a damaged file'."""
    with subprocess.Popen(["flock", path, "sleep", "30"]) as holder:
        try:
            alike(load(path), recording)
        finally:
            holder.terminate()


def test_drives_are_looked_at_too(tmp_path, solution):
    from midair.files import save_solution

    save_solution(solution, tmp_path / "a.drive.h5")

    def linked(file):
        del file["phase_change"]
        file["phase_change"] = h5py.ExternalLink("/dev/stdin", "/phase")

    edited(tmp_path / "a.drive.h5", linked)
    with pytest.raises(BrokenFileError, match="a link to another file, '/phase_change'"):
        load_solution(tmp_path / "a.drive.h5")


@pytest.mark.long
def test_a_missing_attribute_tree_does_not_end_this_process(tmp_path, solution):
    """Without a tree of attributes, and with 16398 at its root, HDF5 crashes on any name that is looked up."""
    from midair.files import save_solution

    path = tmp_path / "a.drive.h5"
    save_solution(solution, path)
    data = bytearray(path.read_bytes())
    tree = data.index(b"BTHD")
    # File Format Specification 3.0, III.A.2: bytes of a record; records of the root, and of all.
    data[tree + 10 : tree + 12] = struct.pack("<H", 0x0911)
    data[tree + 24 : tree + 34] = struct.pack("<HQ", 0x400E, 0)
    data[tree + 34 : tree + 38] = struct.pack("<I", checksum(bytes(data[tree : tree + 34])))
    path.write_bytes(data)
    code = f"from midair.cli import run; print(run(['info', {str(path)!r}]))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "1\n")
    assert "damaged" in done.stderr


def test_a_file_that_was_cut_off_is_refused_without_names_of_hdf5_s_own_variables(path):
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    said = refusal(path, str)
    assert said == f"a damaged or foreign file (truncated: {len(whole) // 2} bytes of {len(whole)})"
