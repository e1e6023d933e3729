import json

import pytest

from midair.errors import BrokenFileError, MismatchError, UnknownFormatError
from midair.files import ImportOptions
from midair.files.importers.header import header_of, own_take
from midair.files.native.schema import HEADER

NONE = ImportOptions()


def test_one_line_of_ascii_holds_exactly_the_entries_of_the_schema(recording):
    text = header_of(recording)
    assert text.isascii()
    assert text.isprintable()
    assert set(json.loads(text)) == {entry.name for entry in HEADER if entry.required}
    assert set(json.loads(header_of(recording, scale_exponent=3))) == {entry.name for entry in HEADER}


def test_makes_the_recording_again(recording, alike, tmp_path):
    samples = recording.samples.reshape(40, 15)
    alike(own_take(header_of(recording), samples, NONE, tmp_path).recording, recording)
    alike(own_take(header_of(recording, scale_exponent=3), samples / 8, NONE, tmp_path).recording, recording)
    with pytest.raises(MismatchError, match="leave rate out"):
        own_take(header_of(recording), samples, ImportOptions(rate=1.0), tmp_path)


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        ({"frames": 39}, BrokenFileError, "expected 39 frames of 15 channels, got 600 samples instead of 585"),
        ({"kind": "speech"}, BrokenFileError, "header of a midair recording"),
        ({"format": 2}, UnknownFormatError, "update midair"),
        ({"format": "1"}, BrokenFileError, "whole number"),
        ({"sensor": {"rows": 3, "columns": 5, "pitch_m": 1, "name": -1}}, BrokenFileError, "as the sensor's name"),
    ],
)
def test_refuses_headers_of_others(change, error, message, recording, tmp_path):
    header = {**json.loads(header_of(recording)), **change}
    with pytest.raises(error, match=message):
        own_take(json.dumps(header), recording.samples, NONE, tmp_path)
