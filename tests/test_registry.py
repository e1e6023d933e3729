import sys

import pytest

from midair.errors import MissingExtraError
from midair.registry import Registry


@pytest.fixture
def registry(tmp_path, monkeypatch):
    """One with an object of its own, beside an installed package with five entry points."""
    folder = tmp_path / "other_package-1.0.dist-info"
    folder.mkdir()
    (folder / "METADATA").write_text("Metadata-Version: 2.1\nName: other-package\nVersion: 1.0\n")
    rows = [
        "added = json:loads",
        "pi = json:dumps",
        "absent = no_such_package:thing [fast]",
        "gone = json:no_such_name",
        "broken = broken_module:thing",
    ]
    (folder / "entry_points.txt").write_text("[midair.tests]\n" + "\n".join(rows))
    (tmp_path / "broken_module.py").write_text("raise OSError('no library\\nat all')")
    monkeypatch.syspath_prepend(tmp_path)
    return Registry("midair.tests", {"pi": "math:pi", "own": "no_such_package:thing [lsl]"})


def test_own_objects_come_first_and_are_not_replaced(registry):
    assert (list(registry), len(registry)) == (["pi", "own", "added", "absent", "gone", "broken"], 6)
    assert "broken" in repr(registry)
    assert "broken_module" not in sys.modules, "nothing is imported before it is read"
    assert registry["pi"] == pytest.approx(3.14159, abs=1e-5)
    assert registry["added"]("1") == 1
    assert "added" in registry
    assert "other" not in registry
    with pytest.raises(KeyError):
        registry["other"]


def test_what_cannot_be_imported_is_one_line(registry):
    for name, message in (
        ("own", 'own: expected the package no_such_package, it is not installed; pip install "midair[lsl]"'),
        ("absent", 'absent: expected the package no_such_package.*pip install "other-package[fast]"'),
        ("gone", "gone: expected json:no_such_name, got: .*no_such_name"),
        ("broken", "broken: expected broken_module:thing, got: no library$"),
    ):
        with pytest.raises(MissingExtraError, match=message.replace("[", r"\[").replace("]", r"\]")):
            registry[name]
