import hashlib
import os
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest
from tests.drives import log as entries

from midair.devices import ExposureChoices, VirtualArray, check_exposure, make_state_folder, state_folder
from midair.devices.safety.play_log import close_orders, log_end, log_order
from midair.errors import ExposureError, FileError
from midair.files import profile_named
from midair.model import Drive, Medium, TransducerArray
from midair.physics import focus_phase
from midair.version import __version__

REPORT = {"frames": 3, "duration": 0.003, "late": 1, "gap": 0.002, "start": 5, "silencer": "off"}
ARRAY = TransducerArray.autd3(columns=1, rows=1)
PROFILE = profile_named("occupational-110")


def admitted(level, **choices):
    phase = np.tile(focus_phase(ARRAY, np.array([0, 0, 0.2])), (3, 1))
    drive = Drive(phase=phase, level=np.full(3, level), rate=1000.0, array=ARRAY)
    exposure = ExposureChoices(**({"profile": PROFILE} | choices))
    return check_exposure(drive, VirtualArray(ARRAY), exposure, repeats=2)


def test_each_end_is_a_separate_line_that_others_cannot_read():
    log_end("one", "x.drive.h5", "autd3", "stopped", "KeyboardInterrupt", report=REPORT)
    log_end("two", "y.drive.h5", "autd3", "played")
    first, second = entries()
    assert (first["event"], first["order"], first["drive"], first["device"]) == ("end", "one", "x.drive.h5", "autd3")
    assert (first["outcome"], first["reason"]) == ("stopped", "KeyboardInterrupt")
    names = ("frames", "duration_s", "late", "gap_s", "start_ns", "silencer")
    assert [first[name] for name in names] == [3, 0.003, 1, 0.002, 5, "off"]
    assert not set(names) & set(second), "broken off"
    assert (second["drive"], second["outcome"], second["reason"]) == ("y.drive.h5", "played", "played")
    assert first["time"] <= second["time"]
    assert (state_folder() / "played.jsonl").stat().st_mode & 0o077 == 0


def test_a_log_that_cannot_be_written_is_an_error(tmp_path, monkeypatch):
    (tmp_path / "played.jsonl").mkdir()
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path))
    with pytest.raises(FileError, match="nothing plays without a log"):
        log_end("one", "x.drive.h5", "autd3", "played")


def test_a_disk_that_takes_half_a_line_takes_none():
    """Otherwise half of an entry would stay in the log, followed by the next line."""
    resource = pytest.importorskip("resource")
    log_end("one", "x.drive.h5", "autd3", "played")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, ((state_folder() / "played.jsonl").stat().st_size + 20, hard))
    try:
        with pytest.raises(FileError, match="No space left on device; nothing plays without a log"):
            log_end("two", "x.drive.h5", "autd3", "played")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    log_end("three", "x.drive.h5", "autd3", "played")
    assert [entry["order"] for entry in entries()] == ["one", "three"]


def test_an_order_has_the_level_the_responsible_person_and_the_stated_air():
    one = log_order("x.drive.h5", "autd3", admitted(1.0, override=" A Person "))
    two = log_order("y.drive.h5", "autd3", admitted(0.01), room=Medium.at(temperature=18.5, humidity=0.3))
    first, second = entries()
    assert (first["order"], second["order"]) == (one, two)
    assert one != two
    assert (first["override_by"], first["exposure"], first["repeats"]) == ("A Person", "overridden", 2)
    assert first["places"]["left ear"]["peak_db"] > 110
    assert (second["override_by"], second["exposure"]) == ("", "kept")
    assert [first["room"], second["room"]] == [None, {"temperature_c": 18.5, "humidity": 0.3}]


def test_an_order_can_be_audited(tmp_path, monkeypatch):
    monkeypatch.setenv("LOGNAME", "a-user")
    monkeypatch.setattr("sys.argv", ["/usr/bin/midair", "play", "x.drive.h5"])
    path, clearance = tmp_path / "x.drive.h5", admitted(0.01)
    path.write_bytes(b"what the file holds")
    log_order(path, "autd3:eth0", clearance, simulated=True)
    (entry,) = entries()
    assert (entry["version"], entry["user"], entry["process"]) == (__version__, "a-user", os.getpid())
    assert entry["command"] == "midair play x.drive.h5"
    assert (entry["device"], entry["simulated"], entry["frames"], entry["rate_hz"]) == ("autd3:eth0", True, 3, 1000.0)
    assert entry["file_sha256"] == hashlib.sha256(b"what the file holds").hexdigest()
    drive = clearance.drive
    assert entry["sha256"] == hashlib.sha256(drive.phase.tobytes() + drive.level.tobytes()).hexdigest()
    assert entry["profile"] == "occupational-110"
    limits = {place.name: (place.limit, place.enforced) for place in PROFILE.places}
    assert {name: (one["limit_db"], one["enforced"]) for name, one in entry["places"].items()} == limits


