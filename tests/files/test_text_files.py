import csv
import io
import json
import os

import pytest

from midair.errors import BrokenFileError, MidairError, MissingFileError
from midair.files import csv_text, for_json, load_placement, load_profiles, load_sensor
from midair.files.text_files import (
    LARGEST,
    json_of,
    no_formula,
    printable,
    read_text,
    read_toml,
    toml_of,
)
from midair.settings import Settings

READERS = {
    "text": lambda path: read_text(path, "words"),
    "toml": lambda path: read_toml(path, "words"),
    "sensor": load_sensor,
    "placement": load_placement,
    "profiles": load_profiles,
    "settings": Settings.load,
}
FILES = {
    "deep": b"a = " + b"[" * 100_000,
    "deeper": b"a" + b".a" * 100_000 + b" = 1",
    "quoted": b"[a" + b""" . "b" . 'c.d'""" * 20_000 + b"]",
    "latin": "name = 'Gewürz'".encode("latin-1"),
    "wide": "name = 'a'".encode("utf-16"),
    "none": b"\0" * 40,
}


@pytest.mark.parametrize("reader", READERS)
def test_any_invalid_content_is_one_line_and_only_files_are_opened(reader, tmp_path):
    path = tmp_path / "a.toml"
    for content in ("latin", "wide") if reader == "text" else FILES:
        path.write_bytes(FILES[content])
        with pytest.raises(MidairError) as told:
            READERS[reader](path)
        assert str(told.value).startswith(f"{path}: ")
        assert len(str(told.value)) < 600
    with pytest.raises(MissingFileError, match="found no file"):
        READERS[reader](tmp_path / "no.toml")
    with pytest.raises(BrokenFileError, match="folder"):
        READERS[reader](tmp_path)
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe")
        with pytest.raises(BrokenFileError, match="a pipe or a device"):
            READERS[reader](tmp_path / "pipe")
    with (tmp_path / "large.toml").open("wb") as file:
        file.truncate(LARGEST + 1)
    with pytest.raises(BrokenFileError, match=r"67\.11 MB; check the name"):
        READERS[reader](tmp_path / "large.toml")


def test_deep_json_is_a_wrong_value_and_usual_dotted_keys_are_accepted():
    assert json_of('{"a": [1]}') == {"a": [1]}
    with pytest.raises(ValueError, match="too deep"):
        json_of("[" * 100_000)
    text = 'a.b."c.d".e = "one.two.three' + ".x" * 25 + '"'
    assert toml_of(text)["a"]["b"]["c.d"]["e"].startswith("one.two")


def test_control_characters_are_escaped():
    assert printable("towel é µ, 2 x 3") == "towel é µ, 2 x 3"
    assert printable("a\x1b]52;c;aGk=\x07b") == "a\\x1b]52;c;aGk=\\x07b"
    assert printable("evil\u202egpj.h5\r\x9b2J") == "evil\\u202egpj.h5\\r\\x9b2J"
    assert printable("one\n\ttwo") == "one\n\ttwo"
    assert printable("\udcff.h5").encode() == b"\\udcff.h5"


def test_text_is_no_formula_and_numbers_stay():
    for text in ("=cmd|' /C calc'!A0", "+1+1", "-2+3", "@SUM(A1)", "\t=1", "\r=1"):
        assert no_formula(text) == f"'{text}"
    for value in (-1.5, -3, "-1.5", "+2e-3", "-inf", "towel", "a=b", None, ""):
        assert no_formula(value) == value


def test_rows_of_a_report_are_lines_with_six_digits_and_no_formulas():
    (row,) = csv.DictReader(io.StringIO(csv_text([{"recording": "=1+1", "level": -2.5, "count": -3}])))
    assert row == {"recording": "'=1+1", "level": "-2.5", "count": "-3"}
    rows = [{"a": 1, "b": 0.123456789, "c": "x,y"}, {"a": 2, "b": float("inf"), "c": None}]
    assert csv_text(rows) == 'a,b,c\n1,0.123457,"x,y"\n2,inf,\n'


def test_non_finite_numbers_become_null_at_every_depth():
    value = {"a": float("nan"), "b": [1.0, float("inf"), ("x", float("-inf"))], 3: {"c": None}}
    assert for_json(value) == {"a": None, "b": [1.0, None, ["x", None]], "3": {"c": None}}
    json.dumps(for_json(value), allow_nan=False)
