import h5py
import pytest

from midair import __version__
from midair.errors import BrokenFileError
from midair.files import RecordingWriter, contents, save, save_calibration, save_solution


def test_lists_the_parts_of_a_recording(recording, calibration, tmp_path):
    save(recording, tmp_path / "a.h5", calibration=calibration)
    seen = contents(tmp_path / "a.h5")
    assert (seen.kind, seen.frames, seen.finished, seen.parts) == ("recording", 40, True, ("calibration",))
    assert seen.created_by == f"midair {__version__}"
    assert seen.created.endswith("+00:00")


def test_recognises_drives_and_calibrations(solution, target, calibration, tmp_path):
    save_solution(solution, tmp_path / "a.drive.h5", target=target)
    save_calibration(calibration, tmp_path / "a.calibration.h5")
    drive, bench = contents(tmp_path / "a.drive.h5"), contents(tmp_path / "a.calibration.h5")
    assert (drive.kind, drive.frames, drive.parts) == ("drive", 4, ("target",))
    assert (bench.kind, bench.frames, bench.parts) == ("calibration", None, ())


def test_recognises_a_running_recording(recording, tmp_path):
    options = {"rate": 1000, "sensor": recording.sensor, "unit": "V", "provenance": recording.provenance}
    with RecordingWriter(tmp_path / "a.h5", **options):
        assert not contents(tmp_path / "a.h5").finished
    assert contents(tmp_path / "a.h5").finished


def test_refuses_files_of_others(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["x"] = [1, 2]
    with pytest.raises(BrokenFileError, match="an HDF5 file of another program"):
        contents(tmp_path / "a.h5")
