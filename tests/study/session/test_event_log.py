import hashlib
import json
import os
import sys

import pytest

from midair.errors import BrokenFileError, DeviceStateError, MissingFileError
from midair.study.session.event_log import EventLog, chain_hash, read_events

FIRST, SECOND = {"event": "begin", "who": "ä"}, {"event": "answer", "n": 1}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "sub-01" / "events.jsonl"


def test_appended_events_are_read_in_order(path):
    with EventLog(path) as log:
        log.append(FIRST)
        assert read_events(path) == [FIRST]  # on disk before append returns
        log.append(SECOND)
    with EventLog(path) as log:
        log.append(FIRST)
    assert read_events(path) == [FIRST, SECOND, FIRST]


def test_a_torn_line_was_never_acknowledged(path):
    with EventLog(path) as log:
        log.append(FIRST)
    with path.open("ab") as file:
        file.write(b'{"event": "ans')
    assert read_events(path) == [FIRST]
    with EventLog(path) as log:
        log.append(SECOND)
    assert read_events(path) == [FIRST, {"event": "repair", "torn": '{"event": "ans'}, SECOND]


@pytest.mark.parametrize(
    ("line", "message"), [(b"{]", "damage in line 2"), (b"[1]", "in line 2"), (b"{}", "in line 2")]
)
def test_damage_before_the_last_line_is_an_error(path, line, message):
    with EventLog(path) as log:
        log.append(FIRST)
    with path.open("ab") as file:
        file.write(line + b"\n" + json.dumps(SECOND).encode() + b"\n")
    before = path.read_bytes()
    with pytest.raises(BrokenFileError, match=message):
        read_events(path)
    with pytest.raises(BrokenFileError, match=message), EventLog(path):
        pass
    assert path.read_bytes() == before


@pytest.mark.skipif(os.name == "nt", reason="locks of POSIX")
def test_one_program_at_a_time(path):
    with EventLog(path), pytest.raises(DeviceStateError, match="another program"), EventLog(path):
        pass
    with EventLog(path) as log:  # the lock went with the block
        log.append(FIRST)


def test_a_closed_log_refuses_events(path):
    log = EventLog(path)
    with pytest.raises(DeviceStateError, match="open log"):
        log.append(FIRST)
    with log:
        log.append(FIRST)
    with pytest.raises(DeviceStateError, match="open log"):
        log.append(SECOND)
    assert read_events(path) == [FIRST]


def test_a_missing_log_is_an_error(path):
    with pytest.raises(MissingFileError, match="run the session first"):
        read_events(path)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such modes")
def test_logs_are_readable_by_their_owner_only(tmp_path):
    with EventLog(tmp_path / "sub-01.jsonl") as log:
        log.append({"event": "answer"})
    assert (tmp_path / "sub-01.jsonl").stat().st_mode & 0o777 == 0o600


def changed(lines, how):
    match how:
        case "an answer":
            return [line.replace(b'"n": 1', b'"n": 2') for line in lines]
        case "a space":
            return [lines[0].replace(b": ", b":  ", 1), *lines[1:]]
        case "one line gone":
            return lines[1:]
        case "two lines swapped":
            return [lines[1], lines[0], *lines[2:]]
        case "one line twice":
            return [lines[0], lines[0], *lines[1:]]
        case "a link gone":
            return [*lines[:-1], lines[-1].partition(b', "chain"')[0] + b"}"]
    raise AssertionError(how)


@pytest.mark.parametrize(
    "how", ["an answer", "a space", "one line gone", "two lines swapped", "one line twice", "a link gone"]
)
def test_an_edited_log_is_an_error(path, how):
    with EventLog(path) as log:
        for event in (FIRST, SECOND, FIRST):
            log.append(event)
    lines = path.read_bytes().splitlines()
    path.write_bytes(b"\n".join(changed(lines, how)) + b"\n")
    with pytest.raises(BrokenFileError, match=r"events\.jsonl: expected an unbroken chain .* line \d: .* changed"):
        read_events(path)


def test_chain_hashes_are_sha256_of_all_bytes(path):
    with EventLog(path) as log:
        for event in (FIRST, SECOND):
            log.append(event)
        assert log.seal == chain_hash(path)
    first, second = path.read_bytes().splitlines(keepends=True)
    body = b'{"event": "answer", "n": 1}'
    link = hashlib.sha256(first + body).hexdigest()[:32]
    assert second == body[:-1] + b', "chain": "' + link.encode() + b'"}\n'
    assert chain_hash(path) == link


def test_a_rewritten_log_has_another_seal(path, tmp_path):
    for name, events in (("a", (FIRST, SECOND)), ("b", (FIRST, SECOND | {"n": 2}))):
        with EventLog(tmp_path / name) as log:
            for event in events:
                log.append(event)
    read_events(tmp_path / "b")  # the chain holds
    assert chain_hash(tmp_path / "a") != chain_hash(tmp_path / "b")


def test_logs_without_chain_are_read_and_covered_by_later_lines(path):
    path.parent.mkdir()
    path.write_text(json.dumps(FIRST) + "\n" + json.dumps(SECOND) + "\n")
    with EventLog(path) as log:
        log.append(SECOND)
    assert read_events(path) == [FIRST, SECOND, SECOND]
    path.write_bytes(path.read_bytes().replace(b'"n": 1', b'"n": 2', 1))
    with pytest.raises(BrokenFileError, match="break in line 3"):
        read_events(path)
