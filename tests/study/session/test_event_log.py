import json
import os

import pytest

from midair.errors import BrokenFileError, DeviceStateError, MissingFileError
from midair.study.session.event_log import EventLog, read_events

FIRST, SECOND = {"event": "begin", "who": "ä"}, {"event": "answer", "n": 1}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "sub-01" / "events.jsonl"


def test_appended_events_are_read_in_order_and_by_their_owner_only(path):
    with EventLog(path) as log:
        log.append(FIRST)
        assert read_events(path) == [FIRST]  # on disk before append returns
        log.append(SECOND)
    with EventLog(path) as log:
        log.append(FIRST)
    assert read_events(path) == [FIRST, SECOND, FIRST]
    assert os.name == "nt" or path.stat().st_mode & 0o777 == 0o600


def test_a_torn_line_was_never_acknowledged(path):
    with EventLog(path) as log:
        log.append(FIRST)
    with path.open("ab") as file:
        file.write(b'{"event": "ans')
    assert read_events(path) == [FIRST]
    with EventLog(path) as log:
        log.append(SECOND)
    assert read_events(path) == [FIRST, {"event": "repair", "torn": '{"event": "ans'}, SECOND]


def test_damage_before_the_last_line_is_an_error(path):
    for line in (b"{]", b"[1]", b"{}"):
        path.unlink(missing_ok=True)
        with EventLog(path) as log:
            log.append(FIRST)
        path.write_bytes(path.read_bytes() + line + b"\n" + json.dumps(SECOND).encode() + b"\n")
        before = path.read_bytes()
        with pytest.raises(BrokenFileError, match="in line 2"):
            read_events(path)
        with pytest.raises(BrokenFileError, match="in line 2"), EventLog(path):
            pass
        assert path.read_bytes() == before


@pytest.mark.skipif(os.name == "nt", reason="locks of POSIX")
def test_one_program_at_a_time(path):
    with EventLog(path), pytest.raises(DeviceStateError, match="another program"), EventLog(path):
        pass
    with EventLog(path) as log:  # the lock went with the block
        log.append(FIRST)


def test_a_closed_and_a_missing_log_are_errors(path):
    with pytest.raises(MissingFileError, match="run the session first"):
        read_events(path)
    log = EventLog(path)
    with pytest.raises(DeviceStateError, match="open log"):
        log.append(FIRST)
    with log:
        log.append(FIRST)
    with pytest.raises(DeviceStateError, match="open log"):
        log.append(SECOND)
    assert read_events(path) == [FIRST]