def test_a_day_has_no_more_hours_of_sound_than_the_profile():
    def order(participant="", **choices):
        clearance = admitted(0.001, profile=replace(PROFILE, hours=2e-6), **choices)
        number = log_order("x.drive.h5", "autd3", clearance, participant=participant)
        time.sleep(0.01)
        log_end(number, "x.drive.h5", "autd3", "played")

    assert PROFILE.hours == 4
    order("P1")
    with pytest.raises(ExposureError, match=r"at most 2e-06 h of sound a day for P1, got .* today and 1.67e-06 h more"):
        order("P1")
    order("P2")
    order("P1", override="A. Person")
    assert entries()[-2]["override_by"] == "A. Person"
    with pytest.raises(ExposureError, match="for P2"):
        order("P2")
    # The end states a shorter time of sound, as of an order whose drive was triggered now and then.
    number = log_order("x.drive.h5", "autd3", admitted(0.001), participant="P3")
    time.sleep(0.02)
    log_end(number, "x.drive.h5", "autd3", "played", report={"duration": 1e-4})
    order("P3")
    order()
    with pytest.raises(ExposureError, match="for people not named"):
        order()


def test_a_profile_that_was_edited_has_another_hash_and_an_infinite_level_is_null():
    lax = replace(PROFILE, places=(replace(PROFILE.places[0], limit=150.0), *PROFILE.places[1:]))
    drive = admitted(0.01).drive
    advice = replace(PROFILE, places=tuple(replace(place, enforced=False) for place in PROFILE.places))
    for profile in (PROFILE, lax, PROFILE, advice):
        log_order("x", "autd3", check_exposure(drive, VirtualArray(ARRAY), ExposureChoices(profile=profile)))
    first, second, third, fourth = (entry["profile_sha256"] for entry in entries())
    assert first == third not in (second, fourth)
    assert len(first) == 64
    assert [entry["excess_db"] is None for entry in entries()] == [False, False, False, True]


def test_nothing_is_ordered_without_a_log(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "file" / "state"))
    with pytest.raises(FileError, match="MIDAIR_STATE"):
        log_order("x.drive.h5", "autd3", admitted(0.01))


def test_a_symbolic_link_is_not_appended_to(tmp_path):
    mine = tmp_path / "mine"
    mine.write_text("precious", encoding="utf-8")
    (make_state_folder() / "played.jsonl").symlink_to(mine)
    with pytest.raises(FileError, match="expected a file, got a symbolic link"):
        log_end("one", "x", "autd3", "played")
    assert mine.read_text(encoding="utf-8") == "precious"


PLAYER = """
import time
import numpy as np
from midair.devices import ExposureChoices, VirtualArray, check_exposure
from midair.devices.safety.play_log import log_order
from midair.devices.safety.stop_channel import open_stop_channel
from midair.files import profile_named
from midair.model import Drive, TransducerArray
array = TransducerArray.autd3()
still = np.zeros((3, array.count))
drive = Drive(phase=still, level=np.full(3, 0.01), rate=1000.0, array=array)
with open_stop_channel("autd3", lambda: None):
    clearance = check_exposure(drive, VirtualArray(array), ExposureChoices(profile=profile_named("occupational-110")))
    print(log_order("x.drive.h5", "autd3", clearance), flush=True)
    time.sleep(60)
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="without locks no program counts as dead")
def test_the_order_of_a_killed_program_is_closed_by_the_next_one():
    with subprocess.Popen([sys.executable, "-c", PLAYER], stdout=subprocess.PIPE, text=True) as player:
        order = player.stdout.readline().strip()
        close_orders()
        assert [entry["event"] for entry in entries()] == ["play"]
        player.kill()
    log_order("y.drive.h5", "autd3", admitted(0.01))
    close_orders()
    begun, closed, mine = entries()
    assert (closed["event"], closed["order"], closed["outcome"]) == ("end", order, "failed")
    assert (closed["drive"], closed["device"]) == ("x.drive.h5", "autd3")
    assert closed["reason"] == f"ended without a report: process {player.pid} died after {begun['time']}"
    assert mine["event"] == "play"


def test_lines_that_are_no_entries_leave_the_log_usable():
    log_end("one", "x", "autd3", "played")
    with (state_folder() / "played.jsonl").open("a", encoding="utf-8") as file:
        file.write("{\n[]\n3\n")
    close_orders()
