import pytest

from midair.errors import BrokenFileError, FileError, MissingFileError, NonFiniteError
from midair.files.atomic import existing_file, refusing, whole_file


def test_a_file_appears_when_the_block_ends(tmp_path):
    with whole_file(tmp_path / "a.txt") as partial:
        partial.write_text("new")
        assert not (tmp_path / "a.txt").exists()
    assert (tmp_path / "a.txt").read_text() == "new"
    assert list(tmp_path.iterdir()) == [tmp_path / "a.txt"]


@pytest.mark.parametrize("wrong", [ValueError, KeyboardInterrupt, OSError, NonFiniteError])
def test_nothing_is_left_of_a_block_that_fails(wrong, tmp_path):
    (tmp_path / "a.txt").write_text("old")
    expected = FileError if wrong is OSError else wrong

    def fail():
        with whole_file(tmp_path / "a.txt") as partial:
            partial.write_text("half")
            raise wrong("in the middle")

    with pytest.raises(expected):
        fail()
    assert (tmp_path / "a.txt").read_text() == "old"
    assert list(tmp_path.iterdir()) == [tmp_path / "a.txt"]


def test_follows_a_link(tmp_path):
    (tmp_path / "real.txt").write_text("old")
    (tmp_path / "link.txt").symlink_to(tmp_path / "real.txt")
    with whole_file(tmp_path / "link.txt") as partial:
        partial.write_text("new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


def test_has_the_rights_of_any_new_file(tmp_path):
    (tmp_path / "other").touch()
    with whole_file(tmp_path / "a.txt") as partial:
        partial.write_text("new")
    assert (tmp_path / "a.txt").stat().st_mode == (tmp_path / "other").stat().st_mode


@pytest.mark.parametrize("name", ["a\0b.h5", "x" * 300])
def test_refuses_impossible_names(name, tmp_path):
    with pytest.raises(FileError), whole_file(tmp_path / name):
        pass
    with pytest.raises(FileError):
        existing_file(tmp_path / name)


def test_finds_what_is_there(tmp_path):
    (tmp_path / "a").write_text("x")
    assert existing_file(str(tmp_path / "a")) == tmp_path / "a"
    with pytest.raises(MissingFileError):
        existing_file(tmp_path / "b")


def test_names_the_file_once(tmp_path):
    with pytest.raises(NonFiniteError) as caught, refusing(tmp_path, "numbers"), refusing(tmp_path, "numbers"):
        raise NonFiniteError("phase: got nan")
    assert str(caught.value) == f"{tmp_path}: phase: got nan"


def test_takes_the_first_line_of_a_parser(tmp_path):
    with pytest.raises(BrokenFileError) as caught, refusing(tmp_path, "a table"):
        raise KeyError("no such\nthing")
    assert "\n" not in str(caught.value)
    assert "expected a table" in str(caught.value)
