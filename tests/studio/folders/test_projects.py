import os
import zipfile

import pytest

from midair.errors import BrokenFileError, InputError, MidairError
from midair.studio import folders
from midair.studio.folders import StudioFolder, pack_folder, unpack_folder


def idle(*_):
    pass


@pytest.fixture
def folder(tmp_path):
    (made := tmp_path / "folder").mkdir()
    (made / "old.h5").write_text("mine")
    (made / "blocked").write_text("a file")
    return made


@pytest.fixture
def refused(tmp_path, folder):
    """Refuses a project with some files, whose bytes may be changed first, and leaves nothing behind."""

    def refused(kind, words, files, changed=bytes):
        path = tmp_path / "project.zip"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in files:
                archive.writestr(name, content)
        path.write_bytes(changed(path.read_bytes()))
        before = names(tmp_path)
        with pytest.raises(kind, match=words):
            unpack_folder((str(path), str(folder)), idle)
        assert names(tmp_path) == before
        assert (sorted(os.listdir(folder)), (folder / "old.h5").read_text()) == (["blocked", "old.h5"], "mine")

    return refused


def names(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


KEPT = ["README.md", "s/README", "s/plan.json", "s/a.png", "s/sessions/sub-01.jsonl", "towel.drive.h5", "wool/felt.CSV"]


def test_a_project_has_the_files_that_a_folder_can_have(tmp_path, folder):
    source = StudioFolder.at(tmp_path / "source").path
    left_out = [".hidden.h5", ".git/a.json", "bin/b.h5", "evil.py", "midair/__main__.py", "run", "x.so", "exports/b.h5"]
    for name in [*KEPT, *left_out]:
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_text(name)
    unpack_folder((pack_folder(str(source / "exports" / "p.zip"), idle), str(folder)), idle)
    assert names(folder) == sorted([*KEPT, "old.h5", "blocked"])
    assert (folder / "wool" / "felt.CSV").read_text() == "wool/felt.CSV"


FOREIGN = ["midair/__main__.py", "sitecustomize.py", "numpy.so", "run", "x.h5.exe", "a.pth", ".bashrc", ".bin/x.h5"]
REFUSED = {
    **{name: ([name], "pictures and sounds, got") for name in FOREIGN},
    "out": (["../evil.h5"], "leads out"),
    "absolute": (["/tmp/evil.h5"], "leads out"),
    "there": (["old.h5"], r"old\.h5, which exists already"),
    "a name twice": (["x.h5", "x.h5"], r"x\.h5, which exists already"),
    "a file in place of a folder": (["blocked/x.h5"], "exists already"),
    "a file and a folder of one name": (["n.h5", "n.h5/x.h5"], "project"),
    "many": ([f"{number}.h5" for number in range(50)], "at most 4 GiB in 50 files, got 0.0 GiB in 51"),
}


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_any_other_project_is_refused_as_a_whole(refused, subtests, monkeypatch):
    monkeypatch.setattr(folders, "PROJECT_FILES", 50)
    for case, (files, words) in REFUSED.items():
        with subtests.test(case):
            refused(MidairError, words, [("good.h5", "x"), *((name, "") for name in files)])


def test_a_project_that_is_too_large_or_damaged_is_neither_unpacked_nor_packed(refused, folder, monkeypatch):
    refused(BrokenFileError, "expected expansion to at most 100 times", [("a.h5", "x")], claiming(300 << 20))
    large = r"at most 4 GiB in 10000 files, got 4\.9 GiB"
    refused(InputError, large, [("a.h5", "x"), ("b.h5", "x")], claiming(2500 << 20))

    def damaged(data):
        at = data.rindex(b"b.h5", 0, data.index(b"PK\1\2")) + 30
        return data[:at] + bytes([data[at] ^ 255]) + data[at + 1 :]

    refused(BrokenFileError, "project", [("a.h5", os.urandom(500)), ("b.h5", os.urandom(500))], damaged)
    monkeypatch.setattr(folders, "PROJECT", 2)
    (folder / "exports").mkdir()
    with pytest.raises(InputError, match="copy the folder itself"):
        pack_folder(str(folder / "exports" / "p.zip"), idle)


def claiming(size):
    """Change the size of each unpacked file in the list of the ZIP file."""

    def changed(data):
        first, *entries = data.split(b"PK\1\2")
        return first + b"".join(b"PK\1\2" + each[:20] + size.to_bytes(4, "little") + each[24:] for each in entries)

    return changed
