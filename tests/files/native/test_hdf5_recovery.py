import h5py
import numpy as np
import pytest

from midair.files import RecordingWriter, load, save
from midair.files.native.hdf5_recovery import checksum, closed_file, closed_image, is_unclosed


def test_checksum_is_lookup3():
    """The number printed by the author of lookup3 for this text and initial value 0."""
    assert checksum(b"Four score and seven years ago") == 0x17770551


def test_checksum_is_that_of_hdf5(recording, tmp_path):
    for name, frames in (("a", 1), ("b", 7), ("c", 40)):
        path = tmp_path / f"{name}.h5"
        save(type(recording)(samples=recording.samples[:frames], rate=1, sensor=recording.sensor), path)
        block = path.read_bytes()[:48]
        assert checksum(block[:44]) == int.from_bytes(block[44:], "little")


def test_a_damaged_superblock_is_not_taken_for_an_unclosed_one(recording, tmp_path):
    path = tmp_path / "a.h5"
    save(recording, path)
    data = bytearray(path.read_bytes())
    data[11] = 5
    path.write_bytes(data)
    assert not is_unclosed(path)
    with pytest.raises(OSError, match="expected"):
        load(path)


@pytest.mark.parametrize("large", [0, 10**9], ids=["the file itself", "a copy"])
def test_an_unclosed_file_is_read_in_place_when_it_is_large(large, recording, tmp_path):
    path = tmp_path / "live.h5"
    with RecordingWriter(
        path, rate=1000, sensor=recording.sensor, unit="V", provenance=recording.provenance, interval=1e-9
    ) as writer:
        writer.append(recording.samples)
        assert is_unclosed(path)
        before = path.read_bytes()
        with closed_file(path, large=large) as source:
            with h5py.File(source, "r") as file:
                np.testing.assert_array_equal(file["samples"], recording.samples)
            source.seek(0)
            whole = bytearray(len(before))
            assert source.readinto(whole) == len(before)
            assert bytes(whole) == closed_image(path)
        assert path.read_bytes() == before
    assert not is_unclosed(path)
