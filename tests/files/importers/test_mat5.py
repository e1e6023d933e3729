"""MATLAB v5: agreement with SciPy on valid files, hand-made damaged ones."""

import struct

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from midair.errors import BrokenFileError
from midair.files import load
from midair.files.importers.mat5 import is_mat5, read_mat5

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
