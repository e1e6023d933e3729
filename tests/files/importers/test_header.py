import json

import pytest

from midair.errors import BrokenFileError, UnknownFormatError
from midair.files.importers.header import header_of, parse_header, recording_from
from midair.files.native.schema import HEADER


def test_contains_exactly_the_entries_of_the_schema(recording):
    required = {entry.name for entry in HEADER if entry.required}
    assert set(json.loads(header_of(recording))) == required
    assert set(json.loads(header_of(recording, scale_exponent=3))) == {entry.name for entry in HEADER}


def test_is_one_line_of_ascii(recording):
    text = header_of(recording)
    assert text.isascii()
    assert text.isprintable()


def test_makes_the_recording_again(recording, alike, tmp_path):
    header = parse_header(header_of(recording), tmp_path)
    alike(recording_from(header, recording.samples.reshape(40, 15), tmp_path), recording)


def test_refuses_other_numbers_of_samples(recording, tmp_path):
    header = parse_header(header_of(recording), tmp_path)
    with pytest.raises(BrokenFileError, match="expected 40 frames of 15 channels, got 585 samples instead of 600"):
        recording_from(header, recording.samples[:39], tmp_path)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"kind": "speech"}, BrokenFileError, "header of a midair recording"),
        ({"format": 2}, UnknownFormatError, "update midair"),
        ({"format": "1"}, BrokenFileError, "whole number"),
    ],
)
def test_refuses_headers_of_others(change, error, message, recording, tmp_path):
    header = {**json.loads(header_of(recording)), **change}
    with pytest.raises(error, match=message):
        parse_header(json.dumps(header), tmp_path)


def test_refuses_a_sensor_whose_name_is_a_number(recording, tmp_path):
    header = parse_header(header_of(recording), tmp_path)
    header["sensor"]["name"] = -(10**30)
    with pytest.raises(BrokenFileError, match="expected text as the sensor's name"):
        recording_from(header, recording.samples, tmp_path)
