import os
import sys

import pytest

from midair.devices.safety.lock_files import make_state_folder, state_folder
from midair.errors import FileError


def test_a_chosen_folder_is_taken_and_made_only_when_needed(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "a" / "b"))
    assert state_folder() == tmp_path / "a" / "b"
    assert not (tmp_path / "a").exists()
    assert make_state_folder() == make_state_folder() == tmp_path / "a" / "b"
    assert sys.platform == "win32" or make_state_folder().stat().st_mode & 0o077 == 0


@pytest.mark.skipif(sys.platform == "win32", reason="rights of POSIX")
def test_a_folder_that_others_can_write_to_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path))
    for mode in (0o777, 0o770, 0o1777):
        tmp_path.chmod(mode)
        with pytest.raises(FileError, match=f"only you can write to, got mode {mode:o}; run chmod go-w"):
            make_state_folder()
    tmp_path.chmod(0o755)
    assert make_state_folder() == tmp_path


@pytest.mark.skipif(sys.platform == "win32" or os.geteuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_another_user_is_refused(tmp_path, monkeypatch):
    os.chown(tmp_path, 65534, 65534)
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path))
    with pytest.raises(FileError, match=r"of this user \(number 0\), got one of user 65534; set MIDAIR_STATE"):
        make_state_folder()


@pytest.mark.skipif(sys.platform == "win32", reason="the XDG folders of POSIX")
def test_without_a_choice_it_is_the_user_s(tmp_path, monkeypatch):
    monkeypatch.delenv("MIDAIR_STATE")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert state_folder() == tmp_path / "midair"
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert state_folder() == tmp_path / "home" / ".local" / "state" / "midair"


def test_an_impossible_folder_is_an_error_with_advice(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "file" / "state"))
    with pytest.raises(FileError, match="set MIDAIR_STATE"):
        make_state_folder()
