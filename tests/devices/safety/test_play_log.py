"""What the log holds of how playing ended, and that nothing goes on without one."""

import json

import numpy as np
import pytest

from midair.devices import ExposureChoices, PlayReport, VirtualArray, admit
from midair.devices.safety.play_log import log_end, log_order
from midair.errors import FileError
from midair.files import profile_named
from midair.model import Drive, TransducerArray
from midair.physics import focus_phase

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


ARRAY = TransducerArray.autd3()


def admitted(level, **choices):
    phase = np.tile(focus_phase(ARRAY, np.array([0, 0, 0.2])), (3, 1))
    drive = Drive(phase=phase, level=np.full(3, level), rate=1000.0, array=ARRAY)
    exposure = ExposureChoices(profile=profile_named("occupational-110"), **choices)
    return admit(drive, VirtualArray(ARRAY), exposure, repeats=2)


def test_an_order_says_how_loud_and_who_answers_for_it():
    path = log_order("x.drive.h5", "autd3", admitted(1.0, override=" A Person "))
    log_order("y.drive.h5", "autd3", admitted(0.01))
    first, second = (json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()[-2:])
    assert (first["override_by"], first["exposure"], first["repeats"]) == ("A Person", "overridden", 2)
    assert first["places"]["left ear"]["peak_db"] > 110
    assert (second["override_by"], second["exposure"]) == ("", "kept")


def test_nothing_is_ordered_without_a_log(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "file" / "state"))
    with pytest.raises(FileError, match="MIDAIR_STATE"):
        log_order("x.drive.h5", "autd3", admitted(0.01))
