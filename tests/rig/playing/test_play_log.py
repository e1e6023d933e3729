"""What the log holds of how playing ended, and that nothing goes on without one."""

import json

import pytest

from midair.devices import PlayReport
from midair.errors import FileError
from midair.rig.playing.play_log import log_end

REPORT = PlayReport(frames=3, duration=0.003, late=1, gap=0.002, start=5)


@pytest.mark.parametrize("report", [REPORT, None], ids=["played", "broken off"])
def test_each_end_is_a_line_of_its_own(report):
    path = log_end("x.drive.h5", "autd3", report, "KeyboardInterrupt")
    assert log_end("y.drive.h5", "autd3", None, "played") == path
    first, second = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines())
    assert (first["event"], first["drive"], first["device"]) == ("end", "x.drive.h5", "autd3")
    assert first["reason"] == "KeyboardInterrupt"
    told = {key: first[key] for key in ("frames", "late", "gap_s", "start_ns") if key in first}
    assert told == ({"frames": 3, "late": 1, "gap_s": 0.002, "start_ns": 5} if report else {})
    assert second["drive"] == "y.drive.h5"
    assert first["time"] <= second["time"]


def test_a_log_that_cannot_be_written_is_told(tmp_path, monkeypatch):
    (tmp_path / "played.jsonl").mkdir()
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path))
    with pytest.raises(FileError, match="nothing plays without a log"):
        log_end("x.drive.h5", "autd3", None, "played")
