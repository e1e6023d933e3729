import struct

import h5py
import numpy as np
import pytest
from scipy.io import loadmat, savemat

from midair.errors import BrokenFileError, MismatchError
from midair.files import load, open_take, save
from midair.model import SensorGrid

RNG = np.random.default_rng(0)


def test_reads_big_endian_and_short_elements(tmp_path):
    """A 1 x 2 double array whose numbers are stored as int16 in the tag, as MATLAB packs small whole numbers."""
    flags = struct.pack(">IIII", 6, 8, 6, 0)
    shape = struct.pack(">IIii", 5, 8, 1, 2)
    name = struct.pack(">HH", 1, 1) + b"x\0\0\0"
    numbers = struct.pack(">HHhh", 4, 3, 7, -9)
    body = flags + shape + name + numbers
    head = b"MATLAB 5.0".ljust(124) + b"\x01\x00MI"
    (tmp_path / "a.mat").write_bytes(head + struct.pack(">II", 14, len(body)) + body)
    assert load(tmp_path / "a.mat", rate=1, unit="V").samples.ravel().tolist() == [7.0, -9.0]


SAID = {"rate": 1000.0, "unit": "V"}


def test_reads_mat_of_version_73(tmp_path):
    """MATLAB writes v7.3 as HDF5 behind 512 bytes of its own, with the axes in reverse."""
    data = np.random.default_rng(0).normal(size=(6, 2, 3))
    with h5py.File(tmp_path / "a.mat", "w", userblock_size=512) as file:
        file["x"] = data.T
    with (tmp_path / "a.mat").open("rb+") as file:
        file.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(512))
    seen = open_take(tmp_path / "a.mat", **SAID)
    np.testing.assert_array_equal(seen.recording.samples, data)
    assert seen.recording.provenance.steps[0].settings["format"] == "MAT v7.3"


def test_reads_mat_of_version_4(tmp_path):
    savemat(tmp_path / "a.mat", {"x": np.arange(32.0).reshape(2, 16)}, format="4")
    assert load(tmp_path / "a.mat", **SAID).frames == 2


@pytest.mark.parametrize("start", [b"not a MATLAB file", b"\x01\x02\x03\x04" * 40], ids=["text", "bytes"])
def test_scipy_never_reads_other_files(start, tmp_path):
    (tmp_path / "a.mat").write_bytes(start)
    with pytest.raises(BrokenFileError, match="expected a MATLAB file, got one that begins with"):
        load(tmp_path / "a.mat", **SAID)


def write(path, arrays):
    if path.suffix == ".npz":
        np.savez(path, **arrays)
    else:
        savemat(path, arrays)
    return path


each = pytest.mark.parametrize("ending", [".npz", ".mat"])


@each
def test_other_programs_read_samples_rate_and_unit(ending, recording, tmp_path):
    path = tmp_path / f"a{ending}"
    save(recording, path)
    arrays = np.load(path) if ending == ".npz" else loadmat(path)
    np.testing.assert_array_equal(arrays["samples"], recording.samples)
    assert arrays["rate"].item() == recording.rate
    assert arrays["unit"].item() == "Pa"


@each
def test_reads_frames_and_channels(ending, tmp_path):
    data = np.arange(32).reshape(2, 16)
    seen = open_take(write(tmp_path / f"a{ending}", {"data": data}), **SAID)
    np.testing.assert_array_equal(seen.recording.samples, data.reshape(2, 4, 4))
    assert "4 x 4" in seen.report[0]
    assert seen.recording.provenance.steps[0].settings["array"] == "data"


@each
def test_reads_frames_rows_and_columns(ending, tmp_path):
    data = np.random.default_rng(0).normal(size=(5, 2, 3))
    seen = open_take(write(tmp_path / f"a{ending}", {"data": data, "scale": 3.0}), **SAID)
    np.testing.assert_array_equal(seen.recording.samples, data)
    assert seen.recording.sensor == SensorGrid(rows=2, columns=3)
    assert "pitch" in seen.report[0]


@each
def test_takes_samples_among_several(ending, tmp_path):
    data = np.ones((3, 2, 2))
    path = write(tmp_path / f"a{ending}", {"samples": data, "noise": np.zeros((3, 2, 2))})
    np.testing.assert_array_equal(load(path, **SAID).samples, data)


@each
@pytest.mark.parametrize(
    "arrays",
    [{"a": np.ones((3, 4)), "b": np.ones((3, 4))}, {"a": np.array("text")}, {"a": np.ones((2, 2), complex)}],
    ids=["two", "text", "complex"],
)
def test_refuses_ambiguous_arrays(ending, arrays, tmp_path):
    with pytest.raises(BrokenFileError, match="expected one array of numbers"):
        load(write(tmp_path / f"a{ending}", arrays), **SAID)


@each
def test_refuses_a_rate_that_was_edited(ending, recording, tmp_path):
    path = tmp_path / f"a{ending}"
    save(recording, path)
    arrays = dict(np.load(path) if ending == ".npz" else loadmat(path))
    arrays = {name: value for name, value in arrays.items() if not name.startswith("__")}
    with pytest.raises(BrokenFileError, match="rate was edited"):
        load(write(path, {**arrays, "rate": 5.0}))


@each
def test_takes_the_array_that_is_named(ending, tmp_path):
    path = write(tmp_path / f"a{ending}", {"a": np.ones((3, 4)), "b": np.zeros((3, 4))})
    assert load(path, **SAID, field="b", channels=["1"]).samples.max() == 0
    with pytest.raises(MismatchError, match="called 'c'"):
        load(path, **SAID, field="c")
