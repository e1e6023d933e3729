import pytest

from midair.errors import InputError
from midair.studio.folders import StudioFolder
from midair.studio.takes_list import TakesList


@pytest.fixture
def takes(tmp_path):
    for name in ("a.h5", "a.drive.h5", "a.rerecorded.h5", "b.h5", "b.wav"):
        (tmp_path / name).write_text(name)
    (tmp_path / "samples").mkdir()
    return TakesList(folder=StudioFolder.at(tmp_path), samples=tmp_path / "samples")


def names(takes):
    return {path.name for path in takes.folder.path.iterdir() if path.is_file()}


def test_a_take_is_renamed_with_the_files_beside_it(takes):
    assert takes.rename("a.h5", "denim") == "denim.h5"
    assert names(takes) == {"denim.h5", "denim.drive.h5", "denim.rerecorded.h5", "b.h5", "b.wav"}
    before = names(takes)
    for stem, said in (("b", "b.h5 exists already"), ("../c", "leads out of it")):
        with pytest.raises(InputError, match=said):
            takes.rename("denim.h5", stem)
    assert names(takes) == before
    with pytest.raises(InputError, match="got a sample, which stays"):
        takes.rename("sample:towel", "c")


def test_further_drives_belong_to_their_take(takes):
    for name in ("a.paper.drive.h5", "a.paper.rerecorded.h5", "a.best-2.drive.h5", "a.other.drive.h5"):
        (takes.folder.path / name).write_text(name)
    rows = {row["name"]: row for row in takes.rows()}
    assert set(rows) == {"a.h5", "b.h5", "b.wav"}, "drives are no takes"
    drives = [(each["name"], each["played"]) for each in rows["a.h5"]["drives"]]
    assert drives == [("a.h5@best-2", False), ("a.h5@paper", True)]
    assert takes.drives("a.h5@paper") == ["a.h5", "a.h5@best-2", "a.h5@paper"]
    assert takes.folder.free("my fabric (1)", ".wav").name == "my fabric_1.wav"
    free = [takes.free_drive("a.h5", mode) for mode in ("best", "paper", "quick")]
    assert free == ["a.h5@best", "a.h5@paper-2", "a.h5@quick"]
    takes.rename("a.h5@paper", "c")
    assert names(takes) >= {"c.h5", "c.drive.h5", "c.paper.drive.h5", "c.paper.rerecorded.h5", "c.best-2.drive.h5"}
    assert takes.restore(takes.delete("c.h5@best-2")) == "c.h5"


def test_a_copy_has_a_free_name_and_no_drive(takes):
    copies = [takes.duplicate(name) for name in ("a.h5", "a-01.h5", "b.wav")]
    assert (copies, (takes.folder.path / "a-02.h5").read_text()) == (["a-01.h5", "a-02.h5", "b-01.wav"], "a.h5")
    assert "a-01.drive.h5" not in names(takes)


def test_a_deleted_take_lies_in_the_bin_and_comes_back(takes):
    before = names(takes)
    assert takes.delete("a.h5") == "a"
    assert names(takes) == {"b.h5", "b.wav"}
    (takes.folder.path / "a.h5").write_text("another")
    with pytest.raises(InputError, match=r"a\.h5: expected a free name"):
        takes.restore("a")
    assert takes.delete("a.h5") == "a-01", "an earlier one is not overwritten"
    assert takes.restore("a") == "a.h5"
    assert names(takes) == before
    assert (takes.folder.path / "a.h5").read_text() == "a.h5"
