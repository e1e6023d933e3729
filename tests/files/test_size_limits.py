import io
import zipfile

import numpy as np
import pytest

from midair.errors import BrokenFileError
from midair.files import check_memory_for, open_take, save
from midair.files.size_limits import EXPANDED_ANYWAY
from midair.model import Recording, SensorGrid

GIVEN = {"rate": 1000, "unit": "V", "sensor": SensorGrid(rows=1, columns=2)}


@pytest.mark.long
def test_a_bomb_of_numpy(tmp_path):
    rows = EXPANDED_ANYWAY // 16 + 1
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        head = io.BytesIO()
        np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (rows, 2)})
        archive.writestr("x.npy", head.getvalue() + bytes(16 * rows))
    with pytest.raises(BrokenFileError, match="write it without compression"):
        open_take(tmp_path / "a.npz", **GIVEN)


@pytest.mark.parametrize("ending", [".mat", ".npz", ".h5"])
def test_silence_is_no_bomb(ending, tmp_path):
    """Half a second of 16 channels at 48 kHz, all zero."""
    silent = Recording(samples=np.zeros((24_000, 4, 4)), rate=48_000.0, sensor=SensorGrid(), unit="V")
    save(silent, tmp_path / f"a{ending}")
    np.testing.assert_array_equal(open_take(tmp_path / f"a{ending}").recording.samples, silent.samples)


def test_an_unknown_amount_of_memory_is_no_error(monkeypatch):
    monkeypatch.setattr("midair.ram.available_memory", lambda: None)
    check_memory_for(1e18, "a.csv", "cut it")
