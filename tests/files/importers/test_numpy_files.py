import numpy as np
import pytest

from midair.errors import BrokenFileError, NonFiniteError
from midair.files import load

SAID = {"rate": 1000.0, "unit": "V"}


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("kind", ["f8", ">f4", "i2"])
@pytest.mark.parametrize("shape", [(5, 16), (5, 4, 4)])
def test_reads_arrays_saved_by_numpy(order, kind, shape, tmp_path):
    samples = np.arange(80).reshape(shape).astype(kind, order=order)
    np.save(tmp_path / "a.npy", samples)
    np.testing.assert_array_equal(load(tmp_path / "a.npy", **SAID).samples, samples.reshape(5, 4, 4))


def test_loads_no_objects(tmp_path):
    objects = np.array([[{}], [{}]], object)
    np.save(tmp_path / "a.npy", objects, allow_pickle=True)
    np.savez(tmp_path / "a.npz", samples=objects)
    for name in ("a.npy", "a.npz"):
        with pytest.raises(BrokenFileError, match=name[2:].upper()):
            load(tmp_path / name, **SAID)


def test_a_header_larger_than_the_file_allocates_no_memory(tmp_path):
    with (tmp_path / "a.npy").open("wb") as file:
        header = {"descr": "<f8", "fortran_order": False, "shape": (10**12, 16)}
        np.lib.format.write_array_header_1_0(file, header)
        file.write(bytes(800))
    with pytest.raises(BrokenFileError, match="length is greater than file size"):
        load(tmp_path / "a.npy", **SAID)


def test_truncated_files_and_non_finite_numbers_are_refused(tmp_path):
    np.save(tmp_path / "a.npy", np.full((5, 16), np.nan))
    with pytest.raises(NonFiniteError, match="midair import --mend"):
        load(tmp_path / "a.npy", **SAID)
    data = (tmp_path / "a.npy").read_bytes()
    for kept in (3, 40, 200, len(data) - 1):
        (tmp_path / "b.npy").write_bytes(data[:kept])
        with pytest.raises(BrokenFileError):
            load(tmp_path / "b.npy", **SAID)


def test_times_of_numpy_are_stamps(tmp_path):
    """They were "a damaged or foreign file"."""
    times = np.datetime64("2026-01-01") + (1000 * np.arange(400)).astype("timedelta64[us]")
    np.savez(tmp_path / "a.npz", time=times, x=np.arange(400.0))
    assert load(tmp_path / "a.npz", unit="V").rate == 1000
