import h5py
import numpy as np
import pytest
from scipy.io import loadmat, savemat

from midair.errors import BrokenFileError
from midair.files import load, open_take, save

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
