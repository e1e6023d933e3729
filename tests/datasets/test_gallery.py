"""Touches to start from, and public sets that are fetched only under the licence that was read."""

import hashlib
import io
import sys
import threading
import zipfile
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest
import soundfile
from PIL import Image

from midair.cli import run
from midair.datasets import PUBLIC_SETS, TOUCHES
from midair.errors import BrokenFileError, FileError, InputError
from midair.files import load
from midair.patterns import load_pattern

LICENCE = b"Permission is hereby granted"


@pytest.mark.long
@pytest.mark.parametrize("name", ["ridges", "heartbeat"])
def test_a_touch_is_seen_heard_and_written(name, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    touch, view = TOUCHES[name], TOUCHES[name].view()
    assert view.simulated is (name == "heartbeat")
    assert run(["gallery", name, "--pictures", "pictures"]) == 0
    printed = capsys.readouterr().out
    assert touch.says.split()[0] in printed
    assert ("midair solve ridges.h5" if name == "ridges" else "midair draw heartbeat.toml") in printed
    with Image.open(f"pictures/{name}.gif") as film, Image.open(f"pictures/{name}.png") as picture:
        assert film.n_frames == len(view.pictures)
        assert picture.size == (192, 192)
    sound, rate = soundfile.read(f"pictures/{name}.wav")
    assert (rate, np.abs(sound).max()) == (8000, pytest.approx(0.9, abs=0.01))
    assert len(sound) / rate == pytest.approx(len(view.pictures) / 50, abs=0.03)
    if name == "ridges":
        assert load("ridges.h5").provenance.notes["licence"] == touch.licence
    else:
        assert load_pattern("heartbeat.toml").foci().pressure.max() == 60


@pytest.mark.long
def test_every_touch_and_set_is_listed_and_the_sound_of_a_heartbeat_is_two_beats(capsys):
    assert run(["gallery"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in (*TOUCHES, *PUBLIC_SETS))
    loud = TOUCHES["heartbeat"].view().pictures.max(axis=(1, 2)) > 1
    assert np.diff(np.pad(loud, 1).astype(int)).clip(0).sum() == 2
    assert run(["gallery", "velvet"]) == 1
    assert "expected one of towel" in capsys.readouterr().err


@pytest.fixture
def served(tmp_path):
    """The set HapMat at an address of this computer."""
    (tmp_path / "www").mkdir()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        archive.writestr("set-1/LICENSE", LICENCE)
    (tmp_path / "www" / "set.zip").write_bytes(packed.getvalue())
    (tmp_path / "www" / "large.zip").write_bytes(bytes(2_100_000))
    (tmp_path / "www" / "bad.zip").write_bytes(b"PK")
    handler = partial(SimpleHTTPRequestHandler, directory=tmp_path / "www")
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever).start()
        address = f"http://127.0.0.1:{server.server_port}"
        digest = hashlib.sha256(LICENCE).hexdigest()
        yield replace(PUBLIC_SETS["hapmat"], archive=f"{address}/set.zip", licence_sha256=digest, size_mb=1)
        server.shutdown()


@pytest.mark.parametrize(("answer", "fetched"), [("y\n", True), ("\n", False), ("", False)])
def test_a_set_is_fetched_after_its_licence_and_size_were_shown_and_accepted(
    answer, fetched, served, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(PUBLIC_SETS, "hapmat", served)
    monkeypatch.setattr(sys, "stdin", io.StringIO(answer))
    assert run(["gallery", "hapmat"]) == 0
    printed = capsys.readouterr()
    assert "MIT, read at the commit" in printed.out
    assert printed.err.startswith("Fetch 1 MB from http://127.0.0.1")
    assert (tmp_path / "hapmat.zip").exists() is fetched


@pytest.mark.parametrize(
    ("name", "licence", "error", "said"),
    [
        ("set.zip", "0", BrokenFileError, "licence that was read, got another"),
        ("large.zip", "", BrokenFileError, "expected about 1 MB, got more"),
        ("bad.zip", "", BrokenFileError, "expected a ZIP file with a LICENSE"),
        ("none.zip", "", FileError, "expected an archive, got"),
        ("", "", InputError, "expected a licence that was read"),
    ],
)
def test_another_licence_a_larger_file_and_no_answer_leave_nothing(name, licence, error, said, served, tmp_path):
    archive = name and served.archive.replace("set.zip", name)
    one = replace(served, archive=archive, licence_sha256=licence or served.licence_sha256)
    with pytest.raises(error, match=said):
        one.fetch(tmp_path / "a.zip")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["www"]
