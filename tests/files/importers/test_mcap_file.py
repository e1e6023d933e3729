"""MCAP: written by the makers' library, read here."""

import struct

import numpy as np
import pytest

from midair.errors import BrokenFileError, MismatchError
from midair.files import load, open_take


@pytest.fixture
def samples():
    return np.random.default_rng(3).normal(size=(50, 4, 4))


@pytest.fixture
def file(tmp_path):
    def write(data):
        (tmp_path / "a.mcap").write_bytes(data)
        return tmp_path / "a.mcap"

    return write


@pytest.mark.parametrize("compress", [True, False])
def test_reads_rows_and_columns_in_json(compress, mcap, samples, file):
    messages = [{"seq": i, "data": frame.tolist()} for i, frame in enumerate(samples)]
    seen = open_take(file(mcap({"/skin": messages}, compress=compress)), unit="V")
    np.testing.assert_array_equal(seen.recording.samples, samples)
    assert seen.recording.rate == pytest.approx(1000, rel=1e-6)
    assert seen.recording.provenance.notes["topic"] == "/skin"


def test_reads_numbers_by_name(mcap, samples, file):
    messages = [{"x": frame[0, 0], "y": frame[0, 1], "ok": True} for frame in samples]
    recording = load(file(mcap({"/imu": messages})), unit="V", channels=["y"])
    np.testing.assert_array_equal(recording.samples.ravel(), samples[:, 0, 1])


def cdr(numbers, dtype, labels=()):
    """A MultiArray in CDR, built by hand: byte order, axes, data_offset, numbers."""
    parts = b""

    def pad(size):
        return b"\0" * (-len(parts) % size)

    parts += struct.pack("<I", len(labels))
    for label in labels:
        encoded = label.encode() + b"\0"
        parts += pad(4) + struct.pack("<I", len(encoded)) + encoded
        parts += pad(4) + struct.pack("<II", 4, 4)
    parts += pad(4) + struct.pack("<II", 0, len(numbers))
    parts += pad(np.dtype(dtype).itemsize) + np.asarray(numbers, dtype).tobytes()
    return b"\x00\x01\x00\x00" + parts


@pytest.mark.parametrize(("name", "dtype"), [("Float32", "<f4"), ("Float64", "<f8"), ("Int16", "<i2"), ("UInt8", "u1")])
@pytest.mark.parametrize("labels", [(), ("row", "columns")])
def test_reads_multiarrays_of_ros(name, dtype, labels, mcap, samples, file):
    numbers = (np.abs(samples) * 10).astype(dtype)
    messages = [cdr(frame.ravel(), dtype, labels) for frame in numbers]
    data = mcap({"/skin": messages}, encoding="cdr", schema=f"std_msgs/msg/{name}MultiArray")
    np.testing.assert_array_equal(load(file(data), unit="count").samples, numbers)


def test_several_topics_need_a_name(mcap, samples, file):
    frames = [frame.tolist() for frame in samples]
    data = mcap({"/skin": frames, "/arm": frames})
    with pytest.raises(BrokenFileError, match=r"expected one topic.*/skin \(50\), /arm \(50\)"):
        load(file(data), unit="V")
    assert load(file(data), unit="V", stream="/arm").frames == 50
    with pytest.raises(MismatchError, match="expected a topic '/leg'"):
        load(file(data), unit="V", stream="/leg")


def test_a_killed_recorder_leaves_complete_records(mcap, samples, file):
    data = mcap({"/skin": [frame.tolist() for frame in samples]}, chunk_size=2000)
    assert "not closed" not in " ".join(open_take(file(data), unit="V").report)
    for kept in (len(data) // 2, len(data) - 20):
        seen = open_take(file(data[:kept]), unit="V")
        assert seen.report[0] == "The file was not closed: complete records were read."
        np.testing.assert_array_equal(seen.recording.samples, samples[: seen.recording.frames])
        assert 5 < seen.recording.frames <= 50
    assert seen.recording.frames == 50


def test_refuses_a_chunk_whose_checksum_is_wrong(mcap, samples, file):
    data = bytearray(mcap({"/skin": [frame.tolist() for frame in samples]}, compress=False))
    data[data.index(b"[[") + 2] ^= 1
    with pytest.raises(BrokenFileError, match="crc validation failed"):
        load(file(bytes(data)), unit="V")


@pytest.mark.parametrize(
    ("messages", "found"),
    [
        ([{"a": [1, 2], "b": [3]}] * 3, "got a, b"),
        ([{"name": "x"}] * 3, "got name"),
        ([[1, 2], [1, 2, 3], [1, 2]], r"got \(2,\), \(3,\)"),
        ([3, 4, 5], "got int"),
    ],
)
def test_refuses_messages_that_are_not_frames(messages, found, mcap, file):
    with pytest.raises(BrokenFileError, match=found):
        load(file(mcap({"/skin": messages})), unit="V")


def test_refuses_a_block_of_zeros_at_its_first_byte(mcap, samples, file):
    data = mcap({"/skin": [frame.tolist() for frame in samples]}, compress=False)
    with pytest.raises(BrokenFileError, match=r"zeros in place of a record at byte 8$"):
        load(file(data[:8] + bytes(900_000) + data[-8:]), unit="V")
