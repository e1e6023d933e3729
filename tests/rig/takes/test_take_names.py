from pathlib import Path

import pytest

from midair.errors import InputError, MissingFileError
from midair.rig.takes.take import Subject, last_subject, slug, store_subject, take_name, take_path


def test_names_count_on_and_never_fill_a_gap(tmp_path):
    towel = Subject(object="Towel", surface="flat")
    assert take_path(tmp_path, towel, repeats=5) == tmp_path / "towel-flat-01.h5"
    for name in ("towel-flat-01.h5", "towel-flat-03.h5", "towel-99.h5", "towel-flat-04.txt", "towel-flat-x.h5"):
        (tmp_path / name).touch()
    assert take_path(tmp_path, towel, repeats=5) == tmp_path / "towel-flat-04.h5"
    (tmp_path / "towel-flat-99.h5").touch()
    assert take_name(tmp_path, "towel-flat") == tmp_path / "towel-flat-100.h5"


@pytest.mark.parametrize(
    ("subject", "stem"),
    [
        (Subject(), "recording"),
        (Subject(object="Brush, soft"), "brush_soft"),
        (Subject(surface="flat"), "flat"),
        (Subject(object="Bürste/Ä", surface="../.."), "bürste_ä"),
        (Subject(object="a" * 500), "a" * 60),
        (Subject(object="タオル", surface="1.5 mm"), "タオル-1.5_mm"),
    ],
)
def test_stems_are_fit_for_a_file_name(subject, stem):
    assert subject.stem == stem
    assert Path(subject.stem).name == subject.stem


def test_slug_has_no_path_in_it():
    assert slug("/etc/passwd\0\n") == "etc_passwd"


def test_a_name_for_one_take_and_a_stem_for_several(tmp_path):
    assert take_path(tmp_path / "a.h5", Subject(), repeats=1) == tmp_path / "a.h5"
    assert take_path(tmp_path / "a.h5", Subject(), repeats=2) == tmp_path / "a-01.h5"


def test_names_that_cannot_be_are_refused(tmp_path):
    (tmp_path / "a.h5").touch()
    with pytest.raises(InputError, match="is there already"):
        take_path(tmp_path / "a.h5", Subject(), repeats=1)
    with pytest.raises(InputError, match=r"expected NAME\.h5"):
        take_path(tmp_path / "a.wav", Subject(), repeats=1)
    with pytest.raises(MissingFileError, match="make it first"):
        take_name(tmp_path / "away", "towel")


def test_notes_hold_what_is_known():
    assert Subject(object="towel", speed="50mm/s").notes == {"object": "towel", "speed": "50mm/s"}


def test_the_last_subject_is_remembered(tmp_path, monkeypatch):
    monkeypatch.setenv("MIDAIR_STATE", str(tmp_path / "state"))
    assert last_subject() == Subject()
    towel = Subject(object="towel", surface="flat", operator="Å")
    store_subject(towel)
    assert last_subject() == towel
    for broken in ("{", "[]", '"x"', '{"object": 3}'):
        (tmp_path / "state" / "subject.json").write_text(broken)
        assert last_subject() in (Subject(), Subject(object="3"))
