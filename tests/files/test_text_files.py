import os

import pytest

from midair.errors import BrokenFileError, MidairError, MissingFileError
from midair.files import load_placement, load_profiles, load_sensor
from midair.files.text_files import LARGEST, json_of, read_text, read_toml, toml_of
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
@pytest.mark.parametrize("content", FILES)
def test_any_invalid_content_is_one_line(reader, content, tmp_path):
    path = tmp_path / "a.toml"
    path.write_bytes(FILES[content])
    if reader == "text" and content not in ("latin", "wide"):
        return
    with pytest.raises(MidairError) as told:
        READERS[reader](path)
    assert str(told.value).startswith(f"{path}: ")
    assert len(str(told.value)) < 600


@pytest.mark.parametrize("reader", READERS)
def test_only_files_are_opened(reader, tmp_path):
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


def test_deep_json_is_a_wrong_value():
    assert json_of('{"a": [1]}') == {"a": [1]}
    with pytest.raises(ValueError, match="too deep"):
        json_of("[" * 100_000)


def test_usual_dotted_keys_are_accepted():
    text = 'a.b."c.d".e = "one.two.three' + ".x" * 25 + '"'
    assert toml_of(text)["a"]["b"]["c.d"]["e"].startswith("one.two")
