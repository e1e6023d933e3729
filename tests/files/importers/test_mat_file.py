import struct

import h5py
import numpy as np
import pytest
from scipy.io import loadmat, savemat

from midair.errors import BrokenFileError
from midair.files import load, open_take, save
from midair.files.importers.mat_file import is_mat5, read_mat5

RNG = np.random.default_rng(0)
ARRAYS = {
    "f8": RNG.normal(size=(5, 3, 2)),
    "f4": RNG.normal(size=(4, 4)).astype("f4"),
    **{f"{dtype}": RNG.integers(0, 100, (3, 7)).astype(dtype) for dtype in ("i1", "u1", "i2", "u2", "i4", "u4", "i8")},
    "small": np.array([[1.0]]),
    "z": RNG.normal(size=(2, 2)) + 1j,
    "word": "towel",
    "a_struct": {"x": 1.0},
}


@pytest.mark.parametrize("compressed", [True, False])
def test_agrees_with_scipy(compressed, tmp_path):
    savemat(tmp_path / "a.mat", ARRAYS, do_compression=compressed)
    assert is_mat5((tmp_path / "a.mat").read_bytes()[:128])
    mine, theirs = read_mat5(tmp_path / "a.mat"), loadmat(tmp_path / "a.mat")
    assert set(mine) == set(ARRAYS)
    for name in ARRAYS:
        if name == "z":
            np.testing.assert_array_equal(mine[name].real, theirs[name].real)
        elif name != "a_struct":
            np.testing.assert_array_equal(mine[name], theirs[name])
            assert name == "word" or mine[name].dtype == theirs[name].dtype
    assert mine["a_struct"].size == 0


def test_reads_big_endian_and_short_elements(tmp_path):
    """A 1 x 2 double array whose numbers are stored as int16 in the tag, as MATLAB packs small whole numbers."""
    flags = struct.pack(">IIII", 6, 8, 6, 0)
    shape = struct.pack(">IIii", 5, 8, 1, 2)
    name = struct.pack(">HH", 1, 1) + b"x\0\0\0"
    numbers = struct.pack(">HHhh", 4, 3, 7, -9)
    body = flags + shape + name + numbers
    head = b"MATLAB 5.0".ljust(124) + b"\x01\x00MI"
    (tmp_path / "a.mat").write_bytes(head + struct.pack(">II", 14, len(body)) + body)
    array = read_mat5(tmp_path / "a.mat")["x"]
    assert array.dtype == np.float64
    assert array.tolist() == [[7.0, -9.0]]


@pytest.mark.parametrize("compressed", [True, False])
def test_refuses_truncated_files(compressed, tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"x": ARRAYS["f8"]}, do_compression=compressed)
    data = path.read_bytes()
    for kept in (140, len(data) // 2, len(data) - 3):
        path.write_bytes(data[:kept])
        with pytest.raises(BrokenFileError):
            load(path, rate=1, unit="V")


def test_the_checksum_of_a_compressed_array_is_verified(tmp_path):
    path = tmp_path / "a.mat"
    savemat(path, {"x": ARRAYS["f8"]}, do_compression=True)
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    with pytest.raises(BrokenFileError, match="incorrect data check"):
        load(path, rate=1, unit="V")


def test_elements_without_end_take_no_time(tmp_path):
    """32 MB of zeros are four million empty elements: 14 s."""
    path = tmp_path / "a.mat"
    path.write_bytes(b"MATLAB 5.0".ljust(124) + b"\x00\x01IM" + bytes(2**25))
    with pytest.raises(BrokenFileError, match="at most 10000 arrays"):
        read_mat5(path)


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


def test_scipy_reads_what_was_written(recording, tmp_path):
    save(recording, tmp_path / "a.mat")
    arrays = loadmat(tmp_path / "a.mat")
    np.testing.assert_array_equal(arrays["samples"], recording.samples)
    assert (arrays["rate"].item(), arrays["unit"].item()) == (recording.rate, recording.unit)


@pytest.mark.parametrize("start", [b"not a MATLAB file", b"\x01\x02\x03\x04" * 40], ids=["text", "bytes"])
def test_scipy_never_reads_other_files(start, tmp_path):
    (tmp_path / "a.mat").write_bytes(start)
    with pytest.raises(BrokenFileError, match="expected a MATLAB file, got one that begins with"):
        load(tmp_path / "a.mat", **SAID)


def test_a_dropped_calibration_is_reported(recording, calibration, tmp_path):
    assert [loss.what for loss in save(recording, tmp_path / "a.mat", calibration=calibration)] == ["calibration"]
